"""Metrics of a robot's motion, and the thresholds of its warnings."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.errors import argument
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.arm_motion import rms_ratio
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.arm_planner import FAR
from maniport.motion.status import NEAR_DISTANCE, REACHED, VELOCITY_LIMIT
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult
from maniport.report.metrics import METRICS, as_metric, describe, listed, warning
from maniport.report.robot import assumed_limits, collision_warnings
from maniport.report.values import Report, Section, at_time
from maniport.util.validation import Array


@dataclass(frozen=True)
class Run:
    """A motion, the times of its waypoints in the report [s], and the result that it belongs to."""

    motion: ArmMotion
    time: Array
    result: ArmResult | None = None

    @property
    def plan(self) -> ArmMotion | None:
        """The motion, if it was planned."""
        return None if self.motion.limits is None else self.motion

    def at(self, time: float) -> float:
        """Return the reported time at a time of the robot [s]."""
        return float(np.interp(time, self.motion.time, self.time))


@describe.register
def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    lead = f"{len(arms[0].time)} target ellipsoids in {np.ptp(arms[0].time):.2f} s."
    sections = tuple(motion_section(Run(arm, arm.time)) for arm in arms)
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, sections)


def motion_section(run: Run) -> Section:
    """Describe a motion by its warnings and metrics."""
    plan, collisions = run.plan, None if run.result is None else run.result.collisions
    warned = [warning(key, text) for key, text in (*_safety_warnings(run), *_tracking_warnings(run))]
    if plan is not None and plan.limits is not None:
        unchecked = () if collisions is None else collisions.unchecked
        warned += [*assumed_limits(plan.limits), *collision_warnings(plan.clearance, unchecked)]
    values = {**_errors(run), **_plan(run), **_details(run)}
    metrics = (as_metric(key, values[key], run.time) for key in METRICS if values.get(key) is not None)
    return Section("Robot motion", (*warned, *metrics), key="motion")


def group_section(motion: RobotMotion, time: Array, unchecked: Sequence[str] = ()) -> Section:
    """Describe what concerns several arms together; `time`: reported times of the waypoints [s]."""
    clearance, trajectory = motion.clearance, motion.trajectory
    at = float(np.interp(clearance.time, trajectory.time, time))
    values: dict[str, Any] = {
        "duration": _duration(trajectory, time),
        "limits": None if motion.limits is None else _limits(motion.limits, trajectory, time),
        "collisions": collision_value(clearance, at),
        "pointwise_ratio": (f"{motion.pointwise_ratio:.2f}", motion.pointwise_ratio),
        "relative_position_error": None if motion.relative_error is None else 1e3 * motion.relative_error.max(axis=1),
    }
    metrics = (as_metric(key, value, time) for key, value in values.items() if value is not None)
    return Section("All arms", (*_collision(clearance, at), *collision_warnings(clearance, unchecked), *metrics),
                   key="arms")  # fmt: skip


def _errors(run: Run) -> dict[str, Any]:
    """Return the errors of each waypoint, by keys of `METRICS`."""
    motion, result = run.motion, run.result
    angle = np.degrees(motion.major_axis_angle)
    return {
        "distance": motion.distance,
        "position_error": None if motion.position_error is None else 1e3 * motion.position_error,
        "orientation_error": None if motion.orientation_error is None else np.degrees(motion.orientation_error),
        "major_axis_angle": angle if np.isfinite(angle).any() else None,
        "feasibility_gap": None if result is None else result.gap,
    }


def _plan(run: Run) -> dict[str, Any]:
    """Return duration, limits and collisions, by keys of `METRICS`."""
    motion, plan = run.motion, run.plan
    values: dict[str, Any] = {}
    if motion.demonstrated_time is not None:
        values["duration"] = _duration(motion, motion.demonstrated_time)
    if motion.limits is not None:
        values["limits"] = _limits(motion.limits, motion, run.time)
    if plan is not None:
        values["collisions"] = collision_value(plan.clearance, run.at(plan.clearance.time))
        best = plan.pointwise_best
        if best is not None and np.median(best) > 0.01:  # of smaller distances the ratio has no meaning
            ratio = rms_ratio(motion.distance, best)
            values["pointwise_ratio"] = f"{ratio:.2f}", ratio
        if motion.position_error is not None:
            values["jumps"] = _jumps(plan.jumps, 1e3 * motion.position_error)
    return values


def _details(run: Run) -> dict[str, Any]:
    """Return counts of waypoints and what the result of an arm adds, by keys of `METRICS`."""
    motion, result = run.motion, run.result
    count, missed = Counter(motion.status), missed_points(motion)
    reasons = _reasons(motion)
    text = f"{len(motion.status) - missed} of {len(motion.status)} reached{reasons and f' ({reasons})'}"
    values: dict[str, Any] = {
        "waypoints": (text, {"count": len(motion.status), "missed": missed, "status": dict(count)})
    }
    if result is None:
        return values
    if result.gap is not None:
        values["mean_distance"] = _mean_distance(motion, result)
    if result.free is not None:
        kept, free = (float(np.mean(moved.distance)) for moved in (motion, result.free))
        values["orientation_cost"] = f"{kept - free:+.2f}: {kept:.2f} instead of {free:.2f}", {
            "kept": kept, "free": free
        }  # fmt: skip
    if (lowest := result.lowest) is not None:
        at, height = run.at(lowest.time), 1e3 * lowest.height
        value = {"link": lowest.link, "height_mm": height, "at_s": at}
        values["lowest_point"] = f"{height:.0f} mm, {lowest.link} {at_time(at)}", value
    return values


def _mean_distance(motion: ArmMotion, result: ArmResult) -> tuple[str, dict[str, float]]:
    parts = result.mean_distance._asdict()
    written = {"infeasible": parts["infeasible"], "path": parts["path"], "motion": parts["motion"]}
    if motion.path is None:
        written = {"infeasible": parts["infeasible"] + parts["path"], "motion": parts["motion"]}
    total, values = rounded_sum(list(written.values()))
    text = f"{total} = {' + '.join(f'{name} {value}' for name, value in zip(written, values, strict=True))}"
    return text, {"mean": float(np.mean(motion.distance)), **parts}


def rounded_sum(parts: list[float], decimals: int = 3) -> tuple[str, tuple[str, ...]]:
    """Write a sum and its parts such that the printed parts add up: the largest part takes the rounding error."""
    unit = 10**decimals
    whole, counts = round(sum(parts) * unit), [round(part * unit) for part in parts]
    counts[max(range(len(parts)), key=lambda k: parts[k])] += whole - sum(counts)
    total, *written = (f"{count / unit:.{decimals}f}" for count in (whole, *counts))
    return total, tuple(written)


def _jumps(jumps: NDArray[np.bool_], error: Array) -> tuple[str, dict[str, Any]]:
    """Write the number of jumps, and the largest position error [mm] at them and elsewhere."""
    value: dict[str, Any] = {"points": int(jumps.sum())}
    if not jumps.any():
        return "", value
    rows = {"there": error[jumps], "elsewhere": error[~jumps]}
    value |= {name: {"position_error_mm": float(errors.max())} for name, errors in rows.items() if len(errors)}
    texts = listed(f"{name} {errors.max():.1f} mm" for name, errors in rows.items() if len(errors))
    return f"{jumps.sum()} of {len(jumps)} waypoints; largest position error: {texts}", value


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


def _duration(motion: Trajectory, demonstrated: Array) -> tuple[str, dict[str, float]]:
    robot, human = float(np.ptp(motion.control_time)), float(np.ptp(demonstrated))
    return f"{robot:.1f} s (human {human:.1f} s)", {"robot": robot, "person": human}


def _limits(limits: MotionLimits, motion: Trajectory, time: Array) -> tuple[str, dict[str, Any]]:
    used = {
        name: {"joint": joint, "share": share, "at_s": float(np.interp(at, motion.time, time))}
        for name, (joint, share, at) in limits.use(motion.control_time, motion.control_positions).largest.items()
    }
    text = listed(f"{name} {use['share']:.0%}" for name, use in used.items())
    return text, {"used": used, "sources": limits.sources}


def _reasons(motion: ArmMotion) -> str:
    """Count the waypoints that are not reached by status."""
    missed = Counter(status for status in motion.status if status not in REACHED)
    return listed(f"{number} {status}" for status, number in missed.items())


def missed_points(motion: ArmMotion) -> int:
    """Count the waypoints that are neither followed nor nearly followed."""
    return sum(status not in REACHED for status in motion.status)


def far_points(motion: ArmMotion) -> NDArray[np.bool_]:
    """Return at which waypoints the position error is more than `FAR` times the tolerance."""
    error = np.zeros(len(motion.time)) if motion.position_error is None else motion.position_error
    return np.asarray(error > FAR * motion.position_tolerance)


def exceeded_limits(plan: ArmMotion, excess: float = 1e-3) -> dict[str, tuple[str, float]]:
    """Return the limits that are exceeded by a relative excess: joint, and the value as a multiple of the limit."""
    used = {} if plan.limits is None else plan.limits.use(plan.control_time, plan.control_positions).largest
    return {name: (joint, share) for name, (joint, share, _) in used.items() if share > 1.0 + excess}


def _tracking_warnings(run: Run, axis_threshold: float = 30.0) -> Iterator[tuple[str, str]]:
    """Yield keys and texts of warnings about targets that are missed; `axis_threshold`: of the median [degrees]."""
    motion = run.motion
    missed, total = missed_points(motion), len(motion.time)
    if 2 * missed > total:
        yield "targets-missed", f"{missed} of {total} waypoints are missed: {_reasons(motion)}"
    if VELOCITY_LIMIT in motion.status and run.plan is None:
        yield "too-fast", "the motion is too fast for the robot in places: give it more time"
    if motion.position_error is not None and far_points(motion).any():
        worst = int(np.argmax(motion.position_error))
        error, tolerance = 1e3 * motion.position_error[worst], 1e3 * motion.position_tolerance
        place = at_time(run.time[worst])
        yield "position-error", f"the position error is up to {error:.1f} mm ({place}); tolerance {tolerance:g} mm"
    angle = np.degrees(motion.major_axis_angle)
    median = float(np.nanmedian(angle)) if np.isfinite(angle).any() else 0.0
    if median > axis_threshold:
        yield "longest-axis", f"the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"
    if run.result is not None and run.result.gap is not None:
        yield from infeasible_targets(float(np.median(run.result.gap)))


def infeasible_targets(median: float) -> Iterator[tuple[str, str]]:
    """Warn where most targets are far from the feasible set."""
    if median > NEAR_DISTANCE:
        text = f"the targets are infeasible: median distance to the feasible set {median:.2f}"
        yield "infeasible-targets", text


def _safety_warnings(run: Run) -> Iterator[tuple[str, str]]:
    """Yield keys and texts of warnings about limits, collisions and the base plane."""
    motion, plan, result = run.motion, run.plan, run.result
    if motion.held.any():
        yield "held", f"the solver failed at {motion.held.sum()} control steps, where the robot was held"
    pairs = zip(motion.joint_names, motion.velocity_limits, strict=True)
    if free := [name for name, limit in pairs if np.isinf(limit)]:
        yield "unchecked-velocity-limits", f"no velocity limit is available for {listed(free)}"
    if plan is not None and (broken := exceeded_limits(plan)):
        texts = listed(f"{joint} at {share:.2f} times its {name}" for name, (joint, share) in broken.items())
        yield "limits-exceeded", f"the motion exceeds limits of the robot: {texts}"
    if plan is not None:
        yield from ((one.key, one.text) for one in _collision(plan.clearance, run.at(plan.clearance.time)))
    if result is None:
        return
    if (lowest := result.lowest) is None:
        yield "unchecked-floor", "the height above the base plane is unknown: no link has a shape"
    elif lowest.height < 0.0 and (result.collisions is None or result.collisions.table is None):
        place = f"{-1e3 * lowest.height:.0f} mm below the base plane ({at_time(run.at(lowest.time))})"
        text = f"{lowest.link} is up to {place}. {argument('table', 0)} keeps the robot above it"
        yield "below-base-plane", text


def _collision(clearance: Clearance, at: float) -> list[Any]:
    """Warn of a collision; `at`: time of the smallest clearance [s]."""
    if not (clearance.known and clearance.share):
        return []
    place = f"{' and '.join(clearance.pair)} {at_time(at)}"
    return [warning("collision", f"the robot collides in {clearance.share:.1%} of the time: {place}")]
