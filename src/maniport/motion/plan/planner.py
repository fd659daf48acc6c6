"""The planner: reachability map, roadmap, graph search, optimizer, time parameterization.

Each arm is planned by itself in these five steps, then all arms together where they interact. Trajectories are
optimized as if they took `PLANNING_TIME_SCALE` times the demonstrated time, then timed, optimized with the smoothness
that this time demands, and timed again.
"""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_compatible, require_trackable
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    CLEARANCE_WEIGHT,
    POSITION_WEIGHTS,
    TrajectoryCost,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
)
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.relaxation import SPEED_SHARE, time_parameterized
from maniport.motion.plan.roadmap import (
    JOINT_MOTION_WEIGHT,
    LARGEST_CHANGE,
    Roadmap,
    shortest_path,
    stages_of,
    turned_to_rotations,
)
from maniport.motion.plan.time_parameterization import retime
from maniport.motion.problem import MotionProblem
from maniport.motion.search import SeedBank
from maniport.motion.trajectory import Trajectory, interpolated
from maniport.util.progress import Part, ignore_fraction, pieces
from maniport.util.validation import Array, as_generator

PLANNING_TIME_SCALE = 4.0
SMOOTHNESS = 0.04
"""Factor of the smoothness costs [1/√s], which grow with the root of the demonstrated duration. Less smoothness is more
accurate, but the limits then slow the trajectory down: by about the same share, more seconds for a long recording."""


def planning_time_scale(settings: PlanSettings) -> float:
    """Return how many times the demonstrated time a trajectory is planned for."""
    return max(1.0 / settings.speed_scale, PLANNING_TIME_SCALE)


def coarse_terms(problem: MotionProblem, settings: PlanSettings) -> tuple[Array, TrajectoryTerms, float]:
    """Return times of the waypoints and terms on the planning time scale, and the joint motion weight of the search."""
    time = planning_time_scale(settings) * (problem.time - problem.time[0])
    share = SMOOTHNESS * float(np.sqrt((time[-1] - time[0]) / PLANNING_TIME_SCALE))
    speeds, tolerance = SPEED_SHARE * problem.limits.velocity, settings.budget.rel_tol
    terms = TrajectoryTerms(
        share * 0.12, share * 4e-3, velocity=speeds, collisions=problem.collisions, rel_tol=tolerance
    )
    return time, terms, share * JOINT_MOTION_WEIGHT


@dataclass(frozen=True)
class ArmPlanner:
    """One arm with its limits and samples."""

    limits: MotionLimits
    reachability_map: ReachabilityMap  # of `limits.arm`
    bank: SeedBank

    def solve(
        self,
        problem: MotionProblem,
        settings: PlanSettings,
        random: np.random.Generator,
        progress: Part = ignore_fraction,
    ) -> tuple[Array, Trajectory]:
        """Plan a motion; return the configurations at the waypoints (n, dof), and the timed motion."""
        time, terms, joint_motion_weight = coarse_terms(problem, settings)
        stages = stages_of(time, settings.budget.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(problem[stages], int(more * settings.budget.nodes), random)
        progress(0.4)
        path = self.search(nodes, time[stages], joint_motion_weight)
        progress(0.6)
        q = optimize(problem[stages], time[stages], nodes.q[path], terms, POSITION_WEIGHTS[0])
        q, coarse_tolerance = interpolated(time[stages], q, time), 1e-3  # [m]; less than this is met with the time
        q = optimize_to_tolerance(problem, time, q, terms, max(settings.position_tolerance, coarse_tolerance))
        return time_parameterized(problem, q, settings, settings.position_tolerance)

    def roadmap(self, problem: MotionProblem, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        (targets,) = problem.targets
        if targets.positions is not None:
            nodes = self.reachability_map.nodes(targets, count, random)
        else:  # joints that do not change the ellipsoid are in their middle
            q, idle = self.bank.starts_for(targets, count), self.reachability_map.idle
            q[..., idle] = (0.5 * (self.limits.lower + self.limits.upper))[idle]
            first, own = np.arange(len(q) + 1) * q.shape[1], targets[np.repeat(np.arange(len(q)), q.shape[1])]
            q = q.reshape(-1, q.shape[-1])
            q = q if targets.orientation is None else turned_to_rotations(own, q)
            nodes = Roadmap(q, own.cost(q), first)
        time = np.repeat(problem.time, np.diff(nodes.first))
        for cost in problem.costs:
            nodes = replace(nodes, cost=nodes.cost + np.sum(cost.residual(nodes.q, time) ** 2, axis=1))
        return nodes if problem.collisions is None else nodes.without(problem.collisions.collides(nodes.q))

    def search(self, nodes: Roadmap, time: Array, joint_motion_weight: float) -> NDArray[np.intp]:
        """Choose a node for each stage; larger changes from stage to stage than these are jumps."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([LARGEST_CHANGE[unit] for unit in self.limits.arm.joint_units])
        largest = np.minimum(SPEED_SHARE * self.limits.velocity * gaps, largest)
        return shortest_path(nodes, time, largest, joint_motion_weight)


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
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool = True, random_state: Any = 0
    ) -> "Planner":
        """Sample the arms within their limits, each with the same seed; ``collisions=True``: self-collisions."""
        group, model = as_group(limits.arm), as_collisions(collisions, limits.arm)
        alone = (None,) * len(group) if model is None else model.of_arms
        generators, arms = _copies(as_generator(random_state), len(group)), []
        for arm, columns, own, around, random in zip(
            group.arms, group.columns, group.specs(spec), alone, generators, strict=True
        ):
            require_trackable(arm, own)
            samples = ReachabilityMap(arm, own, random_state=random, collisions=around)
            bank = SeedBank(arm, random_state=random, spec=own)
            arms.append(ArmPlanner(limits.of_joints(arm, columns), samples, bank))
        return cls(limits, spec, tuple(arms), model)

    @property
    def group(self) -> ArmGroup:
        """All arms, with the margin of their limits."""
        return as_group(self.limits.arm)

    def require_fits(self, arm: Arm | ArmGroup, spec: EllipsoidSpec) -> None:
        """Raise InvalidInputError unless this plans for such arms, within limits of their own, and `spec`."""
        own, other = self.group.arms, as_group(arm).arms
        if len(own) != len(other):
            raise InvalidInputError(f"the planner was made for {len(own)} arms; found {len(other)}")
        for pair in zip(own, other, strict=True):
            require_compatible("the planner was made for", pair, (self.spec, spec))

    def solve(
        self,
        problem: MotionProblem,
        settings: PlanSettings,
        random_state: Any = 0,
        progress: Part = ignore_fraction,
        separate: Sequence[Targets] | None = None,
    ) -> tuple[Trajectory, bool]:
        """Return a motion, as fast as limits and demonstration allow, and whether arms were optimized together.

        `separate` are targets of each arm while it is planned by itself; default: those of the problem.
        """
        count, random = len(self.arms), as_generator(random_state)
        parts, shares = [], zip(self.arms, separate or problem.targets, _copies(random, count), strict=True)
        for (arm, targets, own), part in zip(shares, pieces(progress, *count * [1.0]), strict=True):
            costs, around = problem.costs if count == 1 else (), arm.reachability_map.collisions
            alone = replace(problem, targets=(targets,), limits=arm.limits, collisions=around, costs=costs)
            q, timed = arm.solve(alone, settings, own, part)
            parts.append(q)
        return (timed, False) if count == 1 else self._joined(problem, parts, settings, random)

    def _joined(
        self, problem: MotionProblem, parts: Sequence[Array], settings: PlanSettings, random: np.random.Generator
    ) -> tuple[Trajectory, bool]:
        """Join the motions of all arms, shapes (n, dof of the arm); optimize them together where they interact.

        Where the result collides, motions of prioritized planning are further starts, then tolerances are larger.
        """
        group, collisions = self.group, problem.collisions
        values = np.full((len(parts), len(parts[0]), group.dof), np.nan)
        for part, columns, own in zip(parts, group.columns, values, strict=True):
            own[:, columns] = part
        mean = np.nanmean(values, axis=0)  # shared joints are the mean of all arms, or those of one arm
        starts = [mean, *(np.where(np.isnan(own), mean, own) for own in values)] if group.shared else [mean]
        near = collisions is not None and collisions.between.checked
        near = near and bool(np.any(collisions.between.clearance(mean) < CLEARANCE))  # type: ignore[union-attr]
        if not (group.shared or problem.costs or near):
            earliest = 1.0 / settings.speed_scale * (problem.time - problem.time[0])
            return retime(problem.limits, earliest, mean, rate=settings.rate), False
        time, terms, _ = coarse_terms(problem, settings)
        optimized, cost = list[Array](), TrajectoryCost(problem.arm, problem, time, terms)

        def attempts() -> Iterator[tuple[float, list[Array]]]:
            """Factors of the position tolerance, and further starts."""
            yield 1.0, starts
            has_paths = all(own.positions is not None for own in problem.targets)
            if has_paths and not group.shared and collisions is not None:
                yield 1.0, self._prioritized(problem, parts, settings, random)
            yield 3.0, []
            yield np.inf, []

        for factor, more in attempts():
            tolerance = factor * settings.position_tolerance
            optimized += [optimize(problem, time, q, terms, POSITION_WEIGHTS[0]) for q in more]
            best = min(optimized, key=lambda q: cost.evaluate(q)[0])
            q = optimize_to_tolerance(problem, time, best, terms, tolerance)
            timed = time_parameterized(problem, q, settings, tolerance)[1]
            if collisions is None or not collisions.collides(timed.control_positions).any():
                break
        return timed, True

    def _prioritized(
        self, problem: MotionProblem, parts: Sequence[Array], settings: PlanSettings, random: np.random.Generator
    ) -> list[Array]:
        """Motions (n, dof) by prioritized planning, in which each arm in turn is the first to avoid the others.

        An arm moves through a roadmap whose nodes cost more near the other arms, which keep their motions.
        """
        group, collisions, motions = self.group, problem.collisions, []
        assert collisions is not None
        time, _, joint_motion_weight = coarse_terms(problem, settings)
        rows = stages_of(time, settings.budget.stage)
        for first in reversed(range(len(parts))):
            own = list(parts)
            for i in (first, *(k for k in range(len(parts)) if k != first)):
                arm = self.arms[i]
                targets, around = (problem.targets[i][rows],), arm.reachability_map.collisions
                alone = replace(problem[rows], targets=targets, costs=(), collisions=around)
                nodes = arm.roadmap(alone, 150, random)
                q = np.empty((len(nodes.q), group.dof))
                for part, columns in zip(own, group.columns, strict=True):
                    q[:, columns] = np.repeat(part[rows], np.diff(nodes.first), axis=0)
                q[:, group.columns[i]] = nodes.q
                cost = nodes.cost.copy()
                near, distance, _ = collisions.between.gradient(q, CLEARANCE)
                np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
                path = arm.search(replace(nodes, cost=cost), time[rows], joint_motion_weight)
                own[i] = interpolated(time[rows], nodes.q[path], time)
            motions.append(group.joined(*own))
        return motions


def _copies(generator: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Return a generator for each arm, all in the same state; the last is the original."""
    return [*(deepcopy(generator) for _ in range(count - 1)), generator]
