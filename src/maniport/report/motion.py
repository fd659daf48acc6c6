"""Metrics of a robot's motion, and the thresholds of its warnings."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.arms.collisions import Collisions
from maniport.motion.arm_motion import ArmMotion, rms_ratio
from maniport.motion.follow.status import ENOUGH_DISTANCE, NEAR_DISTANCE, REACHED, STATUSES, VELOCITY_LIMIT
from maniport.motion.plan.relaxation import FAR
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.trajectory import Clearance
from maniport.report.metrics import (
    Metric,
    Report,
    Section,
    at_time,
    defined,
    describe,
    listed,
    numbers,
    statistics,
    warning,
)
from maniport.report.robot import assumed_limits, missing_meshes, unchecked_links
from maniport.util.validation import Array

AXIS_ANGLE = 30.0
"""Warning threshold of the median angle between the longest axes of target and achieved ellipsoids [degrees]."""

EXCESS = 1e-3  # Relative excess of a limit without a warning: a solver keeps the limits of a tracker


@describe.register
def track_report(motion: ArmMotion | RobotMotion) -> Report:
    """Describe a joint trajectory."""
    arms = motion.arms if isinstance(motion, RobotMotion) else (motion,)
    clearance = motion.clearance if isinstance(motion, RobotMotion) else Clearance()
    lead = f"{len(arms[0].time)} target ellipsoids in {arms[0].time[-1] - arms[0].time[0]:.2f} s."
    sections = [
        motion_section(arm, [] if arm.pointwise_best is None else plan_metrics(arm, arm, clearance)) for arm in arms
    ]
    return Report(" and ".join(f"{arm.arm} at {arm.frame}" for arm in arms), lead, tuple(sections))


def motion_section(motion: ArmMotion, more: Sequence[Metric] = (), clock: Array | None = None) -> Section:
    """Describe a motion; `clock` are times of the waypoints in the recording [s]."""
    time = motion.time if clock is None else clock
    unit = " or ".join(f"{unit}/s³" for unit in sorted(set(motion.joint_units), reverse=True))
    count = Counter(motion.status)
    points, missed = len(motion.time), missed_points(motion)
    status = {word: count[word] for word in STATUSES if count[word]}
    hits = {"position": motion.position_limit_hits, "velocity": motion.velocity_limit_hits}
    metrics = (
        *_target_warnings(motion, time, status),
        *_solver_warnings(motion, time),
        *errors(motion, time),
        *_major_axis(motion, time),
        _semi_axes(motion, time),
        *more,
        Metric("Jerk", f"{motion.rms_jerk:.0f} {unit} (root mean square), {motion.peak_jerk:.0f} {unit} (max)", "",
               "jerk", {"rms": motion.rms_jerk, "peak": motion.peak_jerk}),
        Metric("Waypoints", f"{points - missed} of {points} reached: "
               + listed([f"{number} {word}" for word, number in status.items()]),
               f"Followed: distance at most {ENOUGH_DISTANCE:g}; nearly followed: at most {NEAR_DISTANCE:g}; both with "
               "a position error within the tolerance.", "status", status),
        *(Metric(f"Joints at the {kind} limit", listed([f"{name} {number}" for name, number in found.items()]),
                 "Number of control steps.", f"{kind}_limit_hits", found) for kind, found in hits.items()),
        *numbers(points=points, points_missed=missed, duration_s=float(np.ptp(motion.time))),
    )  # fmt: skip
    return Section("Robot motion", metrics, key="motion")


def errors(motion: ArmMotion, time: Array) -> list[Metric]:
    """Return the errors of a motion over time [s]."""
    values = {
        "distance": motion.distance,
        "tip_error": None if motion.position_error is None else 1e3 * motion.position_error,
        "orientation_error": None if motion.orientation_error is None else np.degrees(motion.orientation_error),
    }
    return [defined(key, array, time) for key, array in values.items() if array is not None]


def missed_points(motion: ArmMotion) -> int:
    """Count the waypoints that are neither followed nor nearly followed."""
    return sum(word not in REACHED for word in motion.status)


def far_points(motion: ArmMotion) -> int:
    """Count the waypoints whose position error is more than `FAR` times the tolerance."""
    if motion.position_error is None:
        return 0
    return int((motion.position_error > FAR * motion.position_tolerance).sum())


def exceeded_limits(motion: ArmMotion, plan: ArmMotion) -> dict[str, tuple[str, float]]:
    """Return the limits that are exceeded: joint, and the largest value as a multiple of the limit."""
    assert plan.limits is not None
    use = plan.limits.use(motion.control_time, motion.control_positions)
    return {name: (joint, share) for name, (joint, share, _) in use.largest.items() if share > 1.0 + EXCESS}


def plan_metrics(
    plan: ArmMotion,
    motion: ArmMotion,
    room: Clearance,
    clock: Array | None = None,
    collisions: Collisions | None = None,
) -> list[Metric]:
    """Describe pointwise solutions, duration, limits and collisions of a motion."""
    assert plan.limits is not None and plan.pointwise_best is not None and plan.demonstrated_time is not None
    time = motion.time if clock is None else clock
    robot, human = float(np.ptp(motion.control_time)), float(np.ptp(plan.demonstrated_time))
    ratio = (
        rms_ratio(motion.distance, plan.pointwise_best) if np.median(plan.pointwise_best) > 0.01 else None
    )  # else no sense
    broken = [
        f"{joint} at {share:.2f} times its {name}" for name, (joint, share) in exceeded_limits(motion, plan).items()
    ]
    return [
        *([warning("limits-exceeded", f"the motion exceeds limits of the robot: {listed(broken)}")] if broken else []),
        *assumed_limits(plan.limits),
        *collision_metrics(room, float(np.interp(room.time, motion.time, time)), collisions),
        *([] if collisions is None or not room.known else unchecked_links(collisions.unchecked)),
        defined("pointwise_best", plan.pointwise_best, time),
        Metric("Ratio to the best pointwise solution found", "" if ratio is None else f"{ratio:.2f}",
               "Ratio of root mean squares of the distance.", "over_node_floor", ratio),
        Metric("Duration", f"{robot:.1f} s (human {human:.1f} s)", "Time-scaled to satisfy the limits."
               + ("" if clock is None else " All other times are those of the recording."),
               "duration", {"robot": robot, "person": human}, "s"),
        *_jumps(plan, motion, time),
        used_limits(plan, motion, time),
    ]  # fmt: skip


def used_limits(plan: ArmMotion, motion: ArmMotion, time: Array) -> Metric:
    """Return the largest value of each quantity relative to its limit."""
    assert plan.limits is not None
    use = plan.limits.use(motion.control_time, motion.control_positions)
    largest: dict[str, dict[str, Any]] = {}
    for name, (joint, share, at) in use.largest.items():
        largest[name] = {"joint": joint, "share": share, "at_s": float(np.interp(at, motion.time, time))}
    texts = [f"{name} {one['share']:.0%} ({one['joint']} {at_time(one['at_s'])})" for name, one in largest.items()]
    sources = listed([f"{name}: {source}" for name, source in plan.limits.sources.items()])
    return Metric("Limits", listed(texts), f"Largest value relative to the limit. Sources: {sources}.", "limits",
                  {"used": largest, "sources": plan.limits.sources})  # fmt: skip


def _jumps(plan: ArmMotion, motion: ArmMotion, time: Array) -> list[Metric]:
    """Return the position error at jumps of the recording and elsewhere."""
    jumps, error = plan.jumps, motion.position_error
    value: dict[str, object] = {"points": int(jumps.sum())}
    if error is None or not jumps.any():
        return [*numbers(jumps=value)]
    texts = []
    for name, rows in (("there", jumps), ("elsewhere", ~jumps)):
        if rows.any():
            i = int(np.flatnonzero(rows)[np.argmax(error[rows])])
            value[name] = {"tip_error_mm": 1e3 * float(error[i]), "at_s": float(time[i])}
            texts.append(f"{name} {1e3 * error[i]:.1f} mm {at_time(float(time[i]))}")
    text = f"{jumps.sum()} of {len(jumps)} waypoints; largest position error: {listed(texts)}"
    description = "Path or ellipsoids change four times as fast as around: mostly errors of the recording or its fit."
    return [Metric("Jumps of the recording", text, description, "jumps", value)]


def collision_metrics(room: Clearance, at: float, collisions: Collisions | None = None) -> list[Metric]:
    """Describe the clearance of a motion and what was not checked; `at`: time of the smallest clearance [s]."""
    value = {"checked": room.known, "share": room.share, "clearance_mm": None, "at_s": at, "pair": room.pair}
    if not room.known:
        return [warning("unchecked-collisions", f"collisions are not checked: {room.why}"), *numbers(collisions=value)]
    meshes = missing_meshes(room.stand_ins)
    if not np.isfinite(room.distance):
        return [*meshes, Metric("Collisions", "none possible", key="collisions", value=value)]
    value["clearance_mm"] = 1e3 * room.distance
    between = f"{' and '.join(room.pair)} {at_time(at)}"
    share = f"in {room.share:.1%} of the time" if room.share else "none"
    hulls = ["the links"]
    if collisions is not None:
        hulls += ["the table"] if collisions.table is not None else []
        hulls += ["the obstacles"] if collisions.obstacles else []
    text = f"{share}; clearance {1e3 * room.distance:.0f} mm ({between})"
    metric = Metric("Collisions", text, f"Between convex hulls of {' and '.join(hulls)}.", "collisions", value)
    collision = [warning("collision", f"the robot collides in {room.share:.1%} of the time: {between}")]
    return [*(collision if room.share else []), *meshes, metric]


def _semi_axes(motion: ArmMotion, time: Array) -> Metric:
    """Return achieved semi-axes relative to those of the target; the maximum is the value farthest from 1."""
    ratio = motion.semi_axis_ratio[:, ::-1]
    names = {2: ("major", "minor"), 3: ("major", "middle", "minor")}.get(ratio.shape[1])
    names = names or tuple(f"axis {k + 1}" for k in range(ratio.shape[1]))
    value: dict[str, dict[str, float] | None] = {}
    texts = []
    for name, column in zip(names, ratio.T, strict=True):
        finite = np.isfinite(column) & (column > 0.0)
        if not finite.any():
            value[name] = None
            continue
        at = int(np.argmax(np.abs(np.log(np.where(finite, column, 1.0)))))
        median, most, when = float(np.median(column[finite])), float(column[at]), float(time[at])
        value[name] = {"median": median, "max": most, "max_at_s": when}
        texts.append(f"{name} {median:.2f} (median), {most:.2f} (farthest from 1, {at_time(when)})")
    return Metric("Semi-axes", "; ".join(texts), "Achieved relative to target.", "semi_axes", value)


def _target_warnings(motion: ArmMotion, time: Array, status: dict[str, int]) -> list[Metric]:
    """Warn of missed waypoints, a motion too fast, a large position error and a wrong longest axis."""
    found, missed = [], missed_points(motion)
    if 2 * missed > len(motion.time):
        why = listed([f"{number} {word}" for word, number in status.items() if word not in REACHED])
        found.append(warning("targets-missed", f"{missed} of {len(motion.time)} waypoints are missed: {why}"))
    if status.get(VELOCITY_LIMIT) and motion.pointwise_best is None:
        found.append(warning("too-fast", "the motion is too fast for the robot in places: give it more time"))
    if motion.position_error is not None and far_points(motion):
        at = int(np.argmax(motion.position_error))
        found.append(
            warning(
                "position-error",
                f"the position error is up to {1e3 * motion.position_error[at]:.1f} mm ({at_time(time[at])}), more "
                f"than {FAR:g} times the tolerance of {1e3 * motion.position_tolerance:g} mm",
            )
        )
    angle = np.degrees(motion.major_axis_angle)
    median = float(np.median(angle[np.isfinite(angle)])) if np.isfinite(angle).any() else 0.0
    if median > AXIS_ANGLE:
        text = f"the longest axis of the ellipsoid is {median:.0f}° (median) from that of the target"
        found.append(warning("longest-axis", text))
    return found


def _major_axis(motion: ArmMotion, time: Array) -> list[Metric]:
    """Return the angle between the longest axes where both are distinct."""
    angle = motion.major_axis_angle
    known = np.isfinite(angle)
    if not known.any():
        return []
    text = f"Angle between the longest axes of target and achieved, at {known.sum()} of {len(angle)} waypoints."
    return [statistics("Longest axis", "major_axis_angle", np.degrees(angle[known]), time[known], "°", text)]


def _solver_warnings(motion: ArmMotion, time: Array) -> list[Metric]:
    held = np.interp(motion.control_time[motion.held], motion.time, time).tolist()
    free = [n for n, limit in zip(motion.joint_names, motion.velocity_limits, strict=True) if np.isinf(limit)]
    found = numbers(held_at_s=held, joints_without_known_velocity_limit=free)
    if held:
        found.append(warning("held", f"at {len(held)} control steps no answer was found and the robot was held"))
    if free:
        found.append(warning("unchecked-velocity-limits", f"no velocity limit is known of {listed(free)}"))
    return found


def infeasible_targets(median: float) -> list[Metric]:
    """Warn where most targets are far from the feasible set."""
    text = f"the targets are infeasible: median distance to the feasible set {median:.2f}"
    return [warning("infeasible-targets", text)] if median > NEAR_DISTANCE else []
