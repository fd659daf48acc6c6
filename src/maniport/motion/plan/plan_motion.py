"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.motion.effort import Effort, as_effort
from maniport.motion.follow.track_result import TrackResult
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import EXACT_WEIGHT, Damping, Objective, Targets
from maniport.motion.plan.home_motion import with_approach
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.planned_motion import PlannedMotion, Room
from maniport.motion.plan.planner import PLANNING_TIME_SCALE, Planner, time_parameterized
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.schedule import Schedule, require_few, require_rows
from maniport.motion.search.pointwise import improved_from, interpolated_distance, pointwise_best
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_finite, as_generator

POINTWISE_POINTS = 250  # Most waypoints at which the pointwise optimum is searched


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
    pointwise_best: ArrayLike | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> PlannedMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as possible, with the end effector on a path.

    Five steps: a reachability map gives many configurations at each stage of the path, their roadmap is searched for
    the best sequence, an optimizer improves all waypoints at once, and the time parameterization makes the motion as
    quick as the robot's limits allow, never quicker than the demonstration, from rest to rest. A path that the arm
    cannot follow is no error: the result says where and by how much.

    Parameters
    ----------
    arm : Arm
    profile : array_like, shape (n, d, d)
        Target velocity ellipsoids in the arm's base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Demonstrated times, increasing [s].
    path : array_like, shape (n, 3), optional
        Target positions of the end effector in the base frame [m].
    spec, damping, weights, progress
        As in `maniport.motion.track`.
    rotations : array_like, shape (n, 3, 3), optional
        Target orientations of the end effector in the base frame; `keep` and `orientation_weight` say which axes count
        and how much. The pointwise optimum ignores them.
    planner : Planner, optional
        A planner of this arm, these ellipsoids and limits. Default: a new one (0.5 s).
    pointwise_best : array_like, shape (n,), optional
        The pointwise optimum, where it is known, as from `place_path`. Default: searched (0.6 s).
    random_state : None, int or numpy.random.Generator
        Random seed.
    **control
        position_tolerance, speed_scale, rate, motion_limits, margin, collisions, keep, orientation_weight, home, effort; see
        `maniport.motion.PlanControl`.

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
    objective = objective.keeping(settings.orientation_axes, settings.orientation_weight)
    request = PlanRequest.of(settings, objective, profile, time, path, weights, rotations, pointwise_best)
    step = Step(progress, "Plan trajectory")
    planner = settings.planner(arm, spec, generator) if planner is None else planner
    path_of_arm = request.planned(planner, generator, between(step, 0.2, 0.9))
    timed = path_of_arm.timed
    if settings.home is not None:
        timed = with_approach(timed, planner.limits, settings.home)
    step.end(request.duration_text(timed))
    step = Step(progress, "Evaluate trajectory")
    result = evaluated(request, timed, planner.limits, planner.collisions, path_of_arm.pointwise)
    step.end()
    return result


@dataclass(frozen=True)
class PlanRequest:
    """Checked arguments of `plan_motion`."""

    settings: PlanControl  # resolved
    objective: Objective
    asked: Schedule
    pointwise: Array | None  # distances of the pointwise optimum (n,), where known

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
        pointwise_best: ArrayLike | None,
    ) -> "PlanRequest":
        """Check arguments as in `plan_motion`."""
        asked = Schedule.checked(objective, profile, time, path, weights, rotations)
        known = None if pointwise_best is None else as_finite(pointwise_best, "pointwise_best").copy()
        require_rows(len(asked), pointwise_best=(known, ()))
        require_few((asked.time[-1] - asked.time[0]) / settings.speed_scale * settings.rate)
        return cls(settings, objective, asked, known)

    @property
    def planning_effort(self) -> Effort:
        """The planning effort."""
        return as_effort(self.settings.planning_effort)

    def targets(self, limits: MotionLimits) -> Targets:
        """Targets at the n waypoints, for the arm with the margin of its limits."""
        return self.asked.targets(replace(self.objective, arm=limits.arm))

    def finer(self, limits: MotionLimits) -> tuple[Targets, Array, Array, NDArray[np.intp]]:
        """The same with waypoints between distant ones.

        Return targets, times of the planning time scale and earliest times from 0 [s], and the rows of the n waypoints.
        """
        fastest = 1.0 / self.settings.speed_scale
        slow = max(fastest, PLANNING_TIME_SCALE)
        finer, rows = self.asked.finer(self.objective, 0.16 / slow)
        since = finer.time - finer.time[0]
        return finer.targets(replace(self.objective, arm=limits.arm)), slow * since, fastest * since, rows

    def planned(
        self, planner: Planner, generator: np.random.Generator, progress: Callable[[float], None]
    ) -> "TimedPath":
        """Plan and time a trajectory."""
        targets, slow, fastest, rows = self.finer(planner.limits)
        settings, effort = self.settings, self.planning_effort
        q = planner.plan(targets, slow, settings.position_tolerance, effort, generator, progress)
        q, timed = time_parameterized(
            planner.limits, planner.collisions, targets, fastest, q, settings.position_tolerance, settings.rate, effort
        )
        timed = replace(timed, at=timed.at[rows])
        if self.pointwise is not None:
            return TimedPath(q, timed, self.pointwise)
        return TimedPath(q, timed, pointwise_distance(self.targets(planner.limits), planner.bank, timed.waypoints()))

    def duration_text(self, timed: Timed) -> str:
        """Durations of the motion and the demonstration."""
        return f"{timed.time[-1]:.1f} s (human {np.ptp(self.asked.time):.1f} s)"


@dataclass(frozen=True)
class TimedPath:
    """A planned and timed trajectory."""

    q: Array  # (m, dof), at the waypoints of PlanRequest.finer, before jerk was limited
    timed: Timed  # Timed.at is of the n waypoints of the request
    pointwise: Array  # (n,), distances of the pointwise optimum


def evaluated(
    request: PlanRequest, timed: Timed, limits: MotionLimits, collisions: Collisions | None, pointwise: Array
) -> PlannedMotion:
    """Compare a motion with its targets."""
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
        position_tolerance=float(settings.position_tolerance),
    )
    result = replace(result, orientation_error=targets.axis_angles(result.joint_positions))
    return PlannedMotion(
        **{field.name: getattr(result, field.name) for field in fields(TrackResult)},
        demonstrated_time=asked.time,
        limits=limits,
        limit_use=limits.use(timed.time, timed.positions),
        pointwise_best=pointwise,
        room=Room.of(collisions, result),
    )


def pointwise_distance(targets: Targets, bank: SeedBank, q: Array) -> Array:
    """Search the pointwise optimum (n,), also from the configurations of a motion (n, dof)."""
    rows = evenly_spaced(len(targets), POINTWISE_POINTS)
    distance = pointwise_best(replace(targets[rows], rotations=None), bank, q[rows]).distance
    return interpolated_distance(rows, distance, len(targets))


def pointwise_improved(targets: Targets, q: Array, pointwise: Array) -> Array:
    """Lower a pointwise optimum (n,) where a search from a motion (n, dof) finds a better one."""
    rows = evenly_spaced(len(targets), POINTWISE_POINTS)
    distance = improved_from(replace(targets[rows], rotations=None), q[rows]).distance
    return interpolated_distance(rows, np.minimum(pointwise[rows], distance), len(targets))
