"""Facts of what follows the transfer: where a path lies, what a robot can make, and the motion that follows."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from maniport.bodies.collisions import Collisions
from maniport.telling.facts import (
    Fact,
    Facts,
    Section,
    at_moment,
    listed,
    numbers,
    spread,
    told,
    warning,
)
from maniport.telling.of_robot import assumed_limits, missing_meshes, unchecked_links
from maniport.telling.status import AXIS_ANGLE, POSITION_FACTOR
from maniport.tracking import TrackResult
from maniport.tracking.follow.status import ENOUGH_DISTANCE, NEAR_DISTANCE, REACHED, STATUSES, VELOCITY_LIMIT
from maniport.tracking.plan.planned_motion import PlannedMotion, Room, over_floor
from maniport.validation import Array

EXCESS = 1e-3
"""Share beyond a limit that is not worth a warning: a tracker's limits are kept by a solver."""

NO_FLOOR = 0.01
"""Where the node floor is lower, how many times it the distance is says nothing."""

TOGETHER = "Ellipsoid and tip together ask more of an arm than its joints can give; the tip goes first."
DISTANCE = "0.1 is one axis that is 5 % too long, 1 one that is 65 %."
GAP = "Feasibility gap"
GAP_MEANING = (
    "From the target to the nearest ellipsoid that was found for the robot anywhere within its joint limits. The "
    "search may miss a nearer one, so it is an upper bound; between at most 250 points it is drawn as a line."
)
FLOOR = "Node floor"
FLOOR_MEANING = "The smallest distance that was found with the tip on its path, each point by itself."


@told.register
def track_facts(motion: TrackResult) -> Facts:
    """Tell how well a joint trajectory follows."""
    lead = f"{len(motion.time)} target ellipsoids in {motion.time[-1] - motion.time[0]:.2f} s."
    planned = plan_facts(motion, motion, motion.room) if isinstance(motion, PlannedMotion) else []
    return Facts(f"{motion.arm} at {motion.frame}", lead, (motion_section(motion, planned),))


def motion_section(motion: TrackResult, nearness: Sequence[Fact] = (), clock: Array | None = None) -> Section:
    """Tell how near a motion comes to what was asked, and what stands in the way; `nearness`: how near it could."""
    time = motion.time if clock is None else clock
    unit = " or ".join(f"{unit}/s³" for unit in sorted(set(motion.joint_units), reverse=True))
    count = Counter(motion.status)
    points = len(motion.time)
    status = {word: count[word] for word in STATUSES if count[word]}
    hits = {"position": motion.position_limit_hits, "velocity": motion.velocity_limit_hits}
    facts = (
        *_missed(motion, status),
        *_far(motion, time),
        *_across(motion),
        *_limits(motion, time),
        spread("Distance of the ellipsoids", "distance", motion.distance, time, role="achieved",
               meaning=f"From the target to what the robot makes; {DISTANCE}"),
        *([] if motion.position_error is None else [
            spread("Tip beside its path", "tip_error", 1e3 * motion.position_error, time, "mm", role="achieved",
                   meaning=TOGETHER)]),
        *([] if motion.orientation_error is None else [
            spread("Orientation", "orientation_error", np.degrees(motion.orientation_error), time, "°",
                   role="achieved", meaning="Angle between the tip's axes that count and where they were to point.")]),
        *_major_axis(motion, time),
        _semi_axes(motion, time),
        *nearness,
        Fact("Jerk", f"{motion.rms_jerk:.0f} {unit} (root mean square), {motion.peak_jerk:.0f} {unit} (peak)",
             "How abruptly the acceleration of the joints changes.",
             "jerk", {"rms": motion.rms_jerk, "peak": motion.peak_jerk}),
        Fact("Points", f"{points - missed_points(motion)} of {points} reached: "
             + listed([f"{number} {word}" for word, number in status.items()]),
             f"Followed: distance at most {ENOUGH_DISTANCE:g}, nearly followed: at most {NEAR_DISTANCE:g}; both with a "
             "position error within the tolerance. All others are missed, with the worst since the point before.",
             "status", status),
        *(Fact(f"At a {what} limit", listed([f"{name} {number}" for name, number in found.items()]),
               "Control steps, by joint.", f"{what}_limit_hits", found) for what, found in hits.items()),
        *numbers(points=points, points_missed=missed_points(motion), duration_s=float(np.ptp(motion.time))),
    )  # fmt: skip
    return Section("The robot's motion", facts, key="motion")


def missed_points(motion: TrackResult) -> int:
    """Count the points that are neither followed nor nearly followed."""
    return sum(word not in REACHED for word in motion.status)


def plan_facts(
    plan: PlannedMotion,
    motion: TrackResult,
    room: Room,
    clock: Array | None = None,
    collisions: Collisions | None = None,
) -> list[Fact]:
    """Report the pointwise best distance, the duration, limits and collisions of a motion."""
    time = motion.time if clock is None else clock
    told_in = "" if clock is None else " Moments are told in the time of the recording."
    use = plan.limits.use(motion.control_time, motion.control_positions)
    lasts, person = float(np.ptp(motion.control_time)), float(np.ptp(plan.demonstrated_time))
    ratio = over_floor(motion.distance, plan.node_floor) if np.median(plan.node_floor) > NO_FLOOR else None
    most = {name: (*one[:2], float(np.interp(one[2], motion.time, time))) for name, one in use.largest.items()}
    largest = {name: {"joint": joint, "share": share, "at_s": at} for name, (joint, share, at) in most.items()}
    text = listed([f"{name} {share:.0%} ({joint} {at_moment(at)})" for name, (joint, share, at) in most.items()])
    sources = listed([f"{name}: {source}" for name, source in plan.limits.sources.items()])
    broken = [f"{joint} at {share:.2f} times its {name}" for name, (joint, share, _) in use.largest.items()
              if share > 1.0 + EXCESS]  # fmt: skip
    return [
        *([warning("limits-exceeded", f"the motion exceeds limits of the robot: {listed(broken)}")] if broken else []),
        *assumed_limits(plan.limits),
        *room_facts(room, float(np.interp(room.time, motion.time, time)), collisions),
        *([] if collisions is None or not room.known else unchecked_links(collisions.unchecked)),
        spread(FLOOR, "node_floor", plan.node_floor, time, meaning=FLOOR_MEANING, role="reference"),
        Fact("Ratio to the best pointwise solution found", "" if ratio is None else f"{ratio:.2f}",
             "Root mean square of the distance over that of the node floor.", "over_node_floor", ratio),
        Fact("Duration", f"{lasts:.1f} s, the person's {person:.1f} s", "As near to the person's time as the limits "
             f"allow.{told_in}", "duration", {"robot": lasts, "person": person}, "s"),
        *_leaps(plan, motion, time),
        Fact("Limits used", text, f"At most, of what is allowed. {sources}.", "limits",
             {"used": largest, "sources": plan.limits.sources}),
    ]  # fmt: skip


def _leaps(plan: PlannedMotion, motion: TrackResult, time: Array) -> list[Fact]:
    """Tell where the recording leaps and how far the tip is beside its path there, and elsewhere."""
    leaps, error = plan.leaps, motion.position_error
    value: dict[str, object] = {"points": int(leaps.sum())}
    if error is None or not leaps.any():
        return [*numbers(leaps=value)]
    texts = []
    for name, rows in (("there", leaps), ("elsewhere", ~leaps)):
        if rows.any():
            i = int(np.flatnonzero(rows)[np.argmax(error[rows])])
            value[name] = {"tip_error_mm": 1e3 * float(error[i]), "at_s": float(time[i])}
            texts.append(f"{name} {1e3 * error[i]:.1f} mm {at_moment(float(time[i]))}")
    text = f"{leaps.sum()} of {len(leaps)} points; the tip beside its path at most: {listed(texts)}"
    return [Fact("Leaps of the recording", text, "Where path or ellipsoids go on four times as quick as around: errors "
                 "of the recording or of its fit, mostly, that no arm follows.", "leaps", value)]  # fmt: skip


def room_facts(room: Room, at: float, collisions: Collisions | None = None) -> list[Fact]:
    """Report the clearance of a motion and what was not checked; `at`: time of the smallest clearance [s]."""
    value = {"checked": room.known, "share": room.share, "clearance_mm": None, "at_s": at, "pair": room.pair}
    if not room.known:
        return [warning("unchecked-collisions", f"collisions are not checked: {room.why}"), *numbers(collisions=value)]
    lacking = missing_meshes(room.stand_ins)
    if not np.isfinite(room.clearance):
        return [*lacking, Fact("Collisions", "none possible", key="collisions", value=value)]
    value["clearance_mm"] = 1e3 * room.clearance
    between = f"{' and '.join(room.pair)} {at_moment(at)}"
    fact = Fact("Collisions", f"in {room.share:.1%} of the time; nearest {1e3 * room.clearance:.0f} mm, {between}",
                f"Between convex hulls of {_checked(collisions)}.", "collisions", value)  # fmt: skip
    struck = [warning("collision", f"the robot collides in {room.share:.1%} of the time: {between}")]
    return [*(struck if room.share else []), *lacking, fact]


def _checked(collisions: Collisions | None) -> str:
    """Name what was checked against the links."""
    table = collisions is not None and collisions.table is not None
    boxes = collisions is not None and collisions.boxes
    return " and ".join(["the links", *(["the table"] if table else []), *(["the boxes"] if boxes else [])])


def _semi_axes(motion: TrackResult, time: Array) -> Fact:
    """Tell how long the achieved semi-axes are beside those of the target; the largest is the farthest from 1."""
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
        texts.append(f"{name} {median:.2f} (median), {most:.2f} (farthest, {at_moment(when)})")
    return Fact("Semi-axes", "; ".join(texts), "Achieved over target; 1 is as long.", "semi_axes", value,
                role="achieved")  # fmt: skip


def _missed(motion: TrackResult, status: dict[str, int]) -> list[Fact]:
    """Warn where most points are missed, and where a tracker is too slow."""
    found = []
    if 2 * missed_points(motion) > len(motion.time):
        why = listed([f"{number} {word}" for word, number in status.items() if word not in REACHED])
        found.append(
            warning("targets-missed", f"{missed_points(motion)} of {len(motion.time)} points are missed: {why}")
        )
    if status.get(VELOCITY_LIMIT) and not isinstance(motion, PlannedMotion):
        found.append(warning("too-fast", "the motion is too fast for the robot in places: give it more time"))
    return found


def _far(motion: TrackResult, time: Array) -> list[Fact]:
    """Warn of a large position error."""
    if motion.position_error is None or not far_points(motion):
        return []
    at = int(np.argmax(motion.position_error))
    text = (
        f"the position error is up to {1e3 * motion.position_error[at]:.1f} mm ({at_moment(time[at])}), more than "
        f"{POSITION_FACTOR:g} times the tolerance of {1e3 * motion.tip_tolerance:g} mm"
    )
    return [warning("position-error", text)]


def far_points(motion: TrackResult) -> int:
    """Count the points whose position error is more than `POSITION_FACTOR` times the tolerance."""
    if motion.position_error is None:
        return 0
    return int((motion.position_error > POSITION_FACTOR * motion.tip_tolerance).sum())


def _major_axis(motion: TrackResult, time: Array) -> list[Fact]:
    """Report the angle between the longest axes where both are distinct."""
    angle = motion.major_axis_angle
    known = np.isfinite(angle)
    if not known.any():
        return []
    meaning = (
        f"Angle between the longest axes of target and achieved ellipsoid; 90° is across. At {known.sum()} of "
        f"{len(angle)} points, where both have a longest axis."
    )
    return [spread("Major axis", "major_axis_angle", np.degrees(angle[known]), time[known], "°", meaning, "achieved")]


def _across(motion: TrackResult) -> list[Fact]:
    """Warn where the longest axes differ in direction at most points."""
    angle = np.degrees(motion.major_axis_angle)
    known = angle[np.isfinite(angle)]
    if not len(known) or np.median(known) <= AXIS_ANGLE:
        return []
    text = f"the longest axis of the ellipsoid is {np.median(known):.0f}° (median) from that of the target"
    return [warning("longest-axis", text)]


def _limits(motion: TrackResult, time: Array) -> list[Fact]:
    held = np.interp(motion.control_time[motion.held], motion.time, time).tolist()
    free = [n for n, limit in zip(motion.joint_names, motion.velocity_limits, strict=True) if np.isinf(limit)]
    found = numbers(held_at_s=held, joints_without_known_velocity_limit=free)
    if held:
        found.append(warning("held", f"at {len(held)} control steps no answer was found and the robot was held"))
    if free:
        found.append(warning("unchecked-velocity-limits", f"no velocity limit is known of {listed(free)}"))
    return found


def gap_facts(gap: Array, time: Array | None = None) -> list[Fact]:
    """Tell how far the targets are from what the robot can make at all."""
    median = float(np.median(gap))
    fact = spread(GAP, "feasibility_gap", gap, time, meaning=GAP_MEANING, role="reference")
    return [*gap_warnings(median), fact]


def gap_warnings(median: float) -> list[Fact]:
    """Say when most of the targets cannot be made."""
    if not median > NEAR_DISTANCE:
        return []
    text = f"{GAP}: nothing nearer to the target than a distance of {median:.2f} (median) was found for the robot"
    return [warning("infeasible-targets", text)]
