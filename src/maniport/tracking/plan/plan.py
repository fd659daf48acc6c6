"""A motion that a robot can run: planned as a whole, timed within the robot's limits, and judged."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import median_filter

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.defaults import DAMPING
from maniport.spd.affine_invariant import distance
from maniport.steps import Part, Progress, Step, between, nobody
from maniport.thinning import evenly
from maniport.tracking.effort import CALM, HURRIED, as_effort
from maniport.tracking.follow.track_result import TrackResult, in_words
from maniport.tracking.motion_limits import LimitUse, MotionLimits
from maniport.tracking.objective import EXACT_WEIGHT, Damping, Objective, Targets
from maniport.tracking.plan.approach import with_approach
from maniport.tracking.plan.control import PlanControl
from maniport.tracking.plan.planner import Planner
from maniport.tracking.plan.retiming import Timed
from maniport.tracking.schedule import Schedule, require_few, require_rows
from maniport.tracking.search.node_floor import floor_between, lowered
from maniport.tracking.search.node_floor import node_floor as searched_floor
from maniport.validation import Array, as_finite, as_generator

SLOWNESS = 4.0
"""Motions are planned as if they took so many times as long as the person's, or longer; their time is found later."""
ROUGHLY = 1e-3
"""While it is slow, no motion is brought nearer to its path [m]; that is done once it has its time."""
NEAR_FLOOR, HURRY = 1.05, 0.5
"""The first motion that comes so near to its node floor is taken; else the one with the least product of that ratio and
so much of a power of its time."""
LONG, HELD_UP = 500, 1.05
"""Motions of more points that limits make so many times longer than the person's are planned once: less smoothness
would make the shipped ladder recording 8 to 15 s longer for 2 to 4 % of the distance, and takes seconds to find."""
WORTH = 0.99
"""Share of that product of a smoother motion below which the next one is taken."""
CLOSE, CLOSE_STEPS = 0.01, 1000
"""Next to points that are so much farther from a collision than the nearest [m] control steps are looked at, at most
so many."""
LEAST_LEAP, ABRUPT, AROUND = (0.02, 0.2), 4.0, 9
"""Least leap of a path [m] and of ellipsoids, how many times quicker it is than usual, and among how many steps."""
FLOOR_POINTS = 250
"""Points at which the node floor is searched, at most; between them its square is linear."""


@dataclass(frozen=True)
class Room:
    """How near a motion comes to a collision.

    Attributes
    ----------
    known : bool
        Whether anything could be checked.
    why : str
        Why not; empty when something was.
    share : float
        Share of the control steps that collide.
    clearance : float
        Smallest distance at the points of the path and between the closest of them [m]; negative in a collision,
        infinite where nothing is checked.
    time : float
        When [s].
    pair : tuple of str
        Between what.
    """

    known: bool = False
    why: str = "it was not asked for"
    share: float = 0.0
    clearance: float = np.inf
    time: float = 0.0
    pair: tuple[str, str] = ("", "")

    @classmethod
    def of(cls, collisions: Collisions | None, motion: TrackResult) -> "Room":
        """Measure a motion at points and, next to the closest of them, at control steps; ask at all of these."""
        if collisions is None or not collisions.known:
            return cls(why=cls.why if collisions is None else collisions.why)
        share = float(collisions.collides(motion.control_positions).mean())
        distance = collisions.clearance(motion.joint_positions)
        close = distance <= distance.min() + CLOSE
        steps = np.flatnonzero(np.interp(motion.control_time, motion.time, close.astype(float)) > 0.0)
        steps = steps[evenly(len(steps), CLOSE_STEPS)]
        every = np.concatenate([motion.joint_positions[close], motion.control_positions[steps]])
        clock = np.append(motion.time[close], motion.control_time[steps])
        nearest = collisions.nearest(every)
        i = int(np.argmin(nearest.distance))
        pair = (str(nearest.first[i]), str(nearest.second[i]))
        return cls(True, "", share, float(nearest.distance[i]), float(clock[i]), pair)


@dataclass(frozen=True, repr=False)
class PlannedMotion(TrackResult):
    """A `TrackResult` that starts and ends at rest, within the robot's limits.

    Attributes
    ----------
    demonstrated_time : ndarray, shape (n,)
        When the person was at the points [s]; ``time`` says when the robot is.
    limits : MotionLimits
    limit_use : LimitUse
        How much of them is used at most, and when.
    room : Room
        How near it comes to a collision.
    node_floor : ndarray, shape (n,)
        Smallest distance to each target ellipsoid with the tip at its point of the path, found for each point by itself
        (of at most 250; between them its square is linear). Smooth motions stay above it, but for what the tip is
        beside its path.
    """

    demonstrated_time: Array
    limits: MotionLimits
    limit_use: LimitUse
    room: Room
    node_floor: Array

    @property
    def certificate(self) -> float:
        """Root mean square of the distance over that of the node floor: no motion can be better than by so much."""
        return over_floor(self.distance, self.node_floor)

    @property
    def leaps(self) -> NDArray[np.bool_]:
        """Whether what was demonstrated leaps to or from each point, in its path or its ellipsoids, shape (n,).

        A leap is a step of more than 0.02 m or a distance of 0.2 that is also so quick as four times the median of the
        steps around it: most are errors of the recording or of its fit.
        """
        pace = 1.0 / np.diff(self.demonstrated_time)
        damped = self.target + self.damping.epsilon * np.eye(self.target.shape[-1])
        steps = [(distance(damped[1:], damped[:-1]), LEAST_LEAP[1])]
        if self.path is not None:
            steps.append((np.linalg.norm(np.diff(self.path, axis=0), axis=1), LEAST_LEAP[0]))
        found = np.zeros(len(pace) + 2, bool)
        for size, least in steps:
            usual = median_filter(size * pace, min(AROUND, len(pace)), mode="nearest")
            found[1:-1] |= (size > least) & (size * pace > ABRUPT * usual)
        return np.asarray(found[1:] | found[:-1])


def over_floor(distance: Array, floor: Array) -> float:
    """Root mean square of distances (n,) over that of their floor (n,); infinite where that is zero."""
    ground = float(np.linalg.norm(floor))
    return float(np.linalg.norm(distance)) / ground if ground > 0.0 else np.inf


def plan_motion(
    arm: Arm,
    profile: ArrayLike,
    *,
    time: ArrayLike,
    path: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | None = None,
    rotations: ArrayLike | None = None,
    planner: Planner | None = None,
    node_floor: ArrayLike | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> PlannedMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as the arm can, with its tip on a path.

    A shortest path through many postures at each point of the path gives the posture for the whole of it, all points
    are then refined at once, and the motion is timed: as quick as the robot's limits allow, never quicker than the
    person, from rest to rest. A path that the arm cannot follow is no error: the result says where and by how much.

    Parameters
    ----------
    arm : Arm
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        The person's, increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the tip in the base frame [m].
    spec, damping, weights, progress
        As in `maniport.tracking.track`.
    rotations : array_like, shape (n, 3, 3), optional
        How the tip shall be turned in the base frame: what of it and how much is up to `keep` and
        `orientation_weight`. The node floor does not ask for it.
    planner : Planner, optional
        One that was made for this arm, these ellipsoids and limits. Default: a new one (0.5 s).
    node_floor : array_like, shape (n,), optional
        Where it is known already, as from `place_path`. Default: it is searched for (0.6 s).
    random_state : None, int or numpy.random.Generator
        Seed of what is drawn.
    **control
        How: tip_tolerance, tempo, rate, motion_limits, margin, collisions, keep, orientation_weight, home,
        effort; see `maniport.tracking.PlanControl`.

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    settings, generator = PlanControl(**control), as_generator(random_state)
    if planner is not None:
        planner.require_fits(arm, spec)
    settings = settings.resolved(arm, planner)
    objective = Objective.of(arm, spec, damping, EXACT_WEIGHT, positive=True)
    objective = objective.keeping(settings.keep, settings.orientation_weight)
    asked = Schedule.checked(objective, profile, time, path, weights, rotations)
    known = None if node_floor is None else as_finite(node_floor, "node_floor").copy()
    require_rows(len(asked), node_floor=(known, ()))
    require_few((asked.time[-1] - asked.time[0]) / settings.tempo * settings.rate)
    step = Step(progress, "plan the motion")
    planner = settings.planner(arm, spec, generator) if planner is None else planner
    targets = planner.within(asked.targets(objective))
    floor = _node_floor(planner, targets) if known is None else known
    timed = _quickest_good(planner, asked, objective, floor, settings, generator, between(step, 0.2, 0.9))
    if settings.home is not None:
        timed = with_approach(timed, planner.limits, settings.home)
    lasts, person = float(timed.time[-1]), float(np.ptp(asked.time))
    step.end(f"it takes {lasts:.1f} s, the person took {person:.1f} s")
    step = Step(progress, "measure the motion")
    result = _judged(planner, asked, targets, timed, settings, floor, known is None)
    step.end(in_words(result))
    return result


def _quickest_good(
    planner: Planner,
    asked: Schedule,
    objective: Objective,
    floor: Array,
    settings: PlanControl,
    generator: np.random.Generator,
    tell: Part,
) -> Timed:
    """Plan and time motions with ever less smoothness until one is near its floor, or else take the best bargain."""
    effort, slowness = as_effort(settings.effort), max(1.0, SLOWNESS * settings.tempo) / settings.tempo
    finer, rows = asked.finer(objective, effort.piece / slowness)
    targets, since = planner.within(finer.targets(objective)), finer.time - finer.time[0]
    slow, roughly = slowness * since, max(settings.tip_tolerance, ROUGHLY)
    sketch, found, least = None, None, np.inf
    detail = effort.first
    for heard in (tell, nobody) if effort.again else (tell,):
        sketch = planner.sketch(targets, slow, detail, generator, sketch, heard, effort)
        q = planner.finished(targets, slow, sketch, roughly, effort)
        timed = planner.timed(targets, since / settings.tempo, q, settings.tip_tolerance, settings.rate, effort)
        timed = replace(timed, at=timed.at[rows])
        there = np.stack([np.interp(timed.at, timed.time, column) for column in timed.positions.T], axis=1)
        ratio = over_floor(targets[rows].distance(there), floor)
        held_up, long = timed.time[-1] > HELD_UP * since[-1] / settings.tempo, len(since) > LONG
        if ratio <= NEAR_FLOOR or (held_up and long):
            return timed
        detail = HURRIED if held_up or long else CALM
        cost = ratio * timed.time[-1] ** HURRY
        if found is None or cost < WORTH * least:
            found, least = timed, cost
    assert found is not None
    return found


def _judged(
    planner: Planner, asked: Schedule, targets: Targets, timed: Timed, settings: PlanControl, floor: Array, mine: bool
) -> PlannedMotion:
    """What became of it."""
    result = TrackResult.of_motion(
        planner.limits.arm,
        timed.at,
        asked.ellipsoids,
        timed.time,
        timed.positions,
        spec=targets.objective.spec,
        damping=targets.objective.damping,
        path=asked.positions,
        velocity_limits=planner.limits.velocity,
        control_velocities=timed.velocities,
        control_accelerations=timed.accelerations,
        tip_tolerance=float(settings.tip_tolerance),
    )
    result = replace(result, orientation_error=targets.axis_angles(result.joint_positions))
    return PlannedMotion(
        **{one.name: getattr(result, one.name) for one in fields(TrackResult)},
        demonstrated_time=asked.time,
        limits=planner.limits,
        limit_use=planner.limits.use(timed.time, timed.positions),
        node_floor=_node_floor(planner, targets, result.joint_positions, floor) if mine else floor,
        room=Room.of(planner.collisions, result),
    )


def _node_floor(planner: Planner, targets: Targets, q: Array | None = None, floor: Array | None = None) -> Array:
    """Search at some points; or, from what a motion does there, for something below a floor that was found."""
    rows = evenly(len(targets), FLOOR_POINTS)
    here = replace(targets[rows], rotations=None)
    if q is None or floor is None:
        distance = searched_floor(here, planner.bank).distance
    else:
        distance = np.minimum(floor[rows], lowered(here, q[rows]).distance)
    return floor_between(rows, distance, len(targets))
