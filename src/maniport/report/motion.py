"""Metrics of a robot's motion, and the thresholds of its warnings."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.arm_motion import rms_ratio
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.status import NEAR_DISTANCE, REACHED, STATUSES
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.report.metrics import WARNINGS, Value, as_metric, describe, listed, measured, metric, warning, warnings_of
from maniport.report.motion_warnings import Run, collision_texts, missed_points
from maniport.report.robot import assumed_limits, collision_warnings
from maniport.report.values import Report, Section, at_time
from maniport.util.validation import Array


@describe.register
def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    lead = f"{len(arms[0].time)} target ellipsoids in {np.ptp(arms[0].time):.2f} s."
    sections = tuple(motion_section(Run(arm, arm.time)) for arm in arms)
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, sections)


def motion_section(run: Run) -> Section:
    """Describe a motion by all registered metrics and warnings."""
    plan, collisions = run.plan, None if run.result is None else run.result.collisions
    unchecked = () if collisions is None else collisions.unchecked
    warned = [warning(key, text) for key, (_, function) in WARNINGS.items() for text in function(run)]
    if plan is not None and plan.limits is not None:
        warned += [*assumed_limits(plan.limits), *collision_warnings(plan.clearance, unchecked)]
    return Section("Robot motion", (*warned, *measured(run, run.time)), key="motion")


@metric("distance", "Ellipsoid distance", "", "0.1: one axis is 5 % too long; 1: 65 %.", main=True)
def _distance(run: Run) -> Value:
    return run.motion.distance


@metric("position_error", "Position error", "mm", "Of the end effector; it has priority over ellipsoids.", main=True)
def _position_error(run: Run) -> Value:
    return None if run.motion.position_error is None else 1e3 * run.motion.position_error


@metric("orientation_error", "Orientation error", "°", "Between the constrained axes and their target.", main=True)
def _orientation_error(run: Run) -> Value:
    return None if run.motion.orientation_error is None else np.degrees(run.motion.orientation_error)


@metric("duration", "Duration", "s", "Time-scaled to satisfy the limits; other times are demonstrated.", main=True)
def _duration(run: Run) -> Value:
    times = run.motion.demonstrated_time
    return None if times is None else duration_value(run.motion, times)


@metric("limits", "Limits", "", "Largest value relative to the limit.", main=True)
def _limits(run: Run) -> Value:
    limits = run.motion.limits
    return None if limits is None else limits_value(limits, run.motion, run.time)


@metric("collisions", "Collisions", "", "Between convex hulls of links, table and obstacles.", main=True)
def _collisions(run: Run) -> Value:
    return None if run.plan is None else collision_value(run.plan.clearance, run.at(run.plan.clearance.time))


@metric(
    "mean_distance", "Mean distance", "",
    "Infeasible: distance to the feasible set. Path: added by the path constraint. Motion: added by limits.", main=True,
)  # fmt: skip
def _mean_distance(run: Run) -> Value:
    if run.result is None or run.result.gap is None:
        return None
    parts = run.result.mean_distance._asdict()
    written = {"infeasible": parts["infeasible"], "path": parts["path"], "motion": parts["motion"]}
    if run.motion.path is None:
        written = {"infeasible": parts["infeasible"] + parts["path"], "motion": parts["motion"]}
    total, values = rounded_sum(list(written.values()))
    text = f"{total} = {' + '.join(f'{name} {value}' for name, value in zip(written, values, strict=True))}"
    return text, {"mean": float(np.mean(run.motion.distance)), **parts}


@metric("waypoints", "Waypoints", "", f"Distance at most {NEAR_DISTANCE:g}, position error within the tolerance.")
def _waypoints(run: Run) -> Value:
    count, total = Counter(run.motion.status), len(run.motion.status)
    missed = {status: count[status] for status in STATUSES if count[status] and status not in REACHED}
    reasons = f" ({listed([f'{number} {status}' for status, number in missed.items()])})" if missed else ""
    return f"{total - missed_points(run.motion)} of {total} reached{reasons}", dict(count)


@metric("pointwise_best", "Best pointwise distance found", "", "Each waypoint alone, on the path; no bound.")
def _pointwise_best(run: Run) -> Value:
    return None if run.plan is None else run.plan.pointwise_best


@metric("pointwise_ratio", "Ratio to the best pointwise distances found", "", "Of root mean squares.")
def _pointwise_ratio(run: Run) -> Value:
    best = None if run.plan is None else run.plan.pointwise_best
    if best is None or np.median(best) <= 0.01:  # the ratio has no meaning
        return None
    ratio = rms_ratio(run.motion.distance, best)
    return f"{ratio:.2f}", ratio


@metric("feasibility_gap", "Distance to the feasible set", "", "Of the target; an upper bound.")
def _feasibility_gap(run: Run) -> Value:
    return None if run.result is None else run.result.gap


@metric("major_axis_angle", "Angle between longest axes", "°", "Where both ellipsoids have a longest axis.")
def _major_axis_angle(run: Run) -> Value:
    angle = np.degrees(run.motion.major_axis_angle)
    return angle if np.isfinite(angle).any() else None


@metric("semi_axes", "Semi-axes, achieved / target", "", "Medians.")
def _semi_axes(run: Run) -> Value:
    ratio = run.motion.semi_axis_ratio[:, ::-1]
    names = {2: ("major", "minor"), 3: ("major", "middle", "minor")}.get(ratio.shape[1])
    names = names or tuple(f"axis {k + 1}" for k in range(ratio.shape[1]))
    medians = [
        float(np.median(column[np.isfinite(column)])) if np.isfinite(column).any() else None for column in ratio.T
    ]
    value = {name: None if median is None else {"median": median} for name, median in zip(names, medians, strict=True)}
    return listed([f"{name} {one['median']:.2f}" for name, one in value.items() if one]), value


@metric("jumps", "Jumps of the recording", "", "Mostly errors of the recording or of its fit.")
def _jumps(run: Run) -> Value:
    if run.plan is None or run.motion.position_error is None:
        return None
    jumps, error, texts = run.plan.jumps, 1e3 * run.motion.position_error, []
    value: dict[str, Any] = {"points": int(jumps.sum())}
    if not jumps.any():
        return "", value
    for name, rows in (("there", jumps), ("elsewhere", ~jumps)):
        if rows.any():
            value[name] = {"position_error_mm": float(error[rows].max())}
            texts.append(f"{name} {error[rows].max():.1f} mm")
    return f"{jumps.sum()} of {len(jumps)} waypoints; largest position error: {listed(texts)}", value


@metric("orientation_cost", "Cost of the orientation", "", "Mean distance with and without the constraint.")
def _orientation_cost(run: Run) -> Value:
    if run.result is None or run.result.free is None:
        return None
    kept, free = (float(np.mean(one.distance)) for one in (run.motion, run.result.free))
    return f"{kept - free:+.2f}: {kept:.2f} instead of {free:.2f}", {"kept": kept, "free": free}


@metric("lowest_points", "Lowest point", "", "Of the moving links, above the base plane.")
def _lowest(run: Run) -> Value:
    if run.result is None or run.result.lowest is None:
        return None
    points = run.result.lowest_of_links
    value = {point.link: {"height_mm": 1e3 * point.height, "at_s": run.at(point.time)} for point in points}
    return f"{1e3 * points[0].height:.0f} mm, {points[0].link} {at_time(run.at(points[0].time))}", value


@metric("relative_position_error", "Relative position error", "mm", "From the scaled vector between the hands.")
def _relative_position_error(run: Run) -> Value:
    return None  # of several arms, see `group_section`


@metric("jerk", "Jerk", "")
def _jerk(run: Run) -> Value:
    return "", {"rms": run.motion.rms_jerk, "peak": run.motion.peak_jerk}


@metric("saturated", "Saturated joints", "", "Control steps at a position or velocity limit.")
def _saturated(run: Run) -> Value:
    value = {"position": run.motion.position_limit_hits, "velocity": run.motion.velocity_limit_hits}
    return "", value


@metric("points", "")
def _points(run: Run) -> Value:
    return "", {"count": len(run.motion.time), "missed": missed_points(run.motion)}


def collision_value(clearance: Clearance, at: float) -> tuple[str, dict[str, Any]]:
    """Return the text and the value of the metric of collisions; `at`: time of the smallest clearance [s]."""
    checked = clearance.known and np.isfinite(clearance.distance)
    value = {"checked": clearance.known, "share": clearance.share, "at_s": at, "pair": clearance.pair,
             "clearance_mm": 1e3 * clearance.distance if checked else None}  # fmt: skip
    if not checked:
        return "none possible" if clearance.known else "not checked", value
    share = f"in {clearance.share:.1%} of the time" if clearance.share else "none"
    between = f"{' and '.join(clearance.pair)} {at_time(at)}"
    return f"{share}; clearance {1e3 * clearance.distance:.0f} mm ({between})", value


def duration_value(motion: Trajectory, demonstrated: Array) -> tuple[str, dict[str, float]]:
    """Return the text and the value of the duration; `demonstrated`: times of the waypoints in the recording [s]."""
    robot, human = float(np.ptp(motion.control_time)), float(np.ptp(demonstrated))
    return f"{robot:.1f} s (human {human:.1f} s)", {"robot": robot, "person": human}


def limits_value(limits: MotionLimits, motion: Trajectory, time: Array) -> tuple[str, dict[str, Any]]:
    """Return the text and the value of the metric of limits; `time`: reported times of the waypoints [s]."""
    used = {
        name: {"joint": joint, "share": share, "at_s": float(np.interp(at, motion.time, time))}
        for name, (joint, share, at) in limits.use(motion.control_time, motion.control_positions).largest.items()
    }
    text = listed([f"{name} {one['share']:.0%}" for name, one in used.items()])
    return text, {"used": used, "sources": limits.sources}


def group_section(motion: RobotMotion, time: Array, unchecked: Sequence[str] = ()) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s]."""
    clearance, trajectory = motion.clearance, motion.trajectory
    at = float(np.interp(clearance.time, trajectory.time, time))
    values: dict[str, Any] = {
        "duration": duration_value(trajectory, time),
        "collisions": collision_value(clearance, at),
        "pointwise_ratio": (f"{motion.pointwise_ratio:.2f}", motion.pointwise_ratio),
    }
    if motion.limits is not None:
        values["limits"] = limits_value(motion.limits, trajectory, time)
    if motion.relative_error is not None:
        values["relative_position_error"] = 1e3 * motion.relative_error.max(axis=1)
    warned = [*warnings_of("collision", collision_texts(clearance, at)), *collision_warnings(clearance, unchecked)]
    return Section("All arms", (*warned, *(as_metric(key, value, time) for key, value in values.items())), key="arms")


def rounded_sum(parts: list[float], decimals: int = 3) -> tuple[str, tuple[str, ...]]:
    """Write a sum and its parts such that the printed parts add up: the largest part takes the rounding error."""
    unit = 10**decimals
    whole, counts = round(sum(parts) * unit), [round(part * unit) for part in parts]
    counts[max(range(len(parts)), key=lambda k: parts[k])] += whole - sum(counts)
    total, *written = (f"{count / unit:.{decimals}f}" for count in (whole, *counts))
    return total, tuple(written)
