"""Metrics of a robot's motion: their registry with warnings, and those of each arm and of all arms together.

Terminal, Markdown, JSON and notebook (`maniport.report.renderings`), the page (`maniport.report.page`) and the table of
a batch render the same `Report`.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import argument
from maniport.evaluation import Capability
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.motion_limits import DERIVATIVES, TORQUES
from maniport.motion.status import FAR, NEAR_DISTANCE, REACHED
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult
from maniport.report.robot import warn_of_collisions, warn_of_limits
from maniport.report.values import Report, Section, Severity, at_time, describe, listed
from maniport.util.sampling import statistics
from maniport.util.validation import Array


@dataclass(frozen=True)
class Definition:
    """A metric of a robot's motion: its words, and from which level on it is a warning."""

    label: str
    description: str
    unit: str = ""
    main: bool = False
    text: str = ""  # format of the value; without one, the metric is statistics over the waypoints
    level: Callable[[Any], float] = itemgetter("median")  # number of the value that decides on the warning
    warn_above: float = np.inf  # level
    warning_key: str = ""
    warning: str = ""  # format of the value
    severity: Severity = "warning"


MISSED_SHARE = 0.05
"""Largest share of waypoints that may be missed without a warning."""

METRICS = {
    "distance": Definition(
        "Ellipsoid distance", "0.1: one axis is 5 % too long; 1: 65 %.", main=True),
    "position_error": Definition(
        "Position error", "Of the end effector; it has priority over ellipsoids.", "mm", main=True,
        level=lambda value: value.get("far_share", 0.0), warn_above=0.0, warning_key="position-error",
        warning="the position error is up to {max:.1f} mm (at {max_at_s:.1f} s); tolerance {tolerance:g} mm"),
    "orientation_error": Definition(
        "Orientation error", "Between the constrained axes and their target.", "°", main=True),
    "duration": Definition(
        "Duration", "Time-scaled to satisfy the limits; other times are demonstrated.", "s", main=True,
        text="{robot:.1f} s (human {person:.1f} s)"),
    **{key: Definition(
        key.capitalize(), f"Largest value relative to the limit{remark}.", main=key == "limits", text="{_text}",
        level=lambda value: max(use["share"] for use in value["used"].values()), warn_above=1.001, severity="error",
        warning_key=f"{key}-exceeded", warning="the motion exceeds limits of the robot: {_exceeded}")
       for key, remark in (("limits", ""), ("torques", ", by inverse dynamics"))},
    "collisions": Definition(
        "Collisions", "Between convex hulls of links, table and obstacles.", main=True, text="{_text}",
        level=itemgetter("share"), warn_above=0.0, severity="error", warning_key="collision",
        warning="the robot collides {_when}: {_pair}"),
    **{key: Definition(label, "Median along the direction of the person's largest value.", unit, text="{_text}")
       for key, label, unit in (("force", "Force", "N"), ("velocity", "Speed", "m/s"))},
    "mean_distance": Definition(
        "Mean distance", "Infeasible: distance to the feasible set. Path: added by the path constraint. "
        "Motion: added by limits.", main=True, text="{_text}"),
    "waypoints": Definition(
        "Waypoints", f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance.",
        text="{_reached} of {count} reached{_reasons}", level=lambda value: value["missed"] / value["count"],
        warn_above=MISSED_SHARE, warning_key="targets-missed",
        warning="{missed} of {count} waypoints are missed{_reasons}"),
    "pointwise_ratio": Definition(
        "Ratio to the best pointwise distances found", "Of root mean squares; no bound.", text="{:.2f}"),
    "feasibility_gap": Definition(
        "Distance to the feasible set", "Of the target; an upper bound.", warn_above=NEAR_DISTANCE,
        warning_key="infeasible-targets",
        warning="the targets are infeasible: median distance to the feasible set {median:.2f}"),
    "major_axis_angle": Definition(
        "Angle between longest axes", "Where both ellipsoids have a longest axis.", "°", warn_above=30.0,
        warning_key="longest-axis",
        warning="the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"),
    "lowest_point": Definition(
        "Lowest point", "Of the moving links, above the base plane.", text="{height_mm:.0f} mm, {link} at {at_s:.1f} s",
        level=itemgetter("_depth"), warn_above=0.0, warning_key="below-base-plane",
        warning="{link} is up to {_depth:.0f} mm below the base plane (at {at_s:.1f} s). "
        "{_option} keeps the robot above it"),
    "relative_position_error": Definition(
        "Relative position error", "From the scaled vector between the hands.", "mm"),
}  # fmt: skip
"""Metrics of a robot's motion by key, in the order in which they are reported."""


def measure(section: Section, key: str, values: Any = None, time: ArrayLike = (), **entries: Any) -> None:
    """Add a registered metric to a section, after the warning that it gives.

    `values` are a number, or one for each waypoint at times [s]; `entries` of the value with a leading underscore are
    for the texts alone, and not in JSON.
    """
    definition, value = METRICS[key], {name: item for name, item in entries.items() if name[0] != "_"}
    if definition.text:
        text, value = definition.text.format(values, **entries), value if values is None else values
    else:
        numbers = statistics(values, time)
        text = "median {median:.2f}, 95th percentile {p95:.2f}, max {max:.2f} ".format(**numbers)
        text, value = text + at_time(numbers["max_at_s"]), numbers | value
    words = (value if isinstance(value, dict) else {}) | entries
    if definition.warning and definition.level(words) > definition.warn_above:
        section.warn(definition.warning_key, definition.warning.format(**words), severity=definition.severity)
    main = entries.get("_main", definition.main)
    section.add(definition.label, key, value, text, definition.description, unit=definition.unit, main=main)


@describe.register
def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    lead = f"{len(arms[0].time)} target ellipsoids in {np.ptp(arms[0].time):.2f} s."
    sections = tuple(motion_section(arm, arm.time) for arm in arms)
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, sections)


def motion_section(motion: ArmMotion, time: Array, result: ArmResult | None = None, alone: bool = True) -> Section:
    """Describe the motion of an arm, of a result; `time` (n,): reported times of its waypoints [s].

    What concerns the trajectory of several arms together is in `group_section`.
    """
    section = Section("Robot motion", key="motion")
    measure(section, "distance", motion.distance, time)
    if (error := motion.position_error) is not None:
        share, tolerance = float(np.mean(error > FAR * motion.position_tolerance)), 1e3 * motion.position_tolerance
        measure(section, "position_error", 1e3 * error, time, tolerance=tolerance, far_share=share)
    if motion.orientation_error is not None:
        measure(section, "orientation_error", np.degrees(motion.orientation_error), time)
    if alone:
        _add_trajectory(section, motion, motion.clearance, motion.demonstrated_time, time)
    gap = None
    if result is not None:
        gap = result.gap
        for own in getattr(result, "capabilities", ()):
            _add_capability(section, own, main=(own.kind == "velocity") == (result.spec.kind == "velocity"))
        if gap is not None:
            parts = result.mean_distance
            written = dict(parts)
            if motion.path is None:
                written["infeasible"] += written.pop("path")
            whole, texts = rounded_sum(list(written.values()))
            text = f"{whole} = {' + '.join(f'{name} {value}' for name, value in zip(written, texts, strict=True))}"
            measure(section, "mean_distance", mean=float(np.mean(motion.distance)), **parts, _text=text)
    count = Counter(motion.status)
    reasons = {status: number for status, number in count.items() if status not in REACHED}
    missed, total = sum(reasons.values()), len(motion.status)
    numbers = listed(f"{status.removesuffix(' missed')}: {number}" for status, number in reasons.items())
    measure(section, "waypoints", count=total, missed=missed, status=dict(count), _reached=total - missed,
            _reasons=f" ({numbers})" if reasons else "")  # fmt: skip
    if motion.pointwise_best is not None and np.median(motion.pointwise_best) > 0.01:  # else the ratio has no meaning
        measure(section, "pointwise_ratio", motion.pointwise_ratio)
    if gap is not None:
        measure(section, "feasibility_gap", gap, time)
    angle = np.degrees(motion.major_axis_angle)
    if np.isfinite(angle).any():
        measure(section, "major_axis_angle", angle, time)
    unchecked = _add_heights(section, motion, time, result)
    if motion.held.any():
        count = motion.held.sum()
        text = f"at {count} control steps not all limits were satisfied, or the robot braked before a collision"
        section.warn("held", text, severity="error")
    pairs = zip(motion.joint_names, motion.velocity_limits, strict=True)
    if free := [name for name, limit in pairs if np.isinf(limit)]:
        section.warn("unchecked-velocity-limits", f"no velocity limit is available for {listed(free)}")
    if motion.limits is not None:
        warn_of_limits(section, motion.limits)
        if alone:
            warn_of_collisions(section, motion.clearance, unchecked)
    elif "velocity limit" in motion.status:
        section.warn("too-fast", "the motion is too fast for the robot in places: give it more time")
    return section


def _add_heights(section: Section, motion: ArmMotion, time: Array, result: ArmResult | None) -> Sequence[str]:
    """Add the lowest point of a result; return the links that are not checked for collisions."""
    if result is None:
        return ()
    lowest, collisions = result.lowest, result.collisions
    if lowest is None:
        section.warn("unchecked-floor", "the height above the base plane is unknown: no link has a shape")
    else:
        on_table = collisions is not None and collisions.table is not None
        height, at = 1e3 * lowest.height, float(np.interp(lowest.time, motion.time, time))
        measure(section, "lowest_point", link=lowest.link, height_mm=height, at_s=at,
                _depth=0.0 if on_table else -height, _option=argument("table", 0))  # fmt: skip
    return () if collisions is None else collisions.unchecked


def group_section(motion: RobotMotion, time: Array, unchecked: Sequence[str] = ()) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s]."""
    section = Section("All arms", key="arms")
    _add_trajectory(section, motion.trajectory, motion.clearance, time, time)
    measure(section, "pointwise_ratio", motion.pointwise_ratio)
    if motion.relative_error is not None:
        measure(section, "relative_position_error", 1e3 * motion.relative_error.max(axis=1), time)
    warn_of_collisions(section, motion.clearance, unchecked)
    return section


def _add_trajectory(
    section: Section, trajectory: Trajectory, clearance: Clearance, demonstrated: Array | None, time: Array
) -> None:
    """Add duration, limits and collisions of a planned motion; `time`: reported times of its waypoints [s]."""
    if demonstrated is not None:
        robot, person = (float(np.ptp(times)) for times in (trajectory.control_time, demonstrated))
        measure(section, "duration", robot=robot, person=person)
    if trajectory.limits is None or trajectory.limit_use is None:
        return
    largest, sources_of = trajectory.limit_use.largest, trajectory.limits.sources
    for key, is_torque in (("limits", False), ("torques", True)):
        sources = {name: text for name, text in sources_of.items() if (name not in DERIVATIVES) == is_torque}
        used: dict[str, dict[str, Any]] = {
            name: {"joint": joint, "share": share, "at_s": float(np.interp(at, trajectory.time, time))}
            for name, (joint, share, at) in largest.items() if (name in TORQUES) == is_torque
        }  # fmt: skip
        exceeded = [f"{use['joint']} at {use['share']:.2f} times its {name} limit {at_time(use['at_s'])}"
                    for name, use in used.items() if use["share"] > 1.001]  # fmt: skip
        # a position limit cannot be exceeded
        text = listed(f"{name} {100 * use['share']:.0f} %" for name, use in used.items() if name != "position")
        if used:
            measure(section, key, used=used, sources=sources, _text=text, _exceeded=listed(exceeded))
    at, millimeters = float(np.interp(clearance.time, trajectory.time, time)), None
    pair, when, text = "", "", "none possible" if clearance.checked else "not checked"
    if clearance.checked and np.isfinite(clearance.distance):
        millimeters, pair = 1e3 * clearance.distance, f"{' and '.join(clearance.pair)} {at_time(at)}"
        when = f"in {100 * clearance.share:.1f} % of the time" if clearance.share else ""
        text = f"{when or 'none'}; clearance {millimeters:.0f} mm ({pair})"
    measure(
        section, "collisions", checked=clearance.checked, share=clearance.share, at_s=at, pair=clearance.pair,
        clearance_mm=millimeters, _text=text, _pair=pair, _when=when,
    )  # fmt: skip


def _add_capability(section: Section, own: Capability, main: bool) -> None:
    """Add force or speed of a motion, of one along the positions alone, and of the person."""
    series = {"robot": own.robot, "position_only": own.position_only, "person": own.person}
    value: dict[str, Any] = {
        name: {"median": float(np.median(values)), "p5": float(np.percentile(values, 5)), "min": float(values.min())}
        for name, values in series.items() if values is not None
    }  # fmt: skip
    texts = [f"{name.replace('_', ' ')} {numbers['median']:.3g}" for name, numbers in value.items()]
    texts[0] += f" (min {value['robot']['min']:.3g})"
    measure(
        section, own.kind, **value, min_at_s=float(own.time[own.robot.argmin()]), resemblance=own.resemblance,
        position_only_resemblance=own.position_only_resemblance, _main=main,
        _text=f"{listed(texts)} {METRICS[own.kind].unit}",
    )  # fmt: skip


def rounded_sum(parts: list[float]) -> tuple[str, list[str]]:
    """Write a sum and its parts such that the printed parts add up: the largest part takes the rounding error."""
    whole, counts = round(sum(parts) * 1000), [round(part * 1000) for part in parts]
    counts[int(np.argmax(parts))] += whole - sum(counts)
    return f"{whole / 1000:.3f}", [f"{count / 1000:.3f}" for count in counts]
