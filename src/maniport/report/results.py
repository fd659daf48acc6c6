"""Reports of a transfer and of a robot's motion, for one or several arms, with outcome and next step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline.config import CONFIG, FREE, OPTIONS
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import METRICS, MISSED_SHARE, group_section, motion_section
from maniport.report.recording import person_section, recording_section
from maniport.report.robot import chain_metrics, placement_section
from maniport.report.transfer import adapter_section, evaluation_section, label
from maniport.report.values import (
    INFO,
    RED,
    Metric,
    Report,
    Section,
    describe,
    in_axes,
    listed,
    numbers,
    sentence,
    software,
    warnings_of,
)
from maniport.util.defaults import POSITION_TOLERANCE

GRADES = {
    "position_error": {"position tracked": 0.0, "position mostly tracked": MISSED_SHARE,
                       "position not tracked": np.inf},
    "distance": {"ellipsoids tracked": ENOUGH_DISTANCE, "ellipsoids approximated": NEAR_DISTANCE,
                 "ellipsoids approximated in part": 1.2, "ellipsoids not tracked": np.inf},  # 1.2: 82 % too long
}  # fmt: skip
"""Largest levels of metrics by words for the outcome."""

Metrics = Mapping[str, Metric]
Result = TransferResult | MotionResult


@describe.register
def result_report(result: TransferResult | MotionResult) -> Report:
    """Report a transfer, or a robot's motion along target ellipsoids."""
    several, robot = len(result.arms) > 1, result.robot.name
    sections, motions = [], dict[str, Metrics]()
    if several and result.motion is not None:
        time = result.time if isinstance(result, TransferResult) else result.motion.trajectory.time
        collisions = result.arms[0].collisions
        sections.append(group_section(result.motion, time, () if collisions is None else collisions.unchecked))
    for arm in result.arms:
        own = _arm_sections(arm, alone=not several)
        motions[arm.name] = {metric.key: metric for metric in own[0].metrics if not metric.is_warning}
        sections += _named(arm.name, own) if several else own
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
    else:
        assert result.motion is not None
        trajectory = result.motion.trajectory
        lead = (
            f"{len(trajectory.time)} target ellipsoids, followed by {robot} in {np.ptp(trajectory.control_time):.1f} s."
        )
        title = f"{Path(result.sources[0]).stem} → {robot}" if result.sources else f"The motion of {robot}"
    sections = sorted([*sections, _settings(result)], key=lambda section: section.folded)
    report = Report(title, lead, tuple(sections))
    if result.motion is not None:
        return _with_outcome(report, result, motions)
    return replace(report, outcome=f"{robot} has its targets and was not moved.", graded=False)


def _arm_sections(arm: ArmResult, alone: bool) -> list[Section]:
    """Describe all that belongs to one arm; the first section is its motion."""
    if arm.motion is not None:
        time = arm.time if isinstance(arm, ArmTransfer) else arm.motion.time
        sections = [motion_section(arm.motion, time, arm, alone)]
        if arm.placement is not None:
            sections.append(replace(placement_section(arm.placement), folded=True))
    else:
        sections = [Section("Robot motion", key="motion", text="The robot was not moved.")]
    if isinstance(arm, ArmTransfer):
        compared = [] if arm.evaluation is None else [evaluation_section(arm.evaluation)]
        human, robot = len(arm.teacher_domain), len(arm.student_domain)
        samples = {"teacher": human, "student": robot}
        text = f"{human} samples of the person, {robot} samples of the robot"
        fitted = adapter_section(arm.adapter, Metric("Domains", text, key="samples", value=samples))
        sections += [replace(item, folded=True) for item in (*compared, fitted, person_section(arm.fit))]
    return sections


def _named(arm: str, sections: Sequence[Section]) -> list[Section]:
    """Name one of several arms in all texts of its sections, and fold these."""
    name = arm.capitalize()

    def named(metric: Metric) -> Metric:
        if metric.severity != INFO and metric.text:
            return replace(metric, text=f"{name} arm: {metric.text}")
        return replace(metric, label=f"{name}: {metric.label[:1].lower()}{metric.label[1:]}") if metric.main else metric

    return [
        replace(
            section,
            title=f"{name} arm: {section.title[:1].lower()}{section.title[1:]}",
            key=f"{arm}_{section.key}",
            metrics=tuple(map(named, section.metrics)),
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


def _grade(metric: Metric) -> str:
    """Return the words of `GRADES` for a metric."""
    level = METRICS[metric.key].level(metric.value)
    return next(words for words, bound in GRADES[metric.key].items() if level <= bound)


def _with_outcome(report: Report, result: Result, motions: Mapping[str, Metrics]) -> Report:
    """Add outcome, cause and advice to a report; `motions` are the metrics of each arm."""
    titles, texts, several = [], [], len(motions) > 1
    for name, metrics in motions.items():
        median, counts = metrics["distance"].value["median"], metrics["waypoints"].value
        grades = "; ".join(_grade(metrics[key]) for key in GRADES if key in metrics)
        title = f"{grades}: {counts['count'] - counts['missed']} of {counts['count']} waypoints reached"
        text = f"median distance {median:.2f}: {in_axes(median)}." if median > ENOUGH_DISTANCE else ""
        start = f"{name.capitalize()}: " if several else ""
        titles.append(sentence(start + title))
        texts += [sentence(start + text)] if text else []
    report = replace(report, outcome=" ".join(titles), cause=" ".join(texts))
    advice, command = _advice(result, motions, report)
    return replace(report, advice=advice, command="" if several else command)


def _advice(result: Result, motions: Mapping[str, Metrics], report: Report) -> tuple[str, str]:
    """Advise what improves the result most, with its command; of several arms the first with an advice decides."""
    slower = _track(result, "slower", speed_scale=0.5 * (result.config.speed_scale if result.config else 1.0))
    if report.status == RED:
        exceeded = "limits-exceeded" in report.warning_keys
        return ("Do not execute: reduce the speed scale.", slower) if exceeded else ("Do not execute.", "")
    for arm, metrics in zip(result.arms, motions.values(), strict=True):
        motion, error = arm.motion, metrics.get("position_error")
        assert motion is not None
        if error is not None and error.value["far_share"] > MISSED_SHARE:
            if arm.placement is None:
                return "Place the path in the workspace.", _track(result, "placed", "--place")
            if motion.position_tolerance > POSITION_TOLERANCE:
                command = _track(result, "nearer", position_tolerance=POSITION_TOLERANCE)
                return "Reduce the position tolerance.", command
            return "The path exceeds the robot's speed: reduce the speed scale.", slower
        if metrics["distance"].value["median"] <= NEAR_DISTANCE:
            continue
        parts = arm.mean_distance
        if motion.path is not None and parts["path"] >= max(parts["infeasible"], parts["motion"]):
            command = _track(result, "no-path", path=False)
            return "The path constraint dominates the distance: try without it.", command
        if parts["motion"] > parts["infeasible"]:
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
    return "", ""


def _track(result: Result, suffix: str, *words: str, path: bool = True, **options: float) -> str:
    """Return the command that repeats the motion of one arm with other options, into another folder."""
    config = result.config
    if config is None or len(result.arms) > 1:
        return ""
    changed = [word for name, value in options.items() for word in OPTIONS[name].words(value)]
    if isinstance(config.orientation, str) and config.orientation != FREE:
        changed += ["--orientation", FREE]  # a profile has no hand to follow
    if config.place and "--place" not in words:
        changed += ["--no-place"]
    with_path = path and result.arm.motion is not None and result.arm.motion.path is not None
    files = [f"{{folder}}/placed_profile.npz --config {{folder}}/{CONFIG}", *["--path {folder}/path.npz"] * with_path]
    return " ".join(["maniport track", *files, *words, *changed, f"-o {{folder}}-{suffix}"])
