"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.errors import InvalidInputError
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import as_costs
from maniport.motion.costs.orientation import axis_weights
from maniport.motion.costs.position import RelativePositionCost
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.group_planner import Planner
from maniport.motion.plan.plan_options import PlanOptions
from maniport.motion.plan.planner import planning_time_scale
from maniport.motion.plan.time_parameterization import with_approach
from maniport.motion.problem import EXACT_WEIGHT, ArmProblem, CostWeights, MotionProblem
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.search import interpolated_distance, pointwise_best
from maniport.motion.targets import TargetTrajectory, require_few, targets_of_arms
from maniport.motion.trajectory import interpolated
from maniport.util.progress import Progress, Step, between
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_finite, as_generator, require_shape

LONGEST_GAP = 0.16  # Between waypoints at the planning time scale [s]


def plan_motion(
    robot: Arm | ArmGroup,
    targets: TargetTrajectory | Sequence[TargetTrajectory],
    options: PlanOptions | None = None,
    *,
    planner: Planner | None = None,
    starts: Sequence[ArrayLike] | None = None,
    random_state: int | np.random.Generator | None = 0,
    progress: Progress | None = None,
) -> RobotMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as possible, with end effectors on paths.

    Each arm is planned by itself, see `maniport.motion.plan.planner`. Arms that share joints or costs, or come within
    15 mm of one another, are then optimized together. All have one time: as fast as the limits allow, never faster than
    the demonstration, from rest to rest. A path that an arm cannot follow is no error: the result has the errors.

    Parameters
    ----------
    robot : Arm or ArmGroup
    targets : TargetTrajectory or sequence of them
        Of the arm, or of each arm of a group: velocity ellipsoids at the same demonstrated times and, optionally,
        positions and rotations of the end effector, in the base frame. `TargetTrajectory.checked` makes them. The
        pointwise optimum ignores rotations.
    options : PlanOptions, optional
        Limits, collisions and the home configuration are for all joints.
    planner : Planner, optional
        A planner of these arms, ellipsoids and limits, whose limits and collisions are used. Default: a new one (0.5 s
        for an arm).
    starts : sequence of array_like, shape (n, dof), optional
        A motion of each arm from which the optimizer starts, besides that of its graph search: the joint positions of
        its `Placement`.
    random_state : None, int or numpy.random.Generator
    progress : callable, optional
        Called with the name of a step, the fraction done and, at its end, a message.

    Raises
    ------
    InvalidInputError, NotSPDError
        When a target or an option is wrong, or a planner is of other arms or ellipsoids.
    """
    if not isinstance(robot, Arm | ArmGroup):
        raise InvalidInputError(
            f"robot must be an Arm or an ArmGroup; found {type(robot).__name__}"
        )
    if options is None:
        options = PlanOptions()
    checked = targets_of_arms(robot, targets)
    if starts is not None:
        starts = _checked_starts(starts, as_group(robot), len(checked[0]))
    specs = [target.spec for target in checked]
    if planner is not None:
        planner.require_fits(robot, specs)
    options = options.resolved(robot, planner)
    generator = as_generator(random_state)
    if planner is None:
        assert isinstance(options.motion_limits, MotionLimits)
        spec = group_spec(as_group(robot), specs)
        planner = Planner.of(options.motion_limits, spec, options.collisions, generator)
    return plan_checked(
        planner,
        checked,
        options,
        starts=starts,
        random=generator,
        progress=progress,
    )


def _checked_starts(starts: Sequence[ArrayLike], group: ArmGroup, count: int) -> tuple[Array, ...]:
    """Require a motion (count, dof) of each arm."""
    if len(starts) != len(group):
        raise InvalidInputError(
            f"starts must be {len(group)}, one for each arm; found {len(starts)}"
        )
    checked = []
    for arm, start in zip(group.arms, starts, strict=True):
        motion = as_finite(start, "starts")
        require_shape(motion, "starts", (count, arm.dof), ", one row for each time")
        checked.append(motion)
    return tuple(checked)


def group_spec(group: ArmGroup, specs: Sequence[EllipsoidSpec]) -> EllipsoidSpec:
    """Return the ellipsoids of a group, whose numbers as joint weights are those of the arms."""
    weights = specs[0].joint_weights
    if len(specs) == 1 or weights is None or isinstance(weights, str):
        if any(spec != specs[0] for spec in specs):
            raise InvalidInputError("targets must have one spec for all arms without a planner")
        return specs[0]
    joined = np.ones(group.dof)
    for columns, spec in zip(group.columns, specs, strict=True):
        joined[columns] = spec.joint_weights
    return replace(specs[0], joint_weights=tuple(joined))


def plan_checked(
    planner: Planner,
    targets: Sequence[TargetTrajectory],
    options: PlanOptions,
    *,
    starts: Sequence[Array] | None,
    random: np.random.Generator,
    progress: Progress | None,
    pointwise: bool = True,
) -> RobotMotion:
    """Plan a motion as `plan_motion` does, with targets that are checked and options that are resolved.

    `pointwise`: whether the pointwise optimum is searched.
    """
    group = planner.group
    limits = planner.limits
    collisions = planner.collisions
    waypoint_times = targets[0].time
    duration = float(np.ptp(waypoint_times))
    require_few(duration / options.speed_scale * options.rate)
    relative = options.hand_targets == "relative"
    if relative:
        _require_paths_of_several(targets)
    further_costs = as_costs(options.costs, group, waypoint_times)
    step = Step(progress, "Plan trajectory")

    cost_weights = CostWeights(EXACT_WEIGHT, axis_weights(options.orientation_axes))
    gap = LONGEST_GAP / planning_time_scale(options)
    refined = _refined(group, targets, cost_weights, gap)
    start = None
    if starts is not None:
        start = interpolated(waypoint_times, group.joined(*starts), refined.time)

    vectors: tuple[RelativePositionCost, ...] = ()
    joint_problems = refined.arms
    if relative:  # vectors from the first end effector to the others take the place of all paths
        vectors = _vectors_between(refined.arms, refined.time)
        joint_problems = tuple(problem.without_positions() for problem in refined.arms)
        targets = [replace(target, positions=None) for target in targets]
    problem = MotionProblem(
        time=refined.time,
        arms=joint_problems,
        limits=limits,
        collisions=collisions,
        costs=(*further_costs, *vectors),
        start=start,
    )
    planned = planner.solve(problem, options, random, between(step, 0.2, 0.9), refined.arms)

    problem = problem[refined.rows]  # without the inserted waypoints
    trajectory = planned.trajectory
    q = trajectory.joint_positions[refined.rows]
    trajectory = replace(trajectory, time=trajectory.time[refined.rows], joint_positions=q)
    if options.home is not None:
        trajectory = with_approach(trajectory, limits, np.asarray(options.home))
    step.end(f"{trajectory.control_time[-1]:.1f} s (demonstrated {duration:.1f} s)")

    step = Step(progress, "Evaluate trajectory")
    at_waypoints = []
    for arm, target in zip(group.arms, targets, strict=True):
        at_waypoints.append(ArmProblem.of(arm, target, cost_weights))
    pointwise_bests = None
    if pointwise:
        pointwise_bests = _pointwise_bests(
            planner, problem, vectors, q, options.budget.pointwise_starts
        )
    motion = RobotMotion.of(
        group,
        at_waypoints,
        trajectory,
        collisions,
        limits.velocity,
        position_tolerance=float(options.position_tolerance),
        pointwise_bests=pointwise_bests,
        coupled=planned.coupled,
    )
    if relative:
        motion = _with_relative_errors(motion, vectors, Configurations(group, q, problem.time))
    step.end()
    return motion


class RefinedProblems(NamedTuple):
    """Problems of each arm with waypoints inserted between distant ones."""

    arms: tuple[ArmProblem, ...]
    rows: NDArray[np.intp]  # (n,), of the given waypoints among all; the same for all arms

    @property
    def time(self) -> Array:
        """Demonstrated times of all waypoints, shape (m,) [s]."""
        return self.arms[0].target.time


def _refined(
    group: ArmGroup, targets: Sequence[TargetTrajectory], weights: CostWeights, gap: float
) -> RefinedProblems:
    """Make the problem of each arm, with waypoints inserted between those more than a gap [s] apart."""
    problems = []
    for arm, target in zip(group.arms, targets, strict=True):
        refined, rows = target.refined(gap)
        problems.append(ArmProblem.of(arm, refined, weights))
    return RefinedProblems(tuple(problems), rows)


def _require_paths_of_several(targets: Sequence[TargetTrajectory]) -> None:
    """Raise where there are no vectors between end effectors that a motion could keep."""
    if targets[0].positions is None or len(targets) < 2:
        raise InvalidInputError(
            "hand_targets='relative' keeps vectors between end effectors; give several arms with paths"
        )


def _with_relative_errors(
    motion: RobotMotion, vectors: Sequence[RelativePositionCost], at: Configurations
) -> RobotMotion:
    """Return a motion with its target vectors between end effectors, and the distances from them."""
    return replace(
        motion,
        relative=np.stack([cost.vectors_at(at.time) for cost in vectors], axis=1),
        relative_error=np.stack([cost.error(at) for cost in vectors], axis=1),
    )


def _pointwise_bests(
    planner: Planner,
    problem: MotionProblem,
    vectors: tuple[RelativePositionCost, ...],
    q: Array,
    count: int,
    most: int = 80,
) -> list[Array]:
    """Return distances of the pointwise optima of each arm, each of shape (n,).

    With vectors between end effectors, the optimum is that of the sum over all arms. Each search starts from the
    motion q (n, dof), and from `count` samples of the arm. At most `most` waypoints are searched, and the distances
    between them interpolated.
    """
    rows = evenly_spaced(len(q), most)
    columns = planner.group.columns
    arms = []
    for arm in problem.arms:
        arms.append(arm[rows].without_rotations().with_ellipsoids_only())
    starts = []
    for arm_planner, arm in zip(planner.arms, arms, strict=True):
        starts.append(arm_planner.bank.starts_for(arm.target, count))

    if vectors:
        joined = np.empty((len(rows), count, q.shape[1]))
        for arm_starts, arm_columns in zip(starts, columns, strict=True):
            joined[..., arm_columns] = arm_starts
        coupled = replace(problem[rows], arms=tuple(arms), costs=vectors)
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
