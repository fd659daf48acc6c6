"""Metrics of a robot's motion: their registry with warnings, and those of each arm and of all arms together.

Terminal, Markdown, JSON and notebook (`maniport.report.renderings`), the page (`maniport.report.page`) and the table of
a batch render the same `Report`.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import argument
from maniport.evaluation import Capability
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.motion_limits import DERIVATIVES, TORQUES, MotionLimits
from maniport.motion.status import FAR, NEAR_DISTANCE, REACHED, VELOCITY_LIMIT
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult
from maniport.report.robot import assumed_limits, collision_warnings
from maniport.report.values import (
    ERROR,
    WARNING,
    Metric,
    Report,
    Section,
    at_time,
    describe,
    listed,
    statistics,
    warning,
)
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
    severity: str = WARNING


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
    **{
        key: Definition(
            label, description, main=key == "limits", text="{_text}",
            level=lambda value: max(use["share"] for use in value["used"].values()), warn_above=1.001, severity=ERROR,
            warning_key=f"{key}-exceeded", warning="the motion exceeds limits of the robot: {_exceeded}")
        for key, label, description in (
            ("limits", "Limits", "Largest value relative to the limit."),
            ("torques", "Torques", "Largest value relative to the limit, by inverse dynamics."),
        )
    },
    "collisions": Definition(
        "Collisions", "Between convex hulls of links, table and obstacles.", main=True, text="{_text}",
        level=itemgetter("share"), warn_above=0.0, severity=ERROR, warning_key="collision",
        warning="the robot collides {_when}: {_pair}"),
    **{
        key: Definition(
            label, "Median along the direction of the person's largest value.", unit,
            main=True, text="{_text}")
        for key, label, unit in (("force", "Force", "N"), ("velocity", "Speed", "m/s"))
    },
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


def measure(key: str, values: Any = None, time: ArrayLike | None = None, **entries: Any) -> list[Metric]:
    """Return a registered metric, after the warning that it gives.

    `values` are a number, or one for each waypoint at times [s]; `entries` of the value with a leading underscore are
    for the texts alone, and not in JSON.
    """
    definition, value = METRICS[key], {name: item for name, item in entries.items() if name[0] != "_"}
    if definition.text:
        number = () if values is None else (values,)
        text, value = definition.text.format(*number, **entries), value if values is None else values
    else:
        measured = statistics(definition.label, key, values, time, definition.unit)
        text, value = measured.text, measured.value | value
    words = (value if isinstance(value, dict) else {}) | entries
    metric = Metric(definition.label, text, definition.description, key, value, definition.unit, main=definition.main)
    if not definition.warning or definition.level(words) <= definition.warn_above:
        return [metric]
    return [warning(definition.warning_key, definition.warning.format(**words), definition.severity), metric]


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
    metrics = measure("distance", motion.distance, time)
    if (error := motion.position_error) is not None:
        share = float(np.mean(error > FAR * motion.position_tolerance))
        tolerance = 1e3 * motion.position_tolerance
        metrics += measure("position_error", 1e3 * error, time, tolerance=tolerance, far_share=share)
    if motion.orientation_error is not None:
        metrics += measure("orientation_error", np.degrees(motion.orientation_error), time)
    if alone:
        metrics += _of_trajectory(motion, motion.limits, motion.clearance, motion.demonstrated_time, time)
    by_speed = result is not None and result.spec.kind == "velocity"
    metrics += [item for own in getattr(result, "capabilities", ()) for item in _of_capability(own, by_speed)]
    if result is not None and result.gap is not None:
        parts = result.mean_distance
        written = dict(parts)
        if motion.path is None:
            written = {"infeasible": parts["infeasible"] + parts["path"], "motion": parts["motion"]}
        whole, texts = rounded_sum(list(written.values()))
        text = f"{whole} = {' + '.join(f'{name} {value}' for name, value in zip(written, texts, strict=True))}"
        metrics += measure("mean_distance", mean=float(np.mean(motion.distance)), **parts, _text=text)
    count = Counter(motion.status)
    reasons = {status: number for status, number in count.items() if status not in REACHED}
    missed, total = sum(reasons.values()), len(motion.status)
    numbers = listed(f"{status.removesuffix(' missed')}: {number}" for status, number in reasons.items())
    metrics += measure("waypoints", count=total, missed=missed, status=dict(count), _reached=total - missed,
                       _reasons=f" ({numbers})" if reasons else "")  # fmt: skip
    best = motion.pointwise_best
    if best is not None and np.median(best) > 0.01:  # of smaller distances the ratio has no meaning
        metrics += measure("pointwise_ratio", motion.pointwise_ratio)
    if result is not None and result.gap is not None:
        metrics += measure("feasibility_gap", result.gap, time)
    angle = np.degrees(motion.major_axis_angle)
    if np.isfinite(angle).any():
        metrics += measure("major_axis_angle", angle, time)
    if result is not None and (lowest := result.lowest) is not None:
        on_table = result.collisions is not None and result.collisions.table is not None
        height, at = 1e3 * lowest.height, float(np.interp(lowest.time, motion.time, time))
        metrics += measure("lowest_point", link=lowest.link, height_mm=height, at_s=at,
                           _depth=0.0 if on_table else -height, _option=argument("table", 0))  # fmt: skip
    return Section("Robot motion", (*metrics, *_unchecked(motion, result, alone)), key="motion")


def _unchecked(motion: ArmMotion, result: ArmResult | None, alone: bool) -> list[Metric]:
    """Warn of what the solver failed at, and of what is assumed or not checked."""
    warned = []
    if motion.held.any():
        text = f"the solver failed at {motion.held.sum()} control steps, where the robot was held"
        warned.append(warning("held", text, ERROR))
    pairs = zip(motion.joint_names, motion.velocity_limits, strict=True)
    if free := [name for name, limit in pairs if np.isinf(limit)]:
        warned.append(warning("unchecked-velocity-limits", f"no velocity limit is available for {listed(free)}"))
    if result is not None and result.lowest is None:
        text = "the height above the base plane is unknown: no link has a shape"
        warned.append(warning("unchecked-floor", text))
    if motion.limits is not None:
        unchecked = () if result is None or result.collisions is None else result.collisions.unchecked
        warned += assumed_limits(motion.limits)
        warned += collision_warnings(motion.clearance, unchecked) if alone else []
    elif VELOCITY_LIMIT in motion.status:
        warned.append(warning("too-fast", "the motion is too fast for the robot in places: give it more time"))
    return warned


def group_section(motion: RobotMotion, time: Array, unchecked: Sequence[str] = ()) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s]."""
    metrics = _of_trajectory(motion.trajectory, motion.limits, motion.clearance, time, time)
    metrics += measure("pointwise_ratio", motion.pointwise_ratio)
    if motion.relative_error is not None:
        metrics += measure("relative_position_error", 1e3 * motion.relative_error.max(axis=1), time)
    return Section("All arms", (*metrics, *collision_warnings(motion.clearance, unchecked)), key="arms")


def _of_trajectory(
    trajectory: Trajectory, limits: MotionLimits | None, clearance: Clearance, demonstrated: Array | None, time: Array
) -> list[Metric]:
    """Return duration, limits and collisions of a planned motion; `time`: reported times of its waypoints [s]."""
    metrics = []
    if demonstrated is not None:
        robot, person = (float(np.ptp(times)) for times in (trajectory.control_time, demonstrated))
        metrics += measure("duration", robot=robot, person=person)
    if limits is None:
        return metrics
    used = dict[str, dict[str, Any]]()
    for name, (joint, share, at) in limits.use(trajectory.control_time, trajectory.control_positions).largest.items():
        used[name] = {"joint": joint, "share": share, "at_s": float(np.interp(at, trajectory.time, time))}
    torques = {name: used.pop(name) for name in TORQUES if name in used}
    sources = {name: text for name, text in limits.sources.items() if name in DERIVATIVES}
    of_torques = {name: text for name, text in limits.sources.items() if name not in DERIVATIVES}
    for key, shares, texts in (("limits", used, sources), ("torques", torques, of_torques)):
        exceeded = [f"{use['joint']} at {use['share']:.2f} times its {name}{_effort(limits, use['joint'], name)} "
                    + at_time(use["at_s"]) for name, use in shares.items() if use["share"] > 1.001]  # fmt: skip
        written = {name: use for name, use in shares.items() if name != "position"}  # which cannot be exceeded
        text = listed(f"{name} {100 * use['share']:.0f} %" for name, use in written.items())
        if shares:
            metrics += measure(key, used=shares, sources=texts, _text=text, _exceeded=listed(exceeded))
    checked = clearance.checked and np.isfinite(clearance.distance)
    at = np.interp(clearance.time, trajectory.time, time)
    pair, when, text = "", "", "none possible" if clearance.checked else "not checked"
    if checked:
        pair = f"{' and '.join(clearance.pair)} {at_time(float(at))}"
        when = f"in {100 * clearance.share:.1f} % of the time" if clearance.share else ""
        text = f"{when or 'none'}; clearance {1e3 * clearance.distance:.0f} mm ({pair})"
    return metrics + measure(
        "collisions", checked=clearance.checked, share=clearance.share, at_s=float(at), pair=clearance.pair,
        clearance_mm=1e3 * clearance.distance if checked else None, _text=text, _pair=pair, _when=when,
    )  # fmt: skip


def _effort(limits: MotionLimits, joint: str, quantity: str) -> str:
    """Return the effort limit of a joint in words, for a torque."""
    i = limits.arm.joint_names.index(joint)
    unit = {"rad": "N m", "m": "N"}[limits.arm.joint_units[i]]
    return f" limit of {limits.effort[i]:.4g} {unit}" if quantity == "torque" else ""


def _of_capability(own: Capability, by_speed: bool) -> list[Metric]:
    """Return force or speed of a motion, of one along the positions alone, and of the person; one kind is main."""
    unit, least = METRICS[own.kind].unit, int(own.robot.argmin())
    series = {"robot": own.robot, "position_only": own.position_only, "person": own.person}
    value: dict[str, Any] = {
        name: {"median": float(np.median(values)), "p5": float(np.percentile(values, 5)), "min": float(values.min())}
        for name, values in series.items() if values is not None
    }  # fmt: skip
    at = float(own.time[least])
    texts = [f"{name.replace('_', ' ')} {numbers['median']:.3g}" for name, numbers in value.items()]
    texts[0] += f" (min {value['robot']['min']:.3g})"
    text = f"{listed(texts)} {unit}"
    value |= {"min_at_s": at, "resemblance": own.resemblance}
    value |= {"position_only_resemblance": own.position_only_resemblance}
    return [replace(item, main=(own.kind == "velocity") == by_speed) for item in measure(own.kind, **value, _text=text)]


def rounded_sum(parts: list[float], decimals: int = 3) -> tuple[str, tuple[str, ...]]:
    """Write a sum and its parts such that the printed parts add up: the largest part takes the rounding error."""
    unit = 10**decimals
    whole, counts = round(sum(parts) * unit), [round(part * unit) for part in parts]
    counts[max(range(len(parts)), key=lambda k: parts[k])] += whole - sum(counts)
    total, *written = (f"{count / unit:.{decimals}f}" for count in (whole, *counts))
    return total, tuple(written)
