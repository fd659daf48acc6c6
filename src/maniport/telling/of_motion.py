"""Facts of what follows the transfer: where a path lies, what a robot can make, and the motion that follows."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from maniport.telling.facts import (
    Fact,
    Facts,
    Section,
    at_moment,
    listed,
    notes,
    numbers,
    spread,
    told,
    warning,
)
from maniport.tracking import TrackResult
from maniport.tracking.follow.status import ELLIPSOID, ENOUGH_DISTANCE, FOLLOWED, STATUSES, VELOCITY_LIMIT
from maniport.tracking.offline.offline import OfflineResult
from maniport.tracking.plan.planned_motion import PlannedMotion, over_floor
from maniport.tracking.plan.room import Room
from maniport.validation import Array

FAR = 10.0
"""A tip that is farther beside its path at any moment is warned of [mm]."""

EXCESS = 1e-3
"""Share beyond a limit that is not worth a warning: a tracker's limits are kept by a solver."""

NEARLY = 0.4
"""Distance up to which an ellipsoid is nearly followed: one axis 22 % too long."""

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
    """Tell how near a motion comes to what was asked, and what stands in the way; `nearness`: how near it could.

    `clock`, shape (n,): the times [s] in which moments are told, those of the recording; default: the robot's own.
    """
    time = motion.time if clock is None else clock
    unit = " or ".join(f"{unit}/s³" for unit in sorted(set(motion.joint_units), reverse=True))
    count = Counter(motion.status)
    status = {word: count[word] for word in STATUSES if count[word]}
    near = int(sum(nearly(motion)))
    hits = {"position": motion.position_limit_hits, "velocity": motion.velocity_limit_hits}
    facts = (
        *_missed(motion, status),
        *_far(motion, time),
        *_limits(motion, time),
        spread("Distance of the ellipsoids", "distance", motion.distance, time, role="achieved",
               meaning=f"From the target to what the robot makes; {DISTANCE}"),
        *([] if motion.position_error is None else [
            spread("Tip beside its path", "tip_error", 1e3 * motion.position_error, time, "mm", role="achieved",
                   meaning=TOGETHER)]),
        *([] if motion.orientation_error is None else [
            spread("Orientation", "orientation_error", np.degrees(motion.orientation_error), time, "°",
                   role="achieved", meaning="Angle between the tip's axes that count and where they were to point.")]),
        spread("Major axis", "major_axis_angle", np.degrees(motion.major_axis_angle), time, "°", role="achieved",
               meaning="Angle between the longest axes of target and achieved ellipsoid; 90° is across."),
        _semi_axes(motion, time),
        *nearness,
        Fact("Jerk", f"{motion.rms_jerk:.0f} {unit} (root mean square), {motion.peak_jerk:.0f} {unit} (peak)",
             "How abruptly the acceleration of the joints changes.",
             "jerk", {"rms": motion.rms_jerk, "peak": motion.peak_jerk}),
        Fact("Points", listed([f"{number} {word}" for word, number in status.items()]),
             "At each point the worst since the one before; followed: within 0.1 and the tip's tolerance.", "status",
             status),
        Fact("Nearly followed", f"{near} of the ellipsoids out of reach", f"Within a distance of {NEARLY:g}.",
             "nearly_followed", near),
        *(Fact(f"At a {what} limit", listed([f"{name} {number}" for name, number in found.items()]),
               "Control steps, by joint.", f"{what}_limit_hits", found) for what, found in hits.items()),
        *(_solver(motion) if isinstance(motion, OfflineResult) else ()),
        *numbers(points=len(motion.time), duration_s=float(np.ptp(motion.time))),
    )  # fmt: skip
    return Section("The robot's motion", facts, key="motion")


def nearly(motion: TrackResult) -> NDArray[np.bool_]:
    """Which ellipsoids are out of reach but nearly followed, shape (n,)."""
    return np.asarray((np.array(motion.status) == ELLIPSOID) & (motion.distance <= NEARLY))


def plan_facts(plan: PlannedMotion, motion: TrackResult, room: Room, clock: Array | None = None) -> list[Fact]:
    """Tell how near a motion could come with its tip on the path, how long it takes, and what limits and room it has.

    `motion` is the plan itself, or what a tracker made of it, and `room` the one that it has; `clock` as above.
    """
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
        *([warning(f"the motion exceeds limits of the robot: {listed(broken)}")] if broken else []),
        *room_facts(room, float(np.interp(room.time, motion.time, time))),
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


def room_facts(room: Room, at: float) -> list[Fact]:
    """Tell how near a motion comes to a collision; `at`: when, as it is told [s]."""
    value = {"checked": room.known, "share": room.share, "clearance_mm": None, "at_s": at, "pair": room.pair}
    if not room.known:
        return [*notes([f"collisions were not checked: {room.why}"]), *numbers(collisions=value)]
    links = listed(room.stand_ins)
    instead = f"meshes of {links} are missing: the collision shapes of these links are drawn and checked instead"
    lacking = notes([instead] if links else [])
    if not np.isfinite(room.clearance):
        return [*lacking, Fact("Collisions", "none possible", key="collisions", value=value)]
    value["clearance_mm"] = 1e3 * room.clearance
    between = f"{' and '.join(room.pair)} {at_moment(at)}"
    fact = Fact("Collisions", f"in {room.share:.1%} of the time; nearest {1e3 * room.clearance:.0f} mm, {between}",
                "Convex hulls of the links, table and boxes.", "collisions", value)  # fmt: skip
    struck = [warning(f"the robot collides in {room.share:.1%} of the time: {between}")] if room.share else []
    return [*struck, *lacking, fact]


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
    points = len(motion.time)
    missed = points - status.get(FOLLOWED, 0)
    found = []
    if missed:
        why = listed([f"{word} at {number}" for word, number in status.items() if word != FOLLOWED])
        found.append(
            warning(
                f"at {missed} of {points} points the robot is not within a distance of {ENOUGH_DISTANCE:g} of the "
                f"target ellipsoid and {1e3 * motion.tip_tolerance:g} mm of its path: {why}"
            )
        )
    if status.get(VELOCITY_LIMIT) and not isinstance(motion, PlannedMotion):
        found.append(warning("the motion is too fast for the robot in places: give it more time"))
    return found


def _far(motion: TrackResult, time: Array) -> list[Fact]:
    if motion.position_error is None or 1e3 * motion.position_error.max() <= FAR:
        return []
    at = int(np.argmax(motion.position_error))
    far = 1e3 * motion.position_error[at]
    return [warning(f"{at_moment(time[at])} the robot's tip is {far:.0f} mm beside its path")]


def _limits(motion: TrackResult, time: Array) -> list[Fact]:
    held = np.interp(motion.control_time[motion.held], motion.time, time).tolist()
    free = [n for n, limit in zip(motion.joint_names, motion.velocity_limits, strict=True) if np.isinf(limit)]
    found = numbers(held_at_s=held, joints_without_known_velocity_limit=free)
    if held:
        found.append(warning(f"at {len(held)} control steps no answer was found and the robot was held"))
    if free:
        found.append(warning(f"no velocity limit is known of {listed(free)}"))
    return found


def _solver(motion: OfflineResult) -> list[Fact]:
    shift = [1e3 * float(value) for value in motion.offset]
    broken = [f"{name} by up to {amount:.3g}" for name, amount in motion.violations.items()]
    return [
        *([warning(f"the trajectory does not keep {listed(broken)}")] if broken else []),
        Fact("Solver", f"{motion.solver_status} after {motion.iterations} iterations", key="solver",
             value={"status": motion.solver_status, "converged": motion.converged, "iterations": motion.iterations}),
        Fact("Path shifted by", f"{listed([f'{value:.1f}' for value in shift])} mm" if any(shift) else "",
             key="offset", value=shift, unit="mm"),
        *numbers(violations=motion.violations),
    ]  # fmt: skip


def gap_facts(gap: Array, time: Array | None = None) -> list[Fact]:
    """Tell how far the targets are from what the robot can make at all."""
    median = float(np.median(gap))
    fact = spread(GAP, "feasibility_gap", gap, time, meaning=GAP_MEANING, role="reference")
    return [*gap_warnings(median), fact]


def gap_warnings(median: float) -> list[Fact]:
    """Say when most of the targets cannot be made."""
    if not median > ENOUGH_DISTANCE:
        return []
    return [
        warning(f"{GAP}: nothing nearer to the target than a distance of {median:.2f} (median) was found for the robot")
    ]
