"""Reports of the main job for one arm or both, and of a robot's motion along given ellipsoids."""

import platform
from collections.abc import Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np

from maniport.arms import Arm
from maniport.errors import argument
from maniport.pipeline import BothResult, TransferResult
from maniport.pipeline.both_result import FOLDERS
from maniport.pipeline.execution import Execution
from maniport.report.metrics import (
    INFO,
    Metric,
    Report,
    Section,
    Summary,
    Table,
    at_time,
    defined,
    describe,
    listed,
    numbers,
    warning,
    warnings_of,
)
from maniport.report.motion import collision_metrics, infeasible_targets, motion_section, plan_metrics
from maniport.report.recording import FIT, RECORDING, person_section, recording_section
from maniport.report.robot import chain_metrics, placement_section
from maniport.report.summary import GREEN, mean_distance, motion_summary, status_of, unmoved
from maniport.report.transfer import adapter_section, base_rotation_text, evaluation_section
from maniport.transfer.rigid_adapter import RigidAdapter, transport_rotation
from maniport.transfer.rotation_group import rotation_angle
from maniport.util.validation import Array
from maniport.version import __version__

STEP = "step"  # Key of warnings that a step of the run gave


@describe.register
def run_report(result: TransferResult) -> Report:
    """Report a transfer."""
    robot, execution = result.robot, result.execution
    source = Path(result.recording.source).stem or "A recording"
    moved = "" if execution is None else f" The motion takes {np.ptp(execution.motion.control_time):.1f} s."
    lead = (
        f"{np.ptp(result.time):.1f} s of the {result.fit.arm.side} arm, {len(result.time)} {result.spec.kind} "
        f"ellipsoids ({result.spec.part}), transferred to {robot.name} by {result.method}.{moved}"
    )
    gaps = None if result.evaluation is None else result.evaluation.adapter.feasibility_gap
    unmoved_metrics = () if gaps is None else tuple(infeasible_targets(gaps.median))
    sections = (
        *([Section("Targets", unmoved_metrics, key="motion", text="The robot was not moved.")] if execution is None
          else motion_sections(execution, result.time)),
        *([] if result.evaluation is None
          else [evaluation_section(result.evaluation, choice=result.choice, time=result.time)]),
        *(replace(section, folded=True) for section in (_adapter(result), person_section(result.fit),
                                                        recording_section(result.recording), _settings(result))),
    )  # fmt: skip
    quality_warnings = (
        *warnings_of(RECORDING, result.recording.quality_warnings),
        *warnings_of(FIT, result.fit.quality_warnings),
    )
    report = Report(f"{source[:1].upper()}{source[1:]} → {robot.name}", lead, sections, data_warnings=quality_warnings)
    if execution is None:
        return replace(report, summary=unmoved(result))
    return replace(report, summary=motion_summary(execution, report, result))


@describe.register
def execution_report(execution: Execution) -> Report:
    """Report a robot's motion along given ellipsoids."""
    motion, robot = execution.motion, execution.robot
    files = Metric("Files", listed(execution.sources), "Target ellipsoids and path.", "sources",
                   list(execution.sources))  # fmt: skip
    settings = files, *_robot(robot, execution), *software(execution.random_state)
    lead = f"{len(motion.time)} target ellipsoids, followed by {robot.name} in {np.ptp(motion.control_time):.1f} s."
    title = f"{Path(execution.sources[0]).stem} → {robot.name}" if execution.sources else f"The motion of {robot.name}"
    sections = (*motion_sections(execution), Section("Settings", settings, key="run", folded=True))
    report = Report(title, lead, sections)
    return replace(report, summary=motion_summary(execution, report))


def motion_sections(execution: Execution, clock: Array | None = None) -> list[Section]:
    """Describe a motion and the placement of its path; `clock` as in `motion_section`."""
    motion, placed = execution.motion, execution.placement
    time = motion.time if clock is None else clock
    more = [
        *plan_metrics(execution.plan, motion, execution.room, clock, execution.collisions),
        *_lowest(execution, time),
        mean_distance(execution),
        *_orientation_price(execution),
        *infeasible_targets(float(np.median(execution.gap))),
        defined("feasibility_gap", execution.gap, time),
    ]
    section = motion_section(motion, more, clock)
    if placed is None:
        return [section]
    return [section, placement_section(placed, np.interp(execution.placed_time, motion.time, time))]


def _lowest(execution: Execution, time: Array) -> list[Metric]:
    """Report the lowest point of each moving link; warn where it is below the base plane and no table is given."""
    lowest, collisions = execution.lowest, execution.collisions
    if lowest is None:
        return [warning("unchecked-floor", "the height above the base plane is unknown: no link has a known shape")]
    when = {
        point.link: float(np.interp(point.time, execution.motion.time, time)) for point in execution.lowest_of_links
    }
    value = {p.link: {"height_mm": 1e3 * p.height, "at_s": when[p.link]} for p in execution.lowest_of_links}
    text = f"{1e3 * lowest.height:.0f} mm, {lowest.link} {at_time(when[lowest.link])}"
    metric = Metric("Lowest point", text, "Of the moving links, above the base plane.", "lowest_points", value)
    if lowest.height >= 0.0 or (collisions is not None and collisions.table is not None):
        return [metric]
    below = f"{lowest.link} is up to {-1e3 * lowest.height:.0f} mm below the base plane ({at_time(when[lowest.link])})"
    return [warning("below-base-plane", f"{below}. {argument('table', 0)} keeps the robot above it"), metric]


def _orientation_price(execution: Execution) -> list[Metric]:
    """Return the mean distance with and without the orientation constraint."""
    if execution.free is None:
        return []
    kept, free = (float(np.mean(one.distance)) for one in (execution.plan, execution.free))
    text = f"{kept - free:+.2f} in the mean distance: {kept:.2f}; {free:.2f} with free orientation"
    return [Metric("Cost of the orientation", text, "", "orientation_price", {"kept": kept, "free": free})]


def _robot(robot: Arm, execution: Execution | None = None) -> list[Metric]:
    """Describe the robot and the settings of its motion."""
    chain = chain_metrics(robot)
    base, _, held = (metric.text for metric in chain)
    limits = {name: [low, high] for name, low, high in zip(robot.joint_names, robot.lower, robot.upper, strict=True)}
    metrics = [
        Metric("Robot", f"{robot.name}, {robot.dof} joints, from {base} to {robot.frame}", key="robot",
               value={"name": robot.name, "joints": robot.dof, **{metric.key: metric.value for metric in chain}}),
        *numbers(joint_limits=limits),
        Metric("Fixed joints", held),
    ]  # fmt: skip
    if execution is None:
        return metrics
    motion = execution.motion
    rate = float((len(motion.control_time) - 1) / np.ptp(motion.control_time))
    return [
        *metrics,
        Metric("Control rate", f"{rate:.4g} Hz", "", "control_rate", rate, "Hz"),
        Metric("Damping", f"{motion.damping.epsilon:.3g}", "Added to all eigenvalues before ellipsoids are compared.",
               "damping", motion.damping.epsilon),
    ]  # fmt: skip


def software(seed: int | None) -> list[Metric]:
    """Return the seed and the versions of the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}.items():
        try:
            versions[name] = metadata.version(package)
        except metadata.PackageNotFoundError:  # installed by other means than a package
            versions[name] = "of unknown version"
    text = "none" if seed is None else str(seed)
    return [
        Metric("Seed", text, "The same seed and versions give the same numbers.", "random_state", seed),
        Metric("Versions", listed([f"{name} {version}" for name, version in versions.items()]), key="versions",
               value=versions),
    ]  # fmt: skip


def _adapter(result: TransferResult) -> Section:
    """Describe the adapter, the samples that it was fitted to, and its rotation relative to parallel transport."""
    adapter, human, robot = result.adapter, len(result.teacher_domain), len(result.student_domain)
    label = "Time to fit" if result.choice is None else "Time to choose and fit"
    more = [
        Metric("Domains", f"{human} samples of the person, {robot} samples of the robot", "", "samples",
               {"teacher": human, "student": robot}),
        Metric(label, f"{result.seconds_to_fit:.2f} s"),  # not for JSON: the same seed gives the same bytes
    ]  # fmt: skip
    if isinstance(adapter, RigidAdapter):
        start = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
        away = float(np.degrees(rotation_angle(adapter.rotation_, start)))
        more.append(
            Metric("Rotation from parallel transport", f"{away:.2f}°", "", "rotation_from_transport", away, "°")
        )
    return adapter_section(adapter, *more, mounted=True)


def _settings(result: TransferResult) -> Section:
    spec, count = result.spec, len(result.time)
    metrics = (
        *warnings_of(STEP, result.warnings),
        *_robot(result.robot, result.execution),
        Metric("Ellipsoids", f"{count}, {spec.kind}, {spec.part}",
               "Human: trunk frame (x forward, y left, z up); robot: base frame.", "ellipsoids",
               {"kind": spec.kind, "part": spec.part, "count": count}),
        Metric("Base rotation", base_rotation_text(result.base_rotation), "From the trunk frame to the robot's base.",
               "base_rotation", result.base_rotation.round(6).tolist()),
        *numbers(method=result.method),
        *software(result.random_state),
    )  # fmt: skip
    return Section("Settings", metrics, key="run")


@describe.register
def both_report(result: BothResult) -> Report:
    """Report a transfer of both arms: the pair, then each arm as a run of its own."""
    reports = dict(zip(FOLDERS, map(run_report, result.each), strict=True))
    source, motion = Path(result.recording.source).stem or "A recording", result.motion
    moved = "" if motion is None else f" The motion takes {np.ptp(motion.trajectory.control_time):.1f} s."
    lead = (
        f"{np.ptp(result.fits.time):.1f} s of both arms, {len(result.fits)} ellipsoids each, transferred to "
        f"{result.robot.name}: left by {result.left.method}, right by {result.right.method}.{moved} The folders left "
        "and right have the report of each arm."
    )
    shared = next(section for section in reports[FOLDERS[0]].sections if section.key == RECORDING)
    sections = (_pair(result), *(one for side, report in reports.items() for one in _of_one(side, report)), shared)
    quality_warnings = (
        *warnings_of(RECORDING, result.recording.quality_warnings),
        *warnings_of(FIT, result.fits.quality_warnings),
    )
    title = f"{source[:1].upper()}{source[1:]} → {result.robot.name}, both arms"
    report = Report(title, lead, sections, data_warnings=quality_warnings)
    return replace(report, summary=_both_summary(result, reports, report.warning_keys))


def _pair(result: BothResult) -> Section:
    """Describe what concerns all arms together."""
    metrics, motion, robot = [*warnings_of(STEP, result.warnings)], result.motion, result.robot
    if motion is not None:
        collisions = None if result.left.execution is None else result.left.execution.collisions
        at = float(np.interp(motion.clearance.time, motion.trajectory.time, result.fits.time))
        relative = None if motion.relative_error is None else motion.relative_error[:, 0]
        metrics += [
            *collision_metrics(motion.clearance, at, collisions),
            Metric("Configurations", "optimized together" if motion.coupled else "those of each arm",
                   "", "together", motion.coupled),
            *([] if relative is None else [defined("beside_way", 1e3 * relative, result.fits.time)]),
            Metric("Ratio to the best pointwise solutions found", f"{motion.pointwise_ratio:.2f}",
                   "Ratio of root mean squares of both distances.", "pointwise_ratio", motion.pointwise_ratio),
        ]  # fmt: skip
    shared = f"; shared joints: {', '.join(robot.shared)}" if robot.shared else ""
    frames = f"end effectors {robot.arms[0].frame} and {robot.arms[1].frame}"
    metrics += [
        Metric("Robot", f"{robot.name}, {robot.dof} joints, {frames}{shared}", "", "robot",
               {"name": robot.name, "joints": list(robot.joint_names), "shared": list(robot.shared)}),
        *numbers(duration_s=float(np.ptp(result.fits.time))),
    ]  # fmt: skip
    return Section("Both arms", tuple(metrics), _arms_table(result), key="pair")


def _arms_table(result: BothResult) -> tuple[Table, ...]:
    """Compare the arms; nothing where they were not moved."""
    rows, values = [], {}
    for side, one in zip(FOLDERS, result.each, strict=True):
        if one.execution is None:
            return ()
        motion, plan = one.execution.motion, one.execution.plan
        rms, floor = (float(np.sqrt(np.mean(of**2))) for of in (motion.distance, np.asarray(plan.pointwise_best)))
        value = {
            "method": one.method,
            "rms": rms,
            "pointwise_best_rms": floor,
            "gap": float(np.mean(one.execution.gap)),
        }
        position = "–"
        if motion.position_error is not None:
            value["tip_p95_mm"] = 1e3 * float(np.percentile(motion.position_error, 95))
            position = f"{value['tip_p95_mm']:.1f} mm"
        values[side] = value
        rows.append((side, one.method, f"{rms:.2f}", f"{floor:.2f}", position))
    columns = "arm", "method", "distance, rms", "best pointwise solution found, rms", "position error, 95 %"
    return (Table(columns, tuple(rows), "", "arms", values),)


def _of_one(side: str, report: Report) -> list[Section]:
    """Return the sections of one arm; titles, warnings and notes name the arm."""
    arm = f"{side.capitalize()} arm"
    return [
        replace(
            section,
            title=f"{arm}: {section.title[:1].lower()}{section.title[1:]}",
            key=f"{side}_{section.key}" if section.key else "",
            metrics=tuple(
                one if one.severity == INFO or not one.text else replace(one, text=f"{arm}: {one.text}")
                for one in section.metrics
            ),
        )
        for section in report.sections
        if section.key != RECORDING
    ]


def _both_summary(result: BothResult, reports: dict[str, Report], reasons: Sequence[str]) -> Summary:
    """Summarize all arms; `reasons` are the keys of all warnings."""
    each = {side: report.summary for side, report in reports.items() if report.summary is not None}
    room = None if result.motion is None else result.motion.clearance
    status = "" if result.motion is None else status_of(reasons)
    collide = room is not None and room.known and room.share > 0.0
    collision = (
        "The arms collide. Place the bases farther apart, or constrain the relative pose only (--tips relative)."
    )
    metrics = [
        replace(metric, label=f"{side.capitalize()}: {metric.label[:1].lower()}{metric.label[1:]}")
        for pair in zip(*(summary.metrics[:2] for summary in each.values()), strict=False)
        for side, metric in zip(each, pair, strict=True)
    ]
    advice = {side: one.advice for side, one in each.items() if one.status != GREEN}
    return Summary(
        _sided({side: one.title for side, one in each.items()}),
        " ".join([*([collision] if collide else []), _sided({side: one.text for side, one in each.items()})]).strip(),
        _sided({side: one.quality_warnings for side, one in each.items()}),
        "Run it: joints.csv has the motion of both arms." if status == GREEN else _sided(advice),
        "",
        status,
        tuple(reasons) if status else (),
        tuple(metrics),
    )


def _sided(texts: dict[str, str]) -> str:
    return " ".join(f"{side.capitalize()}: {text[:1].lower()}{text[1:]}" for side, text in texts.items() if text)
