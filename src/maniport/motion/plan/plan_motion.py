"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import Cost, as_costs
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.costs.position import RelativePositionCost
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.group_planner import Planner
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.planner import planning_time_scale
from maniport.motion.plan.time_parameterization import with_approach
from maniport.motion.problem import EXACT_WEIGHT, ArmProblem, CostWeights, MotionProblem
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.search import interpolated_distance, pointwise_best
from maniport.motion.targets import Damping, checked_targets, of_each, require_few
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, between
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_choice, as_finite, as_generator, require_shape

LONGEST_GAP = 0.16  # Between waypoints at the planning time scale [s]


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
    cost_weights = CostWeights(EXACT_WEIGHT, axis_weights(settings.orientation_axes))
    targets = checked_targets(arms, time, spec, damping, arrays)
    waypoint_times = targets[0].time
    if len({target.positions is None for target in targets}) > 1:
        raise InvalidInputError("paths must be of all arms or of none")
    require_few(np.ptp(waypoint_times) / settings.speed_scale * settings.rate)
    bests: list[Array] | None = None
    if pointwise_bests is not None:
        bests = [
            as_finite(best, "pointwise_bests").copy()
            for best in of_each(pointwise_bests, "pointwise_bests", arms)
        ]
        for best in bests:
            require_shape(
                best, "pointwise_bests", (len(waypoint_times),), ", one row for each time"
            )
    relative = as_choice(hand_targets, "hand_targets", ("placed", "relative")) == "relative"
    if relative and (paths is None or len(targets) < 2):
        raise InvalidInputError(
            "hand_targets='relative' keeps vectors between end effectors; give several arms with paths"
        )
    further_costs = as_costs(costs, arms, waypoint_times)
    generator = as_generator(random_state)
    step = Step(progress, "Plan trajectory")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = Planner.of(settings.motion_limits, spec, settings.collisions, generator)
    group = planner.group
    limits = planner.limits
    collisions = planner.collisions

    # waypoints are inserted between distant ones
    gap = LONGEST_GAP / planning_time_scale(settings)
    problems = []
    for arm, target in zip(group.arms, targets, strict=True):
        refined, rows = target.refined(gap)  # the same rows for all arms
        problems.append(ArmProblem.of(arm, refined, cost_weights))
    separate = tuple(problems)
    refined_time = refined.time

    vectors: tuple[RelativePositionCost, ...] = ()
    joint_problems = separate
    if relative:  # vectors from the first end effector to the others take the place of all paths
        vectors = _vectors_between(separate, refined_time)
        joint_problems = tuple(problem.without_positions() for problem in separate)
        targets = [replace(target, positions=None) for target in targets]
    problem = MotionProblem(
        refined_time, joint_problems, limits, collisions, (*further_costs, *vectors)
    )
    trajectory, coupled = planner.solve(
        problem, settings, generator, between(step, 0.2, 0.9), separate
    )

    problem = problem[rows]  # without the inserted waypoints
    q = trajectory.joint_positions[rows]
    trajectory = replace(trajectory, time=trajectory.time[rows], joint_positions=q)
    if settings.home is not None:
        trajectory = with_approach(trajectory, limits, np.asarray(settings.home))
    step.end(f"{trajectory.control_time[-1]:.1f} s (human {np.ptp(waypoint_times):.1f} s)")
    step, kept = Step(progress, "Evaluate trajectory"), dict[str, Any]()
    if bests is None:
        bests = _pointwise_bests(planner, problem, vectors, q)
    if relative:
        at = Configurations(group, q, problem.time)
        kept["relative"] = np.stack([cost.vectors_at(problem.time) for cost in vectors], axis=1)
        kept["relative_error"] = np.stack([cost.error(at) for cost in vectors], axis=1)
    at_waypoints = []
    for arm, target in zip(group.arms, targets, strict=True):
        at_waypoints.append(ArmProblem.of(arm, target, cost_weights))
    motion = RobotMotion.of(
        group, at_waypoints, trajectory, collisions, limits.velocity, coupled=coupled,
        position_tolerance=float(settings.position_tolerance), pointwise_bests=bests, **kept,
    )  # fmt: skip
    step.end()
    return motion


def _pointwise_bests(
    planner: Planner,
    problem: MotionProblem,
    vectors: tuple[RelativePositionCost, ...],
    q: Array,
    most: int = 250,
) -> list[Array]:
    """Search pointwise optima of each arm, or with vectors of the sum of squares; a motion (n, dof) is a start."""
    rows = evenly_spaced(len(q), most)
    count = PlanSettings.budget.pointwise_starts
    columns = planner.group.columns
    arms = tuple(arm[rows].without_rotations() for arm in problem.arms)
    starts = []
    for arm_planner, arm in zip(planner.arms, arms, strict=True):
        starts.append(arm_planner.bank.starts_for(arm.target, count))

    if vectors:
        joined = np.empty((len(rows), count, q.shape[1]))
        for arm_starts, arm_columns in zip(starts, columns, strict=True):
            joined[..., arm_columns] = arm_starts
        coupled = replace(problem[rows], arms=arms, costs=vectors)
        best = pointwise_best(coupled, joined, q[rows])
        configurations = [best[:, arm_columns] for arm_columns in columns]
    else:
        configurations = []
        for arm, arm_starts, arm_columns in zip(arms, starts, columns, strict=True):
            configurations.append(pointwise_best(arm, arm_starts, q[rows][:, arm_columns]))

    distances = []
    for arm, best in zip(arms, configurations, strict=True):
        distances.append(interpolated_distance(rows, arm.distance(best), len(q)))
    return distances


def _vectors_between(arms: Sequence[ArmProblem], time: Array) -> tuple[RelativePositionCost, ...]:
    """Return costs of the vectors from the first end effector to the others."""
    first = arms[0].path
    costs = []
    for i, arm in enumerate(arms[1:], 1):
        costs.append(RelativePositionCost((0, i), time, arm.path - first))
    return tuple(costs)
