"""The plan of one or several arms: each arm by itself, then all together, and the evaluation of the motion."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.arms import ArmGroup
from maniport.motion.arm_motion import ArmMotion
from maniport.motion.effort import as_effort
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Objective, Targets
from maniport.motion.plan.coupling import coupled_motion
from maniport.motion.plan.home_motion import with_approach
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.planner import PLANNING_TIME_SCALE, Planner, copies, time_parameterized
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.problem import Cost, MotionProblem, RelativePositionCost
from maniport.motion.robot_motion import RobotMotion
from maniport.motion.schedule import Schedule
from maniport.motion.search.descent import STARTS, improved_from, interpolated_distance, pointwise_best
from maniport.motion.search.seed_bank import SeedBank
from maniport.motion.trajectory import Clearance, Trajectory
from maniport.util.progress import Part, pieces
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

POINTWISE_POINTS = 250  # Most waypoints at which the pointwise optimum is searched


@dataclass(frozen=True)
class ArmTask:
    """Checked targets of one arm."""

    objective: Objective
    schedule: Schedule
    pointwise: Array | None  # distances of the pointwise optimum (n,), where available

    def targets(self, limits: MotionLimits) -> Targets:
        """Targets at the n waypoints, for the arm with the margin of its limits."""
        return self.schedule.targets(replace(self.objective, arm=limits.arm))


@dataclass(frozen=True)
class GroupPlan:
    """Tasks of all arms, and what plans them."""

    settings: PlanControl  # resolved
    tasks: list[ArmTask]
    planner: Planner
    costs: tuple[Cost, ...]
    relative: bool

    def motion(self, generator: np.random.Generator, progress: Part) -> "PlannedGroup":
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
        return PlannedGroup(self, problem[rows], timed, coupled, pointwise)

    def problem(self) -> tuple[MotionProblem, NDArray[np.intp]]:
        """Return the problem of all arms with waypoints between distant ones, and the rows of the n waypoints."""
        gap, targets = 0.16 / max(1.0 / self.settings.speed_scale, PLANNING_TIME_SCALE), []
        for task, own in zip(self.tasks, self.planner.arms, strict=True):
            finer, rows = task.schedule.finer(task.objective, gap)
            targets.append(finer.targets(replace(task.objective, arm=own.limits.arm)))
        planner = self.planner
        return MotionProblem(finer.time, tuple(targets), planner.limits, planner.collisions, self.costs), rows


@dataclass(frozen=True)
class PlannedGroup:
    """A planned and timed motion; `problem` has the n waypoints."""

    plan: GroupPlan
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
                found = improved_from(replace(self.problem.targets[i][rows], rotations=None), q[rows][:, None, columns])
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
        best = problem.distances(pointwise_best(problem, starts, q[rows]).joint_positions)
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
    rows = evenly_spaced(len(problem), POINTWISE_POINTS)
    targets = replace(problem.targets[0][rows], rotations=None)
    distance = pointwise_best(targets, bank.starts_for(targets, STARTS), q[rows]).distance
    return interpolated_distance(rows, distance, len(problem))
