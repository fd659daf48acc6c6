"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.costs.cost import Cost, as_costs
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.costs.position import RelativePositionCost
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import EXACT_WEIGHT, Damping
from maniport.motion.plan.group_planner import Planner
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.planner import planning_time_scale
from maniport.motion.plan.time_parameterization import with_approach
from maniport.motion.problem import MotionProblem
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import of_each, require_few, schedules_of
from maniport.motion.search import interpolated_distance, pointwise_best
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice, as_finite, as_generator, require_shape


def plan_motion(
    arms: Arm | ArmGroup,
    profiles: ArrayLike | Sequence[ArrayLike],
    *,
    time: ArrayLike,
    paths: ArrayLike | Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    weights: ArrayLike | Sequence[ArrayLike] | None = None,
    rotations: ArrayLike | Sequence[ArrayLike] | None = None,
    costs: Sequence[Cost] = (),
    hand_targets: str = "placed",
    planner: Planner | None = None,
    pointwise_bests: ArrayLike | Sequence[ArrayLike] | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> RobotMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as possible, with end effectors on paths.

    Each arm is planned by itself, see `maniport.motion.plan.planner`. Arms that share joints or costs, or come within
    15 mm of one another, are then optimized together. All have one time: as fast as the limits allow, never faster than
    the demonstration, from rest to rest. A path that an arm cannot follow is no error: the result has the errors.

    Parameters
    ----------
    arms : Arm or ArmGroup
        With a group, `profiles`, `paths`, `weights`, `rotations` and `pointwise_bests` are sequences with one array for
        each arm; with an arm they are the array itself.
    profiles : array_like, shape (n, d, d), or a sequence of them
        Target velocity ellipsoids in the base frame, without damping, n ≥ 2.
    time : array_like, shape (n,)
        Demonstrated times, increasing [s].
    paths : array_like, shape (n, 3), or a sequence of them, optional
        Target positions of the end effectors in the base frame [m].
    spec, damping, weights, progress
        As in `maniport.motion.track`.
    rotations : array_like, shape (n, 3, 3), or a sequence of them, optional
        Target orientations of the end effectors in the base frame; `orientation_axes` sets which axes count. The
        pointwise optimum ignores them.
    costs : sequence of Cost, optional
        Further costs, over all joints; see `maniport.motion.Cost`. The pointwise optimum ignores them.
    hand_targets : {"placed", "relative"}
        Whether the end effectors follow their paths, or only keep the vectors from the first end effector to the
        others; the arms of the result then have no paths.
    planner : Planner, optional
        A planner of these arms, ellipsoids and limits. Default: a new one (0.5 s for an arm).
    pointwise_bests : array_like, shape (n,), or a sequence of them, optional
        The pointwise optimum, as from `place_path`. Default: searched (0.6 s for an arm).
    random_state : None, int or numpy.random.Generator
    **control
        Options of `maniport.motion.PlanSettings`; limits, collisions and the home configuration are for all joints.

    """
    settings = PlanSettings(**control)
    if not isinstance(arms, Arm | ArmGroup):
        raise InvalidInputError(f"arms must be an Arm or an ArmGroup; found {type(arms).__name__}")
    if planner is not None:
        planner.require_fits(arms, spec)
    settings = settings.resolved(arms, planner)
    arrays = {"profiles": profiles, "paths": paths, "weights": weights, "rotations": rotations}
    axes = axis_weights(settings.orientation_axes)
    schedules = schedules_of(arms, time, spec, damping, EXACT_WEIGHT, axes, arrays)
    if len({schedule.positions is None for schedule in schedules}) > 1:
        raise InvalidInputError("paths must be of all arms or of none")
    require_few(np.ptp(schedules[0].time) / settings.speed_scale * settings.rate)
    bests: list[Array] | None = None
    if pointwise_bests is not None:
        bests = [
            as_finite(best, "pointwise_bests").copy()
            for best in of_each(pointwise_bests, "pointwise_bests", arms)
        ]
        for best in bests:
            require_shape(best, "pointwise_bests", (len(schedules[0]),), ", one row for each time")
    relative = as_choice(hand_targets, "hand_targets", ("placed", "relative")) == "relative"
    if relative and (paths is None or len(schedules) < 2):
        raise InvalidInputError(
            "hand_targets='relative' keeps vectors between end effectors; give several arms with paths"
        )
    extra, generator = as_costs(costs, arms, schedules[0].time), as_generator(random_state)
    step = Step(progress, "Plan trajectory")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = Planner.of(settings.motion_limits, spec, settings.collisions, generator)
    group, limits, collisions = planner.group, planner.limits, planner.collisions
    schedules = [
        replace(schedule, objective=replace(schedule.objective, arm=arm))
        for schedule, arm in zip(schedules, group.arms, strict=True)
    ]
    # waypoints are inserted between distant ones
    finer, rows = zip(
        *(own.finer(0.16 / planning_time_scale(settings)) for own in schedules), strict=True
    )
    targets, at, vectors = (
        tuple(own.targets() for own in finer),
        finer[0].time,
        tuple[RelativePositionCost, ...](),
    )
    separate = targets
    if (
        relative
    ):  # the vectors from the first end effector to the others take the place of all paths
        first, *others = (own.positions for own in targets)
        vectors = tuple(
            RelativePositionCost(group, (0, i), at, own - first) for i, own in enumerate(others, 1)
        )
        targets = tuple(replace(own, positions=None) for own in targets)
        schedules = [replace(schedule, positions=None) for schedule in schedules]
    problem = MotionProblem(at, targets, limits, collisions, (*extra, *vectors))
    trajectory, coupled = planner.solve(
        problem, settings, generator, between(step, 0.2, 0.9), separate
    )
    problem, q = problem[rows[0]], trajectory.joint_positions[rows[0]]  # without those inserted
    trajectory = replace(trajectory, time=trajectory.time[rows[0]], joint_positions=q)
    if settings.home is not None:
        trajectory = with_approach(trajectory, limits, np.asarray(settings.home))
    step.end(f"{trajectory.control_time[-1]:.1f} s (human {np.ptp(schedules[0].time):.1f} s)")
    step, kept = Step(progress, "Evaluate trajectory"), dict[str, Any]()
    if bests is None:
        bests = _pointwise_bests(planner, problem, vectors, q)
    if relative:
        kept["relative"] = np.stack([cost.at(problem.time) for cost in vectors], axis=1)
        kept["relative_error"] = np.stack([cost.error(q, problem.time) for cost in vectors], axis=1)
    motion = RobotMotion.of(
        group, schedules, trajectory, collisions, limits.velocity, coupled=coupled,
        position_tolerance=float(settings.position_tolerance), pointwise_bests=bests, **kept,
    )  # fmt: skip
    step.end()
    return motion


def _pointwise_bests(
    planner: Planner, problem: MotionProblem, vectors: tuple[Cost, ...], q: Array, most: int = 250
) -> list[Array]:
    """Search pointwise optima of each arm, or with vectors of the sum of squares; a motion (n, dof) is a start."""
    rows, count = evenly_spaced(len(q), most), PlanSettings.budget.pointwise_starts
    targets, columns = (
        tuple(replace(own[rows], rotations=None) for own in problem.targets),
        planner.group.columns,
    )
    banks = [
        own.bank.starts_for(part, count) for own, part in zip(planner.arms, targets, strict=True)
    ]
    if vectors:
        starts = np.empty((len(rows), count, q.shape[1]))
        for bank, own in zip(banks, columns, strict=True):
            starts[..., own] = bank
        best = pointwise_best(
            replace(problem[rows], targets=targets, costs=vectors), starts, q[rows]
        )
        parts = [best[:, own] for own in columns]
    else:
        shares = zip(targets, banks, columns, strict=True)
        parts = [pointwise_best(part, bank, q[rows][:, own]) for part, bank, own in shares]
    pairs = zip(targets, parts, strict=True)
    return [interpolated_distance(rows, own.distance(best), len(q)) for own, best in pairs]
