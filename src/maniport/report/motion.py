"""Metrics of a robot's motion: of each arm, and of all arms together."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from maniport.errors import argument
from maniport.evaluation import Capability
from maniport.motion import ArmMotion, RobotMotion
from maniport.motion.motion_limits import DERIVATIVES, TORQUES, MotionLimits
from maniport.motion.plan.arm_planner import FAR
from maniport.motion.status import REACHED, VELOCITY_LIMIT
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.pipeline.results import ArmResult
from maniport.report.metrics import METRICS, describe, measure
from maniport.report.robot import assumed_limits, collision_warnings
from maniport.report.values import ERROR, Metric, Report, Section, at_time, listed, warning
from maniport.util.validation import Array


@describe.register
def motion_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe the motion of one or several arms."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    lead = f"{len(arms[0].time)} target ellipsoids in {np.ptp(arms[0].time):.2f} s."
    sections = tuple(motion_section(arm, arm.time) for arm in arms)
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, sections)


def motion_section(motion: ArmMotion, time: Array, result: ArmResult | None = None) -> Section:
    """Describe the motion of an arm, of a result; `time` (n,): reported times of its waypoints [s]."""
    metrics = measure("distance", motion.distance, time)
    if (error := motion.position_error) is not None:
        share = float(np.mean(error > FAR * motion.position_tolerance))
        tolerance = 1e3 * motion.position_tolerance
        metrics += measure("position_error", 1e3 * error, time, tolerance=tolerance, far_share=share)
    if motion.orientation_error is not None:
        metrics += measure("orientation_error", np.degrees(motion.orientation_error), time)
    metrics += _of_trajectory(motion, motion.limits, motion.clearance, motion.demonstrated_time, time)
    by_speed = result is not None and result.spec.kind == "velocity"
    metrics += [item for own in getattr(result, "capabilities", ()) for item in _of_capability(own, by_speed)]
    if result is not None and result.gap is not None:
        parts = result.mean_distance._asdict()
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
    if motion.limits is not None and error is not None:
        jumps = motion.jumps
        rows = {"there": error[jumps], "elsewhere": error[~jumps]} if jumps.any() else {}
        largest = {name: 1e3 * float(some.max()) for name, some in rows.items() if len(some)}
        errors = listed(f"{name} {value:.1f} mm" for name, value in largest.items())
        text = f"{jumps.sum()} of {len(jumps)} waypoints; largest position error: {errors}" if largest else ""
        values: dict[str, Any] = {name: {"position_error_mm": value} for name, value in largest.items()}
        metrics += measure("jumps", points=int(jumps.sum()), **values, _text=text)
    if result is not None and (lowest := result.lowest) is not None:
        on_table = result.collisions is not None and result.collisions.table is not None
        height, at = 1e3 * lowest.height, float(np.interp(lowest.time, motion.time, time))
        metrics += measure("lowest_point", link=lowest.link, height_mm=height, at_s=at,
                           _depth=0.0 if on_table else -height, _option=argument("table", 0))  # fmt: skip
    return Section("Robot motion", (*metrics, *_unchecked(motion, result)), key="motion")


def _unchecked(motion: ArmMotion, result: ArmResult | None) -> list[Metric]:
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
        warned += [*assumed_limits(motion.limits), *collision_warnings(motion.clearance, unchecked)]
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
    texts[0] += f" (least {value['robot']['min']:.3g})"
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
