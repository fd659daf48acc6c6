"""Reports of a transfer and of a robot's motion, for one or several arms, with outcome and next step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline.config import CONFIG
from maniport.pipeline.options import OPTIONS
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.report.metrics import MISSED_SHARE, group_section, motion_section
from maniport.report.recording import person_section, recording_section
from maniport.report.robot import chain_metrics, placement_section
from maniport.report.transfer import adapter_section, evaluation_section, label
from maniport.report.values import Metric, Report, Section, describe, in_axes, sentence, software
from maniport.util.defaults import POSITION_TOLERANCE

POSITION_GRADES = {
    "position tracked": 0.0,
    "position mostly tracked": MISSED_SHARE,
    "position not tracked": np.inf,
}
DISTANCE_GRADES = {"ellipsoids tracked": ENOUGH_DISTANCE, "ellipsoids approximated": NEAR_DISTANCE,
                   "ellipsoids approximated in part": 1.2, "ellipsoids not tracked": np.inf}  # fmt: skip
"""Largest shares of waypoints far from the path, and median distances, by words; 1.2: one axis 82 % too long."""

Metrics = Mapping[str, Metric]
Result = TransferResult | MotionResult


@describe.register
def result_report(result: TransferResult | MotionResult) -> Report:
    """Report a transfer, or a robot's motion along target ellipsoids."""
    several, robot = len(result.arms) > 1, result.robot.name
    sections, motions = [_settings(result)], dict[str, Metrics]()
    if isinstance(result, TransferResult):
        sections.insert(0, recording_section(result.recording))
        source, spec, count = (
            Path(result.recording.source).stem or "A recording",
            result.config.spec,
            len(result.time),
        )
        person = " and ".join(str(arm.fit.arm.side) for arm in result.arms)
        methods = " and ".join(dict.fromkeys(label(arm.method) for arm in result.arms))
        lead = (
            f"{np.ptp(result.time):.1f} s of the {person} arm{'s'[:several]}, {count} {spec.kind} ellipsoids "
            f"({spec.part}), transferred to {robot} by the method {methods}."
        )
        named = robot if robot != robot.lower() else robot[:1].upper() + robot[1:]
        title = f"{source[:1].upper()}{source[1:]} → {named}: transfer result"
    else:
        assert result.motion is not None
        time = result.motion.trajectory.control_time
        lead = f"{len(result.motion.trajectory.time)} target ellipsoids, followed by {robot} in {np.ptp(time):.1f} s."
        title = (
            f"{Path(result.config.profile).stem} → {robot}"
            if result.config.profile
            else f"The motion of {robot}"
        )
    for arm in reversed(result.arms):
        own = _arm_sections(arm, alone=not several)
        motions = {
            arm.name: {metric.key: metric for metric in own[0].metrics if not metric.is_warning}
        } | motions
        sections[:0] = _named(arm.name, own) if several else own
    if several and result.motion is not None:
        time = result.time if isinstance(result, TransferResult) else result.motion.trajectory.time
        collisions = result.arms[0].collisions
        sections.insert(
            0,
            group_section(result.motion, time, () if collisions is None else collisions.unchecked),
        )
    report = Report(title, lead, tuple(sorted(sections, key=lambda section: section.folded)))
    if result.motion is not None:
        return _with_outcome(report, result, motions)
    return replace(report, outcome=f"{robot} has its targets and was not moved.", graded=False)


def _arm_sections(arm: ArmResult, alone: bool) -> list[Section]:
    """Describe all that belongs to one arm; the first section is its motion."""
    sections = [Section("Robot motion", key="motion", text="The robot was not moved.")]
    if arm.motion is not None:
        time = arm.time if isinstance(arm, ArmTransfer) else arm.motion.time
        sections = [motion_section(arm.motion, time, arm, alone)]
        if arm.placement is not None:
            sections.append(placement_section(arm.placement))
    if isinstance(arm, ArmTransfer):
        if arm.evaluation is not None:
            sections.append(evaluation_section(arm.evaluation))
        sections += [adapter_section(arm.adapter), person_section(arm.fit)]
        human, robot = len(arm.teacher_domain), len(arm.student_domain)
        text = f"{human} samples of the person, {robot} samples of the robot"
        sections[-2].add("Domains", "samples", {"teacher": human, "student": robot}, text)
    return sections


def _named(arm: str, sections: Sequence[Section]) -> list[Section]:
    """Name one of several arms in all texts of its sections, and fold these."""
    name = arm.capitalize()

    def named(metric: Metric) -> Metric:
        if metric.severity != "info" and metric.text:
            return replace(metric, text=f"{name} arm: {metric.text}")
        return (
            replace(metric, label=f"{name}: {metric.label[:1].lower()}{metric.label[1:]}")
            if metric.main
            else metric
        )

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
    section = Section("Settings", key="run", folded=True)
    if isinstance(result, TransferResult):
        spec, count = result.config.spec, len(result.time)
        value = {"kind": spec.kind, "part": spec.part, "count": count}
        about = "Human: trunk frame (x forward, y left, z up); robot: base frame."
        section.warn("step", *result.warnings)
        section.add("Ellipsoids", "ellipsoids", value, f"{count}, {spec.kind}, {spec.part}", about)
        rotation = result.config.rotation.round(6).tolist()
        section.numbers(method=[arm.method for arm in result.arms], base_rotation=rotation)
    else:
        section.add(
            "Files",
            "sources",
            [file for file in (result.config.profile, result.config.path) if file],
        )
    for arm in result.arms:
        chain = chain_metrics(arm.robot)
        base, _, fixed = (metric.text for metric in chain)
        text = f"{arm.robot.name}, {arm.robot.dof} joints, from {base} to {arm.robot.frame}"
        value = {
            "name": arm.robot.name,
            "joints": arm.robot.dof,
            **{metric.key: metric.value for metric in chain},
        }
        key = "robot" if len(result.arms) == 1 else f"{arm.name}_robot"
        section.add("Robot", key, value, text, f"Fixed joints: {fixed}" if fixed else "")
    section.metrics += tuple(software(result.config.seed))
    return section


def _with_outcome(report: Report, result: Result, motions: Mapping[str, Metrics]) -> Report:
    """Add outcome, cause and advice to a report; `motions` are the metrics of each arm."""
    titles, texts = [], []
    for name, metrics in motions.items():
        start = f"{name.capitalize()}: " if len(motions) > 1 else ""
        median, count = metrics["distance"].value["median"], metrics["waypoints"].value
        levels = [(DISTANCE_GRADES, median)]
        if "position_error" in metrics:
            levels.insert(0, (POSITION_GRADES, metrics["position_error"].value["far_share"]))
        grades = (
            next(words for words, bound in table.items() if level <= bound)
            for table, level in levels
        )
        reached = f"{count['count'] - count['missed']} of {count['count']} waypoints reached"
        titles.append(sentence(f"{start}{'; '.join(grades)}: {reached}"))
        if median > ENOUGH_DISTANCE:
            texts.append(sentence(f"{start}median distance {median:.2f}: {in_axes(median)}."))
    report = replace(report, outcome=" ".join(titles), cause=" ".join(texts))
    advice, command = _advice(result, motions, report)
    return replace(report, advice=advice, command=command)


def _advice(result: Result, motions: Mapping[str, Metrics], report: Report) -> tuple[str, str]:
    """Advise what improves the result most, with its command; of several arms the first with an advice decides."""
    slower = _repeated(result, "slower", speed_scale=0.5 * result.config.speed_scale)
    if report.status == "red":
        exceeded = "limits-exceeded" in report.warning_keys
        return (
            ("Do not execute: reduce the speed scale.", slower)
            if exceeded
            else ("Do not execute.", "")
        )
    for arm, metrics in zip(result.arms, motions.values(), strict=True):
        motion, error = arm.motion, metrics.get("position_error")
        assert motion is not None
        if error is not None and error.value["far_share"] > MISSED_SHARE:
            if arm.placement is None:
                return "Place the path in the workspace.", _repeated(result, "placed", place=True)
            if motion.position_tolerance > POSITION_TOLERANCE:
                nearer = _repeated(result, "nearer", position_tolerance=POSITION_TOLERANCE)
                return "Reduce the position tolerance.", nearer
            return "The path exceeds the robot's speed: reduce the speed scale.", slower
        if metrics["distance"].value["median"] <= NEAR_DISTANCE:
            continue
        parts = arm.mean_distance
        if motion.path is not None and parts["path"] >= max(parts["infeasible"], parts["motion"]):
            free = f"maniport track {{folder}}/placed_profile.npz --config {{folder}}/{CONFIG} --orientation free"
            command = f"{free} --no-place -o {{folder}}-no-path"
            placed_by = result.config.workspace, result.config.scale
            if len(result.arms) > 1 or placed_by != (None, None):  # are refused with --no-place
                command = ""
            return "The path constraint dominates the distance: try without it.", command
        if parts["motion"] > parts["infeasible"]:
            text = "Limits dominate the distance: use the whole range of the joints."
            return text, _repeated(result, "all", joint_limit_margin=0.0)
        evaluation = arm.evaluation if isinstance(arm, ArmTransfer) else None
        if evaluation is not None and evaluation.rejected is None:
            better = evaluation.recommended
            if better and better != evaluation.adapter.name:
                text = (
                    f"The targets are infeasible: those of {better} are nearer to the feasible set."
                )
                return text, _repeated(result, better, method=better)
        text = "The targets are infeasible: try other methods and base rotations."
        return text, f"maniport view --config {{folder}}/{CONFIG}"
    return "", ""


def _repeated(result: Result, suffix: str, **options: Any) -> str:
    """Return the command that repeats a run of the command line with other options, into another folder."""
    config = result.config
    if config.profile:
        verb = "track"
    elif config.verb == "learn" and config.recording:
        verb = "learn"
    elif len(config.recording) == 1:
        verb = "transfer"
    else:
        return ""
    command = f"maniport {verb} --config {{folder}}/{CONFIG}"
    words = [word for name, value in options.items() for word in OPTIONS[name].words(value)]
    return " ".join([command, *words, f"-o {{folder}}-{suffix}"])
