"""The planner of a group of arms: each is planned by itself, then all together where they interact."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_compatible, require_trackable
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    CLEARANCE_WEIGHT,
    POSITION_WEIGHTS,
    TrajectoryCost,
    optimize,
    optimize_to_tolerance,
)
from maniport.motion.plan.plan_options import PlanOptions
from maniport.motion.plan.planner import (
    ArmPlanner,
    as_early_as_possible,
    limited_planning_terms,
    time_parameterized,
)
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.roadmap import stages_of
from maniport.motion.problem import ArmProblem, MotionProblem
from maniport.motion.search import SeedBank
from maniport.motion.trajectory import Trajectory, interpolated
from maniport.util.progress import ReportFraction, ignore_fraction, pieces
from maniport.util.validation import Array, as_generator


class GroupMotion(NamedTuple):
    """A motion of all joints of a group, as fast as limits and demonstration allow."""

    trajectory: Trajectory
    coupled: bool  # whether the arms were optimized together


@dataclass(frozen=True)
class Planner:
    """An arm or a group of arms with limits, samples and collision model, for any number of plans.

    Attributes
    ----------
    limits : MotionLimits
        ``limits.arm`` has the margin of the limits.
    spec : EllipsoidSpec
        Which ellipsoids, of each arm.
    arms : tuple of ArmPlanner
        Each arm with all joints that move it: ``limits``, ``reachability_map`` and ``bank``.
    collisions : Collisions, optional
        Of all arms with themselves, with each other and with obstacles.
    """

    limits: MotionLimits
    spec: EllipsoidSpec
    arms: tuple[ArmPlanner, ...]
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls,
        limits: MotionLimits,
        spec: EllipsoidSpec,
        collisions: Collisions | bool = True,
        random_state: int | np.random.Generator | None = 0,
    ) -> "Planner":
        """Sample the arms within their limits, each with the same seed; ``collisions=True``: self-collisions."""
        group = as_group(limits.arm)
        model = as_collisions(collisions, limits.arm)
        models: Sequence[Collisions | None] = (None,) * len(group)
        if model is not None:
            models = model.of_arms
        generators = _copies(as_generator(random_state), len(group))
        arms = []
        for arm, columns, arm_spec, arm_model, random in zip(
            group.arms, group.columns, group.specs(spec), models, generators, strict=True
        ):
            require_trackable(arm, arm_spec)
            samples = ReachabilityMap(arm, arm_spec, random_state=random, collisions=arm_model)
            bank = SeedBank(arm, random_state=random, spec=arm_spec)
            arms.append(ArmPlanner(limits.of_joints(arm, columns), samples, bank))
        return cls(limits, spec, tuple(arms), model)

    @property
    def group(self) -> ArmGroup:
        """All arms, with the margin of their limits."""
        return as_group(self.limits.arm)

    def require_fits(self, robot: Arm | ArmGroup, specs: Sequence[EllipsoidSpec]) -> None:
        """Raise InvalidInputError unless this plans for such arms, within limits of their own, and their ellipsoids."""
        arms = as_group(robot).arms
        if len(self.arms) != len(arms):
            raise InvalidInputError(
                f"the planner was made for {len(self.arms)} arms; found {len(arms)}"
            )
        for planner, arm, spec in zip(self.arms, arms, specs, strict=True):
            pair = (planner.limits.arm, arm)
            require_compatible("the planner was made for", pair, (planner.bank.spec, spec))

    def solve(
        self,
        problem: MotionProblem,
        options: PlanOptions,
        random_state: int | np.random.Generator | None = 0,
        progress: ReportFraction = ignore_fraction,
        separate: Sequence[ArmProblem] | None = None,
    ) -> GroupMotion:
        """Plan the motion of a problem of all arms: each by itself, then together where they interact.

        `separate` are problems of each arm while it is planned by itself; default: those of the problem.
        """
        count = len(self.arms)
        random = as_generator(random_state)
        motions = []
        for planner, arm_problem, columns, generator, arm_progress in zip(
            self.arms,
            separate or problem.arms,
            self.group.columns,
            _copies(random, count),
            pieces(progress, *count * [1.0]),
            strict=True,
        ):
            separate_problem = replace(
                problem,
                arms=(arm_problem,),
                limits=planner.limits,
                collisions=planner.reachability_map.collisions,
                costs=problem.costs if count == 1 else (),
                start=None if problem.start is None else problem.start[:, columns],
            )
            timed = planner.solve(separate_problem, options, generator, arm_progress)
            motions.append(timed.joint_positions)
        if count == 1:
            return GroupMotion(timed.trajectory, coupled=False)
        return self._joined(problem, motions, options, random)

    def _joined(
        self,
        problem: MotionProblem,
        motions: Sequence[Array],
        options: PlanOptions,
        random: np.random.Generator,
    ) -> GroupMotion:
        """Join the motions of all arms, shapes (n, dof of the arm); optimize them together where they interact."""
        group = self.group
        collisions = problem.collisions
        starts = _joint_starts(group, motions)
        if not (group.shared or problem.costs or _are_near(collisions, starts[0])):
            trajectory = as_early_as_possible(problem, starts[0], options)
            return GroupMotion(trajectory, coupled=False)
        time, terms, _ = limited_planning_terms(problem, options)
        optimized = list[Array]()
        cost = TrajectoryCost(problem.robot, problem, time, terms)

        def attempts() -> Iterator[tuple[float, list[Array]]]:
            """Yield factors of the position tolerance, and motions (n, dof) that are further starts."""
            yield 1.0, starts
            has_paths = all(arm.position is not None for arm in problem.arms)
            if has_paths and not group.shared and collisions is not None:
                yield 1.0, self._prioritized(problem, motions, options, random)
            yield 3.0, []
            yield np.inf, []

        for factor, more in attempts():
            tolerance = factor * options.position_tolerance
            for q in more:
                optimized.append(optimize(problem, time, q, terms, POSITION_WEIGHTS[0]))
            best = min(optimized, key=lambda q: cost.evaluate(q)[0])
            q = optimize_to_tolerance(problem, time, best, terms, tolerance)
            trajectory = time_parameterized(problem, q, options, tolerance).trajectory
            if collisions is None or not collisions.collides(trajectory.control_positions).any():
                break
        return GroupMotion(trajectory, coupled=True)

    def _prioritized(
        self,
        problem: MotionProblem,
        separate: Sequence[Array],
        options: PlanOptions,
        random: np.random.Generator,
    ) -> list[Array]:
        """Return motions (n, dof) by prioritized planning: each arm in turn is the first to avoid the others."""
        group = self.group
        collisions = problem.collisions
        motions = []
        assert collisions is not None
        time, _, joint_motion_weight = limited_planning_terms(problem, options)
        rows = stages_of(time, options.budget.stage)
        for first in reversed(range(len(separate))):
            of_arms = list(separate)
            order = [first, *(k for k in range(len(separate)) if k != first)]
            for i in order:
                arm = self.arms[i]
                arm_problem = replace(
                    problem[rows],
                    arms=(problem.arms[i][rows],),
                    costs=(),
                    collisions=arm.reachability_map.collisions,
                )
                nodes = arm.roadmap(arm_problem, 150, random)
                q = np.empty((len(nodes.q), group.dof))
                for motion, columns in zip(of_arms, group.columns, strict=True):
                    q[:, columns] = np.repeat(motion[rows], np.diff(nodes.first), axis=0)
                q[:, group.columns[i]] = nodes.q
                cost = nodes.cost.copy()  # more near the other arms, which keep their motions
                near, distance, _ = collisions.between.gradient(q, CLEARANCE)
                np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
                path = arm.search(replace(nodes, cost=cost), time[rows], joint_motion_weight)
                of_arms[i] = interpolated(time[rows], nodes.q[path], time)
            motions.append(group.joined(*of_arms))
        return motions


def _joint_starts(group: ArmGroup, motions: Sequence[Array]) -> list[Array]:
    """Return motions (n, dof) of a group, from those (n, dof of the arm) of its arms.

    In the first one, shared joints are the mean of all arms; in the others, if any, those of one arm.
    """
    values = np.full((len(motions), len(motions[0]), group.dof), np.nan)
    for motion, columns, of_group in zip(motions, group.columns, values, strict=True):
        of_group[:, columns] = motion
    mean = np.nanmean(values, axis=0)
    starts = [mean]
    if group.shared:
        for of_group in values:
            starts.append(np.where(np.isnan(of_group), mean, of_group))
    return starts


def _are_near(collisions: Collisions | None, q: Array) -> bool:
    """Return whether arms come nearer to each other than the clearance at any q (n, dof)."""
    if collisions is None or not collisions.between.checked:
        return False
    return bool(np.any(collisions.between.clearance(q) < CLEARANCE))


def _copies(generator: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Return a generator for each arm, all in the same state; the last is the original."""
    copies = [deepcopy(generator) for _ in range(count - 1)]
    return [*copies, generator]
