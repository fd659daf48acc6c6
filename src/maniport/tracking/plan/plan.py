"""A motion that a robot can run: planned as a whole, timed within the robot's limits, and judged."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.defaults import DAMPING
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.subsample import evenly_spaced
from maniport.tracking.effort import CALM, HURRIED, as_effort
from maniport.tracking.follow.track_result import TrackResult, in_words
from maniport.tracking.motion_limits import MotionLimits
from maniport.tracking.objective import EXACT_WEIGHT, Damping, Objective, Targets
from maniport.tracking.plan.approach import with_approach
from maniport.tracking.plan.control import PlanControl
from maniport.tracking.plan.pace import Paced, paced, touching
from maniport.tracking.plan.planned_motion import PlannedMotion, over_floor
from maniport.tracking.plan.planner import Planner
from maniport.tracking.plan.retiming import Timed
from maniport.tracking.plan.room import Room
from maniport.tracking.schedule import Schedule, require_few, require_rows
from maniport.tracking.search.node_floor import floor_between, lowered
from maniport.tracking.search.node_floor import node_floor as searched_floor
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array, as_finite, as_generator

SLOWNESS = 4.0
"""Motions are planned as if they took so many times as long as the person's, or longer; their time is found later."""
ROUGHLY = 1e-3
"""While it is slow, no motion is brought nearer to its path [m]; that is done once it has its time."""
NEAR_FLOOR, HURRY = 1.05, 0.5
"""The first motion that comes so near to its node floor is taken; else, of those that collide least, the one with
the least product of that ratio and so much of a power of its time."""
MANY, HELD_UP = 500, 1.05
"""Motions of more points that limits make so many times longer than the person's are planned once: less smoothness
would make the shipped ladder recording 8 to 15 s longer for 2 to 4 % of the distance, and takes seconds to find."""
PARTS = (2.0, *[1.0] * max(len(CALM), len(HURRIED)))
"""What the first motion and further ones take of the time, beside one another."""
FLOOR_POINTS = 250
"""Points at which the node floor is searched, at most; between them its square is linear."""


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

    See Also
    --------
    PlannedMotion : what comes out.
    place_path : where the path lies best.
    track : from step to step instead.
    """
    settings, generator = PlanControl(**control), as_generator(random_state)
    if planner is not None:
        planner.require_fits(arm, spec)
    settings = settings.resolved(arm, planner)
    objective = Objective.of(arm, spec, damping, EXACT_WEIGHT, positive=True)
    objective = objective.keeping(settings.keep, settings.orientation_weight)
    request = Request.of(settings, objective, profile, time, path, weights, rotations, node_floor)
    step = Step(progress, "plan the motion")
    planner = settings.planner(arm, spec, generator) if planner is None else planner
    course = request.course(planner, generator, between(step, 0.2, 0.9))
    timed = course.timed
    if settings.home is not None:
        timed = with_approach(timed, planner.limits, settings.home)
    step.end(request.lasting(timed))
    step = Step(progress, "measure the motion")
    result = judged(request, timed, planner.limits, planner.collisions, course.floor)
    step.end(in_words(result))
    return result


@dataclass(frozen=True)
class Request:
    """What is asked of an arm, checked.

    Attributes
    ----------
    settings : PlanControl
        Resolved.
    objective : Objective
    asked : Schedule
    floor : ndarray, shape (n,), or None
        The node floor, where it is known.
    """

    settings: PlanControl
    objective: Objective
    asked: Schedule
    floor: Array | None

    @classmethod
    def of(
        cls,
        settings: PlanControl,
        objective: Objective,
        profile: ArrayLike,
        time: ArrayLike,
        path: ArrayLike | None,
        weights: ArrayLike | None,
        rotations: ArrayLike | None,
        node_floor: ArrayLike | None,
    ) -> "Request":
        """Check what users give; as in `plan_motion`."""
        asked = Schedule.checked(objective, profile, time, path, weights, rotations)
        known = None if node_floor is None else as_finite(node_floor, "node_floor").copy()
        require_rows(len(asked), node_floor=(known, ()))
        require_few((asked.time[-1] - asked.time[0]) / settings.tempo * settings.rate)
        return cls(settings, objective, asked, known)

    def targets(self, limits: MotionLimits) -> Targets:
        """What is asked for at the n points, of the arm that keeps the margin of its limits."""
        return self.asked.targets(replace(self.objective, arm=limits.arm))

    def finer(self, limits: MotionLimits) -> tuple[Targets, Array, NDArray[np.intp]]:
        """The same with points between them, when they are since the first [s], and which of them are the n."""
        settings = self.settings
        finer, rows = self.asked.finer(self.objective, as_effort(settings.effort).piece / slowness(settings))
        return finer.targets(replace(self.objective, arm=limits.arm)), finer.time - finer.time[0], rows

    def course(self, planner: Planner, generator: np.random.Generator, tell: Part) -> "Course":
        """Plan and time a motion."""
        targets = self.targets(planner.limits)
        floor = floor_of(targets, planner.bank) if self.floor is None else self.floor
        motion = _quickest_good(planner, self, floor, generator, tell)
        timed = replace(motion.timed, at=motion.timed.at[self.finer(planner.limits)[2]])
        if self.floor is None:
            floor = floor_below(targets, joints_at(timed), floor)
        return Course(motion.q, timed, floor)

    def lasting(self, timed: Timed) -> str:
        """How long a motion takes, in words."""
        return f"it takes {timed.time[-1]:.1f} s, the person took {np.ptp(self.asked.time):.1f} s"


@dataclass(frozen=True)
class Course:
    """A motion that was planned and timed.

    Attributes
    ----------
    q : ndarray, shape (m, dof)
        Postures at the points of `Request.finer`, before jerk was limited.
    timed : Timed
        The motion; `Timed.at` is of the n points that were asked for.
    floor : ndarray, shape (n,)
        The node floor.
    """

    q: Array
    timed: Timed
    floor: Array


def joints_at(timed: Timed) -> Array:
    """Joint positions at the points of a motion, shape (n, dof)."""
    return np.stack([np.interp(timed.at, timed.time, column) for column in timed.positions.T], axis=1)


def slowness(settings: PlanControl) -> float:
    """How many times slower than the person motions are while they are planned."""
    return max(1.0, SLOWNESS * settings.tempo) / settings.tempo


def _quickest_good(
    planner: Planner, request: Request, floor: Array, generator: np.random.Generator, tell: Part
) -> Paced:
    """Plan and time motions with ever less smoothness until one is near its floor, or else take the best bargain."""
    settings, effort = request.settings, as_effort(request.settings.effort)
    targets, since, rows = request.finer(planner.limits)
    slow, roughly = slowness(settings) * since, max(settings.tip_tolerance, ROUGHLY)
    sketch, found, least = None, None, (1.0, np.inf)
    details = [effort.first]
    for detail, heard in zip(details, pieces(tell, *PARTS), strict=False):  # the details become more
        sketch = planner.sketch(targets, slow, detail, generator, sketch, heard, effort)
        q = planner.finished(targets, slow, sketch, roughly, effort)
        motion = paced(
            planner.limits, planner.collisions, targets, since / settings.tempo, q, settings.tip_tolerance,
            settings.rate, effort.fineness, effort.enough, effort.gives_way,
        )  # fmt: skip
        timed = motion.timed
        ratio = over_floor(targets[rows].distance(joints_at(timed)[rows]), floor)
        held_up, long = timed.time[-1] > HELD_UP * since[-1] / settings.tempo, len(since) > MANY
        if ratio <= NEAR_FLOOR or (held_up and long):
            return motion
        if found is None and effort.again:
            details += HURRIED if held_up or long else CALM
        cost = touching(planner.collisions, timed), bargain(ratio, timed.time[-1])
        if found is None or cost < least:
            found, least = motion, cost
    assert found is not None
    return found


def bargain(distance: float, lasts: float) -> float:
    """What motions are compared by: how far they are from what is asked, and how long they take."""
    return float(distance * lasts**HURRY)


def judged(
    request: Request, timed: Timed, limits: MotionLimits, apart: Collisions | None, floor: Array
) -> PlannedMotion:
    """What became of what was asked, at its points, with their node floor (n,)."""
    asked, settings, targets = request.asked, request.settings, request.targets(limits)
    result = TrackResult.of_motion(
        limits.arm,
        timed.at,
        asked.ellipsoids,
        timed.time,
        timed.positions,
        spec=targets.objective.spec,
        damping=targets.objective.damping,
        path=asked.positions,
        velocity_limits=limits.velocity,
        control_velocities=timed.velocities,
        control_accelerations=timed.accelerations,
        tip_tolerance=float(settings.tip_tolerance),
    )
    result = replace(result, orientation_error=targets.axis_angles(result.joint_positions))
    return PlannedMotion(
        **{one.name: getattr(result, one.name) for one in fields(TrackResult)},
        demonstrated_time=asked.time,
        limits=limits,
        limit_use=limits.use(timed.time, timed.positions),
        node_floor=floor,
        room=Room.of(apart, result),
    )


def floor_of(targets: Targets, bank: StartBank) -> Array:
    """Search for the node floor (n,) at some of the points."""
    rows = evenly_spaced(len(targets), FLOOR_POINTS)
    distance = searched_floor(replace(targets[rows], rotations=None), bank).distance
    return floor_between(rows, distance, len(targets))


def floor_below(targets: Targets, q: Array, floor: Array) -> Array:
    """Search for something below a floor that was found, from what a motion does at its points (n, dof)."""
    rows = evenly_spaced(len(targets), FLOOR_POINTS)
    distance = np.minimum(floor[rows], lowered(replace(targets[rows], rotations=None), q[rows]).distance)
    return floor_between(rows, distance, len(targets))
