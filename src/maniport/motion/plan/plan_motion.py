"""Plan a motion that a robot can run, time it within the robot's limits, and evaluate it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.errors import InvalidInputError
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.effort import as_effort
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import EXACT_WEIGHT, Damping, Objective, Targets
from maniport.motion.plan.coupling import coupled_motion
from maniport.motion.plan.home_motion import with_approach
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.planner import PLANNING_TIME_SCALE, Planner, copies, time_parameterized
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.problem import Cost, MotionProblem, RelativePositionCost, as_costs
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule, require_few, require_rows
from maniport.motion.search.pointwise import (
    STARTS,
    improved_from,
    interpolated_distance,
    pointwise_best,
    search_pointwise,
)
from maniport.motion.search.seed_bank import SeedBank
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.util.defaults import DAMPING
from maniport.util.progress import Part, Progress, Step, between, pieces
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_choice, as_finite, as_generator

PLACED, RELATIVE = "placed", "relative"
POINTWISE_POINTS = 250  # Most waypoints at which the pointwise optimum is searched


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
    tips: str = PLACED,
    planner: Planner | None = None,
    pointwise_bests: ArrayLike | Sequence[ArrayLike] | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **control: Any,
) -> RobotMotion:
    """Plan a motion whose velocity ellipsoids come as near to target ones as possible, with end effectors on paths.

    Five steps for each arm: a reachability map gives many configurations at each stage of the path, their roadmap is
    searched for the best sequence, an optimizer improves all waypoints at once, and the time parameterization makes the
    motion as quick as the robot's limits allow, never quicker than the demonstration, from rest to rest. Several arms
    that share joints or costs, or come within 15 mm of one another, are then optimized together; all have one time. A
    path that an arm cannot follow is no error: the result has the errors.

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
        Target orientations of the end effectors in the base frame; `orientation_axes` and `orientation_weight` set
        which axes count and how much. The pointwise optimum ignores them.
    costs : sequence of Cost, optional
        Further costs, over all joints; see `maniport.motion.problem.Cost`. The pointwise optimum ignores them.
    tips : {"placed", "relative"}
        Whether the end effectors follow their paths, or only keep the vectors from the first end effector to the
        others; the arms of the result then have no paths.
    planner : Planner, optional
        A planner of these arms, ellipsoids and limits. Default: a new one (0.5 s for an arm).
    pointwise_bests : array_like, shape (n,), or a sequence of them, optional
        The pointwise optimum, where it is available, as from `place_path`. Default: searched (0.6 s for an arm).
    random_state : None, int or numpy.random.Generator
        Random seed.
    **control
        Options of `maniport.motion.PlanControl`; limits, collisions and the home configuration are for all joints.

    Returns
    -------
    RobotMotion

    Raises
    ------
    InvalidInputError
        When an argument has a wrong shape or value.
    NotSPDError
        When an ellipsoid is asymmetric or indefinite.
    """
    settings = PlanControl(**control)
    if not isinstance(arms, Arm | ArmGroup):
        raise InvalidInputError(f"arms must be an Arm or an ArmGroup; found {type(arms).__name__}")
    if planner is not None:
        planner.require_fits(arms, spec)
    settings = settings.resolved(arms, planner)
    arrays = profiles, paths, weights, rotations, pointwise_bests
    tasks = _tasks(arms, settings, time, spec, damping, arrays)
    relative = as_choice(tips, "tips", (PLACED, RELATIVE)) == RELATIVE
    if relative and (paths is None or len(tasks) < 2):
        raise InvalidInputError("tips='relative' keeps vectors between end effectors; give several arms with paths")
    extra, generator = as_costs(costs, arms, tasks[0].schedule.time), as_generator(random_state)
    step = Step(progress, "Plan trajectory")
    if planner is None:
        assert isinstance(settings.motion_limits, MotionLimits)
        planner = Planner.of(settings.motion_limits, spec, settings.collisions, generator)
    motion = _Plan(settings, tasks, planner, extra, relative).motion(generator, between(step, 0.2, 0.9))
    step.end(f"{motion.timed.time[-1]:.1f} s (human {np.ptp(tasks[0].schedule.time):.1f} s)")
    step = Step(progress, "Evaluate trajectory")
    result = motion.evaluated()
    step.end()
    return result


@dataclass(frozen=True)
class _Task:
    """Checked targets of one arm."""

    objective: Objective
    schedule: Schedule
    pointwise: Array | None  # distances of the pointwise optimum (n,), where available

    def targets(self, limits: MotionLimits) -> Targets:
        """Targets at the n waypoints, for the arm with the margin of its limits."""
        return self.schedule.targets(replace(self.objective, arm=limits.arm))


def _tasks(
    arms: Arm | ArmGroup,
    settings: PlanControl,
    time: ArrayLike,
    spec: EllipsoidSpec,
    damping: Damping,
    arrays: Sequence[Any],
) -> list[_Task]:
    """Check the targets of each arm."""
    group = as_group(arms)
    names = "profiles", "paths", "weights", "rotations", "pointwise_bests"
    columns = [
        (value,) if isinstance(arms, Arm) else of_each(value, name, len(group))
        for name, value in zip(names, arrays, strict=True)
    ]
    tasks = []
    for arm, own, (profile, path, weights, rotations, pointwise) in zip(
        group.arms, group.specs(spec), zip(*columns, strict=True), strict=True
    ):
        objective = Objective.of(arm, own, damping, EXACT_WEIGHT, positive=True)
        objective = objective.keeping(settings.orientation_axes, settings.orientation_weight)
        schedule = Schedule.checked(objective, profile, time, path, weights, rotations)
        best = None if pointwise is None else as_finite(pointwise, "pointwise_bests").copy()
        require_rows(len(schedule), pointwise_bests=(best, ()))
        tasks.append(_Task(objective, schedule, best))
    if len({task.schedule.positions is None for task in tasks}) > 1:
        raise InvalidInputError("paths must be of all arms or of none")
    require_few(np.ptp(tasks[0].schedule.time) / settings.speed_scale * settings.rate)
    return tasks


def of_each(value: Sequence[Any] | None, name: str, count: int) -> Sequence[Any]:
    """Require one value for each of `count` arms, or none."""
    if value is None:
        return (None,) * count
    if not hasattr(value, "__len__") or len(value) != count:
        size = f"{len(value)} of them" if hasattr(value, "__len__") else type(value).__name__
        raise InvalidInputError(f"{name} must be a sequence of {count}, one for each arm of the group; found {size}")
    return value


@dataclass(frozen=True)
class _Plan:
    """Tasks of all arms, and what plans them."""

    settings: PlanControl  # resolved
    tasks: list[_Task]
    planner: Planner
    costs: tuple[Cost, ...]
    relative: bool

    def motion(self, generator: np.random.Generator, progress: Part) -> "_Motion":
        """Plan each arm by itself, then all of them together."""
        settings, effort, count = self.settings, as_effort(self.settings.planning_effort), len(self.tasks)
        tolerance, scale, rate = settings.position_tolerance, settings.speed_scale, settings.rate
        problem, rows = self.problem()
        parts, pointwise = [], []
        for i, (own, random, part) in enumerate(
            zip(self.planner.arms, copies(generator, count), pieces(progress, *count * [1.0]), strict=True)
        ):
            costs = self.costs if count == 1 else ()
            alone = MotionProblem(problem.time, problem.targets[i : i + 1], own.limits, own.collisions, costs)
            q = own.plan(alone, max(1.0 / scale, PLANNING_TIME_SCALE), tolerance, effort, random, part)
            q, timed = time_parameterized(alone, scale, q, tolerance, rate, effort)
            parts.append(q)
            best = self.tasks[i].pointwise
            if best is None and not self.relative:
                best = _pointwise_distance(alone[rows], own.bank, replace(timed, at=timed.at[rows]).waypoints())
            pointwise.append(best)
        coupled = False
        if self.relative:
            problem = _relative(problem, self.planner.group)
        if count > 1:
            timed, coupled = coupled_motion(self.planner, problem, parts, scale, tolerance, rate, effort, generator)
        timed = replace(timed, at=timed.at[rows])
        if settings.home is not None:
            timed = with_approach(timed, self.planner.limits, settings.home)
        return _Motion(self, problem[rows], timed, coupled, pointwise)

    def problem(self) -> tuple[MotionProblem, NDArray[np.intp]]:
        """Return the problem of all arms with waypoints between distant ones, and the rows of the n waypoints."""
        gap, targets = 0.16 / max(1.0 / self.settings.speed_scale, PLANNING_TIME_SCALE), []
        for task, own in zip(self.tasks, self.planner.arms, strict=True):
            finer, rows = task.schedule.finer(task.objective, gap)
            targets.append(finer.targets(replace(task.objective, arm=own.limits.arm)))
        planner = self.planner
        return MotionProblem(finer.time, tuple(targets), planner.limits, planner.collisions, self.costs), rows


@dataclass(frozen=True)
class _Motion:
    """A planned and timed motion; `problem` has the n waypoints."""

    plan: _Plan
    problem: MotionProblem
    timed: Timed
    coupled: bool
    pointwise: list[Array | None]  # distances of the pointwise optimum of each arm (n,); None: not searched yet

    def evaluated(self) -> RobotMotion:
        """Compare the motion with its targets."""
        planner, timed, q = self.plan.planner, self.timed, self.timed.waypoints()
        best: list[Array] = self._relative_best(q) if self.plan.relative else self._improved_best(q)
        group, limits = planner.group, planner.limits
        trajectory = Trajectory(
            group.joint_names, group.joint_units, timed.at, q, timed.time, timed.positions, timed.velocities,
            timed.accelerations,
        )  # fmt: skip
        clearance = Clearance.of(planner.collisions, trajectory)
        arms = []
        for task, own, columns, pointwise in zip(self.plan.tasks, planner.arms, group.columns, best, strict=True):
            schedule, targets = task.schedule, task.targets(own.limits)
            arm = ArmMotion.of_motion(
                own.limits.arm,
                timed.at,
                schedule.ellipsoids,
                timed.time,
                timed.positions[:, columns],
                spec=targets.objective.spec,
                damping=targets.objective.damping,
                path=None if self.plan.relative else schedule.positions,
                velocity_limits=own.limits.velocity,
                control_velocities=timed.velocities[:, columns],
                control_accelerations=timed.accelerations[:, columns],
                position_tolerance=float(self.plan.settings.position_tolerance),
            )
            arms.append(replace(
                arm, orientation_error=targets.axis_angles(arm.joint_positions), demonstrated_time=schedule.time,
                limits=own.limits, pointwise_best=pointwise, clearance=clearance,
            ))  # fmt: skip
        vectors = [cost for cost in self.problem.costs if isinstance(cost, RelativePositionCost)]
        return RobotMotion(
            group,
            trajectory,
            tuple(arms),
            limits,
            limits.use(timed.time, timed.positions),
            clearance,
            self.coupled,
            np.stack([cost.at(self.problem.time) for cost in vectors], axis=1) if self.plan.relative else None,
            np.stack([cost.error(q, self.problem.time) for cost in vectors], axis=1) if self.plan.relative else None,
        )

    def _improved_best(self, q: Array) -> list[Array]:
        """Pointwise optima of each arm, also searched from a motion that was optimized for all arms."""
        best = [pointwise for pointwise in self.pointwise if pointwise is not None]
        rows = evenly_spaced(len(q), POINTWISE_POINTS)
        for i, (task, columns) in enumerate(zip(self.plan.tasks, self.plan.planner.group.columns, strict=True)):
            if self.coupled and task.pointwise is None:
                found = improved_from(replace(self.problem.targets[i][rows], rotations=None), q[rows][:, columns])
                best[i] = interpolated_distance(rows, np.minimum(best[i][rows], found.distance), len(q))
        return best

    def _relative_best(self, q: Array) -> list[Array]:
        """Pointwise optima, in sum of squares of all arms, with the vectors between the end effectors."""
        rows, columns = evenly_spaced(len(q), POINTWISE_POINTS), self.plan.planner.group.columns
        problem = self.problem[rows]
        problem = replace(problem, targets=tuple(replace(own, rotations=None) for own in problem.targets))
        starts = np.empty((len(rows), STARTS, q.shape[1]))
        for own, targets, at in zip(self.plan.planner.arms, problem.targets, columns, strict=True):
            starts[..., at] = own.bank.starts_for(targets, STARTS)
        best = problem.distances(search_pointwise(problem, starts, [q[rows]]).joint_positions)
        return [interpolated_distance(rows, distance, len(q)) for distance in best]


def _relative(problem: MotionProblem, group: ArmGroup) -> MotionProblem:
    """Return the problem with the vectors from the first end effector to the others instead of all paths."""
    first, *others = (own.positions for own in problem.targets)
    vectors = [
        RelativePositionCost(group, (0, i), problem.time, positions - first)  # type: ignore[operator]
        for i, positions in enumerate(others, 1)
    ]
    targets = tuple(replace(own, positions=None) for own in problem.targets)
    return replace(problem, targets=targets, costs=(*problem.costs, *vectors))


def _pointwise_distance(problem: MotionProblem, bank: SeedBank, q: Array) -> Array:
    """Search the pointwise optimum (n,) of one arm, also from the configurations of a motion (n, dof)."""
    rows, (targets,) = evenly_spaced(len(problem), POINTWISE_POINTS), problem.targets
    distance = pointwise_best(replace(targets[rows], rotations=None), bank, q[rows]).distance
    return interpolated_distance(rows, distance, len(problem))
