"""Reports of a transfer and of a robot's motion, for one or several arms, with outcome and next step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maniport.arms import Arm, as_group
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.status import ENOUGH_DISTANCE, NEAR_DISTANCE
from maniport.pipeline.config import CONFIG
from maniport.pipeline.options import OPTIONS
from maniport.pipeline.results import ArmResult, ArmTransfer, MotionResult, TransferResult
from maniport.pipeline.robot_teacher import Demonstration
from maniport.report.describe.motions import MISSED_SHARE, group_section, motion_section
from maniport.report.describe.placements import placement_section
from maniport.report.describe.recordings import person_section, recording_section
from maniport.report.describe.robots import chain_metrics
from maniport.report.describe.transfers import adapter_section, evaluation_section, label
from maniport.report.values import (
    Metric,
    Report,
    Section,
    Statistics,
    Value,
    in_axes,
    sentence,
    software,
)
from maniport.transfer import name_of
from maniport.util.defaults import POSITION_TOLERANCE

POSITION_GRADES = {
    "position tracked": 0.0,
    "position mostly tracked": MISSED_SHARE,
    "position not tracked": np.inf,
}
DISTANCE_GRADES = {
    "ellipsoids tracked": ENOUGH_DISTANCE,
    "ellipsoids approximated": NEAR_DISTANCE,
    "ellipsoids approximated in part": 1.2,
    "ellipsoids not tracked": np.inf,
}
"""Largest shares of waypoints far from the path, and median distances, by words; 1.2: one axis 82 % too long."""

Metrics = Mapping[str, Metric]
Result = TransferResult | MotionResult


class Advice(NamedTuple):
    """What improves a result most, and its command as in `Report`."""

    text: str = ""
    command: str = ""


def result_report(result: TransferResult | MotionResult) -> Report:
    """Report a transfer, or a robot's motion along target ellipsoids."""
    is_group = len(result.arms) > 1
    sections = []
    metrics_of_arms = dict[str, Metrics]()
    if is_group and result.motion is not None:
        sections.append(_group_section(result, result.motion))
    for arm in result.arms:
        arm_sections = _arm_sections(arm, alone=not is_group)
        metrics_of_arms[arm.name] = _metrics_by_key(arm_sections[0])
        if is_group:
            arm_sections = _named(arm.name, arm_sections)
        sections += arm_sections
    if isinstance(result, TransferResult):
        sections.append(recording_section(result.recording))
    sections.append(_settings(result))
    sections.sort(key=lambda section: section.folded)

    if isinstance(result, TransferResult):
        title, lead = _transfer_heading(result)
    else:
        title, lead = _motion_heading(result)
    report = Report(title, lead, tuple(sections))
    if result.motion is not None:
        return _with_outcome(report, result, metrics_of_arms)
    outcome = f"{result.robot.name} has its targets and was not moved."
    return replace(report, outcome=outcome, graded=False)


def _transfer_heading(result: TransferResult) -> tuple[str, str]:
    """Return title and lead of a transfer."""
    robot = result.robot.name
    spec = result.config.spec
    sides = " and ".join(str(arm.fit.arm.side) for arm in result.arms)
    noun = "arm"
    if len(result.arms) > 1:
        noun = "arms"
    methods = [label(arm.method) for arm in result.arms]
    method = " and ".join(dict.fromkeys(methods))
    lead = (
        f"{np.ptp(result.time):.1f} s of the {sides} {noun}, {len(result.time)} {spec.kind} ellipsoids "
        f"({spec.part}), transferred to {robot} by the method {method}."
    )
    source = Path(result.recording.source).stem or "A recording"
    if robot == robot.lower():
        robot = f"{robot[:1].upper()}{robot[1:]}"
    return f"{source[:1].upper()}{source[1:]} → {robot}: transfer result", lead


def _motion_heading(result: MotionResult) -> tuple[str, str]:
    """Return title and lead of a motion without a person."""
    assert result.motion is not None
    robot = result.robot.name
    trajectory = result.motion.trajectory
    seconds = np.ptp(trajectory.control_time)
    lead = f"{len(trajectory.time)} target ellipsoids, followed by {robot} in {seconds:.1f} s."
    title = f"The motion of {robot}"
    if result.config.profile:
        title = f"{Path(result.config.profile).stem} → {robot}"
    demonstration = result.demonstration
    if demonstration is not None:
        spec = result.config.spec
        method = result.config.method
        if not isinstance(method, str):
            method = name_of(method)
        name = demonstration.name or f"A motion of {demonstration.arm.name}"
        title = f"{name} → {robot}: transfer result"
        lead = (
            f"{np.ptp(demonstration.time):.1f} s of the teacher {demonstration.arm.name}, "
            f"{len(trajectory.time)} {spec.kind} ellipsoids ({spec.part}), transferred to {robot} by the "
            f"method {label(method)}."
        )
    return title, lead


def _group_section(result: Result, motion: RobotMotion) -> Section:
    """Describe what concerns all arms of a robot together."""
    time = result.time if isinstance(result, TransferResult) else motion.trajectory.time
    collisions = result.arms[0].collisions
    unchecked = () if collisions is None else collisions.unchecked
    return group_section(motion, time, unchecked, result.arms[0].teacher)


def _metrics_by_key(section: Section) -> Metrics:
    return {metric.key: metric for metric in section.metrics if not metric.is_warning}


def _arm_sections(arm: ArmResult, alone: bool) -> list[Section]:
    """Describe all that belongs to one arm; the first section is its motion."""
    sections = [Section("Robot motion", key="motion", text="The robot was not moved.")]
    if arm.motion is not None:
        time = arm.time if isinstance(arm, ArmTransfer) else arm.motion.time
        sections = [motion_section(arm.motion, time, arm, alone)]
        if arm.placement is not None:
            sections.append(placement_section(arm.placement))
    if not isinstance(arm, ArmTransfer):
        return sections

    if arm.evaluation is not None:
        sections.append(evaluation_section(arm.evaluation))
    adapter = adapter_section(arm.adapter)
    samples = {"teacher": len(arm.teacher_domain), "student": len(arm.student_domain)}
    text = f"{samples['teacher']} samples of the person, {samples['student']} samples of the robot"
    adapter.add("Domains", "samples", samples, text)
    return [*sections, adapter, person_section(arm.fit)]


def _named(arm: str, sections: Sequence[Section]) -> list[Section]:
    """Name one of several arms in all texts of its sections, and fold these."""
    name = arm.capitalize()
    named = []
    for section in sections:
        title = f"{name} arm: {section.title[:1].lower()}{section.title[1:]}"
        metrics = tuple(_named_metric(metric, name) for metric in section.metrics)
        key = f"{arm}_{section.key}"
        named.append(replace(section, title=title, key=key, metrics=metrics, folded=True))
    return named


def _named_metric(metric: Metric, arm: str) -> Metric:
    """Name an arm in a warning, a note, or a metric of the summary."""
    if metric.severity != "info" and metric.text:
        return replace(metric, text=f"{arm} arm: {metric.text}")
    if metric.main:
        return replace(metric, label=f"{arm}: {metric.label[:1].lower()}{metric.label[1:]}")
    return metric


def _settings(result: Result) -> Section:
    """Describe the robot and the settings of a run."""
    config = result.config
    section = Section("Settings", key="run", folded=True)
    if isinstance(result, TransferResult):
        spec = config.spec
        count = len(result.time)
        value = {"kind": spec.kind, "part": spec.part, "count": count}
        about = "Human: trunk frame (x forward, y left, z up); robot: base frame."
        section.warn("step", *result.warnings)
        section.add("Ellipsoids", "ellipsoids", value, f"{count}, {spec.kind}, {spec.part}", about)
        methods = [arm.method for arm in result.arms]
        rotation = config.known_rotation
        matrix = None if rotation is None else rotation.round(6).tolist()
        section.numbers(method=methods, base_rotation=matrix)
    else:
        files = [file for file in (config.profile, config.path) if file]
        if result.demonstration is not None:
            files = list(config.recording)
            _add_teacher(section, result.demonstration)
        section.add("Files", "sources", files)
    for arm in result.arms:
        key = "robot"
        if len(result.arms) > 1:
            key = f"{arm.name}_robot"
        _add_robot(section, arm.robot, key)
    section.metrics += tuple(software(config.seed))
    return section


def _add_teacher(section: Section, demonstration: Demonstration) -> None:
    """Add the robot that is the teacher, its grippers, and columns of the dataset that are not used."""
    arms = as_group(demonstration.arm).arms
    frames = [arm.frame for arm in arms]
    value: dict[str, Value] = {"name": demonstration.arm.name, "frames": frames}
    text = f"{demonstration.arm.name} to {' and '.join(frames)}"
    section.add("Teacher", "teacher", value, text)
    if demonstration.grippers is not None:
        names = list(demonstration.grippers.names)
        about = "Columns that are passed through by their time."
        section.add("Grippers", "grippers", names, about=about)
    if demonstration.ignored:
        section.add("Columns that are not used", "ignored_columns", list(demonstration.ignored))


def _add_robot(section: Section, robot: Arm, key: str) -> None:
    """Add joints and frames of an arm of the robot."""
    base, frame, fixed = chain_metrics(robot)
    value: dict[str, Value] = {"name": robot.name, "joints": robot.dof}
    for metric in (base, frame, fixed):
        value[metric.key] = metric.value
    text = f"{robot.name}, {robot.dof} joints, from {base.text} to {robot.frame}"
    about = ""
    if fixed.text:
        about = f"Fixed joints: {fixed.text}"
    section.add("Robot", key, value, text, about)


def _with_outcome(report: Report, result: Result, metrics_of_arms: Mapping[str, Metrics]) -> Report:
    """Add outcome, cause and advice to a report."""
    outcomes = []
    causes = []
    for arm, (name, metrics) in zip(result.arms, metrics_of_arms.items(), strict=True):
        assert arm.motion is not None
        directed = arm.motion.directed
        start = ""
        if len(metrics_of_arms) > 1:
            start = f"{name.capitalize()}: "
        distance = _statistics(metrics, "distance").median
        grades = _gains(metrics)
        if not directed:
            grades = [_grade(DISTANCE_GRADES, distance)]
        if "position_error" in metrics:
            far_share = _statistics(metrics, "position_error").far_share
            assert far_share is not None
            grades.insert(0, _grade(POSITION_GRADES, far_share))
        waypoints = metrics["waypoints"]
        count = int(waypoints.number("count"))
        reached = count - int(waypoints.number("missed"))
        outcome = f"{start}{'; '.join(grades)}: {reached} of {count} waypoints reached"
        outcomes.append(sentence(outcome))
        if distance > ENOUGH_DISTANCE and not directed:
            cause = f"{start}median distance {distance:.2f}: {in_axes(distance)}."
            causes.append(sentence(cause))

    report = replace(report, outcome=" ".join(outcomes), cause=" ".join(causes))
    text, command = _advice(result, metrics_of_arms, report)
    return replace(report, advice=text, command=command)


def _gains(metrics: Metrics) -> list[str]:
    """Return how strong and fast a motion is beside positions only."""
    gains = []
    for key, adjective in (("force", "strong"), ("velocity", "fast")):
        value = metrics[key].value if key in metrics else None
        if isinstance(value, Mapping) and "position_only" in value:
            ratio = value["robot"]["median"] / value["position_only"]["median"]
            gains.append(f"{ratio:.1f} times as {adjective}")
    if not gains:
        return []
    return [f"{' and '.join(gains)} as with positions only"]


def _statistics(metrics: Metrics, key: str) -> Statistics:
    statistics = metrics[key].statistics
    assert statistics is not None
    return statistics


def _grade(grades: Mapping[str, float], value: float) -> str:
    """Return the first words whose bound a value does not exceed."""
    return next(words for words, bound in grades.items() if value <= bound)


def _advice(result: Result, metrics_of_arms: Mapping[str, Metrics], report: Report) -> Advice:
    """Advise what improves the result most, with its command; of several arms the first with an advice decides."""
    if report.status == "red":
        if "limits-exceeded" in report.warning_keys:
            return Advice("Do not execute: reduce the speed scale.", _slower(result))
        return Advice("Do not execute.")
    for arm, metrics in zip(result.arms, metrics_of_arms.values(), strict=True):
        assert arm.motion is not None
        if "position_error" in metrics:
            far_share = _statistics(metrics, "position_error").far_share
            assert far_share is not None
            if far_share > MISSED_SHARE:
                return _position_advice(result, arm, arm.motion)
        far = _statistics(metrics, "distance").median > NEAR_DISTANCE
        if far and not arm.motion.directed:
            return _distance_advice(result, arm, arm.motion)
    return Advice()


def _position_advice(result: Result, arm: ArmResult, motion: ArmMotion) -> Advice:
    """Advise what brings the end effector nearer to its path."""
    if arm.placement is None:
        command = _repeated(result, "placed", "place", True)
        return Advice("Place the path in the workspace.", command)
    if motion.position_tolerance > POSITION_TOLERANCE:
        command = _repeated(result, "nearer", "position_tolerance", POSITION_TOLERANCE)
        return Advice("Reduce the position tolerance.", command)
    text = "The path exceeds the robot's speed: reduce the speed scale."
    return Advice(text, _slower(result))


def _distance_advice(result: Result, arm: ArmResult, motion: ArmMotion) -> Advice:
    """Advise what reduces the distance, by its largest part."""
    parts = arm.mean_distance
    largest_other = max(parts["infeasible"], parts["motion"])
    if motion.path is not None and parts["path"] >= largest_other:
        text = "The path constraint dominates the distance: try without it."
        return Advice(text, _without_path(result))
    if parts["motion"] > parts["infeasible"]:
        text = "Limits dominate the distance: use the whole range of the joints."
        return Advice(text, _repeated(result, "all", "joint_limit_margin", 0.0))

    evaluation = arm.evaluation if isinstance(arm, ArmTransfer) else None
    if evaluation is not None and evaluation.rejected is None:
        better = evaluation.recommended
        gaps = evaluation.values
        if gaps.get(better, np.inf) < gaps.get(evaluation.adapter.name, 0.0):
            text = f"The targets are infeasible: those of {better} are nearer to the feasible set."
            return Advice(text, _repeated(result, better, "method", better))
    text = "The targets are infeasible: try other methods and base rotations."
    return Advice(text, f"maniport view --config {{folder}}/{CONFIG}")


def _without_path(result: Result) -> str:
    """Return the command that tracks the ellipsoids of a result without its path, if there is one."""
    config = result.config
    is_placed = config.workspace is not None or config.scale is not None
    if len(result.arms) > 1 or is_placed:  # are refused with --no-place
        return ""
    track = f"maniport track {{folder}}/placed_profile.npz --config {{folder}}/{CONFIG}"
    return f"{track} --orientation free --no-place -o {{folder}}-no-path"


def _slower(result: Result) -> str:
    return _repeated(result, "slower", "speed_scale", 0.5 * result.config.speed_scale)


def _repeated(result: Result, suffix: str, option: str, value: str | float | bool) -> str:
    """Return the command that repeats a run of the command line with another option, into another folder."""
    config = result.config
    if config.profile:
        verb = "track"
    elif config.verb == "learn" and config.recording:
        verb = "learn"
    elif len(config.recording) == 1:
        verb = "transfer"
    else:
        return ""
    words = " ".join(OPTIONS[option].words(value))
    return f"maniport {verb} --config {{folder}}/{CONFIG} {words} -o {{folder}}-{suffix}"
