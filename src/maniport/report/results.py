"""Reports of a transfer and of a robot's motion, for one or several arms, with outcome and next step."""

import contextlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np

from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline.config import CONFIG, OPTIONS
from maniport.pipeline.options import FREE
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import METRICS, describe, in_axes
from maniport.report.motion import group_section, motion_section
from maniport.report.recording import FIT, RECORDING, person_section, recording_section
from maniport.report.robot import chain_metrics, placement_section
from maniport.report.transfer import adapter_section, evaluation_section, label
from maniport.report.values import (
    INFO,
    RED,
    Metric,
    Report,
    Section,
    Summary,
    listed,
    numbers,
    sentence,
    warning,
    warnings_of,
)
from maniport.transfer.rigid_adapter import RigidAdapter, transport_rotation
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.defaults import POSITION_TOLERANCE
from maniport.version import __version__

OF_ALL_ARMS = frozenset({"duration", "collisions", "collision", "unchecked-collisions", "missing-meshes",
                         "unchecked-links", "limits-exceeded"})  # fmt: skip
"""Keys of metrics and of warnings that concern all arms together."""

Metrics = Mapping[str, Metric]
Result = TransferResult | MotionResult


@describe.register
def result_report(result: TransferResult | MotionResult) -> Report:
    """Report a transfer, or a robot's motion along target ellipsoids."""
    several, robot = len(result.arms) > 1, result.robot.name
    sections, motions, fits = [], dict[str, Metrics](), list[str]()
    if several and result.motion is not None:
        time = result.time if isinstance(result, TransferResult) else result.motion.trajectory.time
        collisions = result.arms[0].collisions
        sections.append(group_section(result.motion, time, () if collisions is None else collisions.unchecked))
    for arm in result.arms:
        own = _arm_sections(arm)
        motions[arm.name] = {metric.key: metric for metric in own[0].metrics if not metric.is_warning}
        sections += _named(arm.name, own) if several else own
        if isinstance(arm, ArmTransfer):
            fits += [f"{arm.name.capitalize()} arm: " * several + text for text in arm.fit.quality_warnings]
    if isinstance(result, TransferResult):
        source, spec = Path(result.recording.source).stem or "A recording", result.spec
        person = " and ".join(str(arm.fit.arm.side) for arm in result.arms)
        methods = " and ".join(dict.fromkeys(label(arm.method) for arm in result.arms))
        lead = (
            f"{np.ptp(result.time):.1f} s of the {person} arm{'s'[:several]}, {len(result.time)} {spec.kind} "
            f"ellipsoids ({spec.part}), transferred to {robot} by the method {methods}."
        )
        named = robot if robot != robot.lower() else robot[:1].upper() + robot[1:]
        title = f"{source[:1].upper()}{source[1:]} → {named}: transfer result"
        sections.append(replace(recording_section(result.recording), folded=True))
        data_warnings = (*warnings_of(RECORDING, result.recording.quality_warnings), *warnings_of(FIT, fits))
    else:
        assert result.motion is not None
        trajectory, data_warnings = result.motion.trajectory, ()
        lead = (
            f"{len(trajectory.time)} target ellipsoids, followed by {robot} in {np.ptp(trajectory.control_time):.1f} s."
        )
        title = f"{Path(result.sources[0]).stem} → {robot}" if result.sources else f"The motion of {robot}"
    sections = sorted([*sections, _settings(result)], key=lambda section: section.folded)
    report = Report(title, lead, tuple(sections), Summary(""), data_warnings)
    if result.motion is not None:
        return replace(report, summary=_summary(result, motions, report.status))
    evaluations = (arm.evaluation for arm in result.arms if isinstance(arm, ArmTransfer))
    gaps = [item.adapter.feasibility_gap for item in evaluations if item is not None]
    medians = listed(f"{gap.median:.2f}" for gap in gaps if gap is not None)
    text = f"Median distance of the targets to the feasible set: {medians}." if medians else ""
    return replace(report, summary=Summary(f"{robot} has its targets and was not moved.", text, graded=False))


def _arm_sections(arm: ArmResult) -> list[Section]:
    """Describe all that belongs to one arm; the first section is its motion."""
    if arm.motion is not None:
        sections = [motion_section(arm.motion, arm.time if isinstance(arm, ArmTransfer) else arm.motion.time, arm)]
        if arm.placement is not None:
            sections.append(replace(placement_section(arm.placement), folded=True))
    else:
        gap = arm.evaluation.adapter.feasibility_gap if isinstance(arm, ArmTransfer) and arm.evaluation else None
        definition, warned = METRICS["feasibility_gap"], []
        if gap is not None and gap.median > definition.warn_above:
            warned.append(warning(definition.warning_key, definition.warning.format(median=gap.median)))
        sections = [Section("Robot motion", tuple(warned), key="motion", text="The robot was not moved.")]
    if isinstance(arm, ArmTransfer):
        compared = [] if arm.evaluation is None else [evaluation_section(arm.evaluation)]
        sections += [replace(item, folded=True) for item in (*compared, _adapter(arm), person_section(arm.fit))]
    return sections


def _named(arm: str, sections: Sequence[Section]) -> list[Section]:
    """Name one of several arms in all texts of its sections, and fold these."""
    name = arm.capitalize()

    def named(metric: Metric) -> Metric:
        if metric.severity != INFO and metric.text:
            return replace(metric, text=f"{name} arm: {metric.text}")
        if metric.key in OF_ALL_ARMS:
            return replace(metric, text="", main=False)
        return replace(metric, label=f"{name}: {metric.label[:1].lower()}{metric.label[1:]}") if metric.main else metric

    return [
        replace(
            section,
            title=f"{name} arm: {section.title[:1].lower()}{section.title[1:]}",
            key=f"{arm}_{section.key}",
            metrics=tuple(named(item) for item in section.metrics if not (item.is_warning and item.key in OF_ALL_ARMS)),
            folded=True,
        )
        for section in sections
    ]


def _settings(result: Result) -> Section:
    """Describe the robot and the settings of a run."""
    metrics: list[Metric] = []
    if isinstance(result, TransferResult):
        spec = result.spec
        frames = "Human: trunk frame (x forward, y left, z up); robot: base frame."
        value = {"kind": spec.kind, "part": spec.part, "count": len(result.time)}
        metrics += [
            *warnings_of("step", result.warnings),
            Metric("Ellipsoids", f"{len(result.time)}, {spec.kind}, {spec.part}", frames, "ellipsoids", value),
            *numbers(method=[arm.method for arm in result.arms], base_rotation=result.base_rotation.round(6).tolist()),
        ]
    else:
        metrics.append(Metric("Files", listed(result.sources), key="sources", value=list(result.sources)))
    for arm in result.arms:
        chain = chain_metrics(arm.robot)
        base, _, fixed = (metric.text for metric in chain)
        text = f"{arm.robot.name}, {arm.robot.dof} joints, from {base} to {arm.robot.frame}"
        value = {"name": arm.robot.name, "joints": arm.robot.dof, **{metric.key: metric.value for metric in chain}}
        key = "robot" if len(result.arms) == 1 else f"{arm.name}_robot"
        metrics.append(Metric("Robot", text, f"Fixed joints: {fixed}" if fixed else "", key, value))
    motion = result.arms[0].motion
    if motion is not None:
        rate = float((len(motion.control_time) - 1) / np.ptp(motion.control_time))
        metrics += numbers(control_rate_hz=rate, damping=motion.damping.epsilon)
    return Section("Settings", (*metrics, *software(result.random_state)), key="run", folded=True)


def software(seed: int | None) -> list[Metric]:
    """Return the seed and the versions of the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}.items():
        with contextlib.suppress(metadata.PackageNotFoundError):  # it is installed by other means than a package
            versions[name] = metadata.version(package)
    about = "The same seed and versions give the same numbers."
    return [
        Metric("Seed", "none" if seed is None else str(seed), about, "random_state", seed),
        Metric("Versions", listed(map(" ".join, versions.items())), key="versions", value=versions),
    ]


def _adapter(arm: ArmTransfer) -> Section:
    """Describe the adapter, the samples that it was fitted to, and its rotation relative to parallel transport."""
    adapter, human, robot = arm.adapter, len(arm.teacher_domain), len(arm.student_domain)
    more = [
        Metric("Domains", f"{human} samples of the person, {robot} samples of the robot", "", "samples",
               {"teacher": human, "student": robot}),
        Metric("Time to fit", f"{arm.seconds_to_fit:.2f} s"),  # not for JSON: the same seed gives the same bytes
    ]  # fmt: skip
    if isinstance(adapter, RigidAdapter):
        start = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
        angle = float(np.degrees(rotation_angle(adapter.rotation_, start)))
        name, key = "Rotation from parallel transport", "rotation_from_transport"
        more.append(Metric(name, f"{angle:.2f}°", "", key, angle, "°"))
    return adapter_section(adapter, *more, mounted=True)


def _summary(result: Result, motions: Mapping[str, Metrics], status: str) -> Summary:
    """Summarize a motion; `motions` are the metrics of each arm."""
    titles, texts, several = [], [], len(motions) > 1
    for name, metrics in motions.items():
        median, counts = metrics["distance"].value["median"], metrics["waypoints"].value
        grades = "; ".join(metrics[key].grade for key in ("position_error", "distance") if key in metrics)
        title = f"{grades}: {counts['count'] - counts['missed']} of {counts['count']} waypoints reached"
        text = f"median distance {median:.2f}: {in_axes(median)}." if median > ENOUGH_DISTANCE else ""
        if "jumps" in metrics and (error := metrics["position_error"].value)["far_share"]:
            at_jumps = metrics["jumps"].value.get("there", {"position_error_mm": 0.0})
            if at_jumps["position_error_mm"] >= error["max"]:
                text = f"{text} The position error is largest where the recording jumps.".strip()
        start = f"{name.capitalize()}: " if several else ""
        titles.append(sentence(start + title))
        texts += [sentence(start + text)] if text else []
    advice, command = _advice(result, motions, status)
    return Summary(" ".join(titles), " ".join(texts), advice, "" if several else command)


def _advice(result: Result, motions: Mapping[str, Metrics], status: str) -> tuple[str, str]:
    """Advise what improves the result most, with its command; of several arms the first with an advice decides."""
    slower = _track(result, "slower", speed_scale=0.5 * (result.config.motion.speed_scale if result.config else 1.0))
    if status == RED:
        limits = (metrics["limits"] for metrics in motions.values() if "limits" in metrics)
        exceeded = any(METRICS["limits"].level(item.value) > METRICS["limits"].warn_above for item in limits)
        return ("Do not execute: reduce the speed scale.", slower) if exceeded else ("Do not execute.", "")
    for arm, metrics in zip(result.arms, motions.values(), strict=True):
        motion, error = arm.motion, metrics.get("position_error")
        assert motion is not None
        if error is not None and error.grade == list(METRICS["position_error"].grades)[-1]:
            if arm.placement is None:
                return "Place the path in the workspace.", _track(result, "placed", "--place")
            if motion.position_tolerance > POSITION_TOLERANCE:
                command = _track(result, "nearer", position_tolerance=POSITION_TOLERANCE)
                return "Reduce the position tolerance.", command
            return "The path exceeds the robot's speed: reduce the speed scale.", slower
        if metrics["distance"].value["median"] <= NEAR_DISTANCE:
            continue
        parts = arm.mean_distance
        if motion.path is not None and parts.path >= max(parts.infeasible, parts.motion):
            command = _track(result, "no-path", path=False)
            return "The path constraint dominates the distance: try without it.", command
        if parts.motion > parts.infeasible:
            command = _track(result, "all", joint_limit_margin=0.0)
            return "Limits dominate the distance: use the whole range of the joints.", command
        evaluation = arm.evaluation if isinstance(arm, ArmTransfer) else None
        better = "" if evaluation is None or evaluation.rejected is not None else evaluation.recommended
        if better and evaluation is not None and better != evaluation.adapter.name:
            text = f"The targets are infeasible: those of {better} are nearer to the feasible set."
            command = f"maniport transfer --config {{folder}}/{CONFIG} --method {better} -o {{folder}}-{better}"
            return text, command if result.config is not None and len(result.config.recording) == 1 else ""
        command = "" if result.config is None else f"maniport view --config {{folder}}/{CONFIG}"
        return "The targets are infeasible: try other methods and base rotations.", command
    return "joints.csv has the motion; --export writes it for ROS 2, MuJoCo and others.", ""


def _track(result: Result, suffix: str, *words: str, path: bool = True, **options: float) -> str:
    """Return the command that repeats the motion of one arm with other options, into another folder."""
    config = result.config
    if config is None or len(result.arms) > 1:
        return ""
    changed = [word for name, value in options.items() for word in OPTIONS[name][1].words(value)]
    if isinstance(config.motion.orientation, str) and config.motion.orientation != FREE:
        changed += ["--orientation", FREE]  # a profile has no hand to follow
    if config.placement.place and "--place" not in words:
        changed += ["--no-place"]
    with_path = path and result.arm.motion is not None and result.arm.motion.path is not None
    files = [f"{{folder}}/placed_profile.npz --config {{folder}}/{CONFIG}", *["--path {folder}/path.npz"] * with_path]
    return " ".join(["maniport track", *files, *words, *changed, f"-o {{folder}}-{suffix}"])
