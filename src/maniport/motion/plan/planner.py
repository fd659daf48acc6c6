"""The planner in five steps: reachability map, roadmap, graph search, optimizer, time parameterization."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, ArmGroup, EllipsoidSpec, as_group
from maniport.arms.collisions import Collisions, as_collisions
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import require_alike, require_trackable
from maniport.motion.effort import Effort
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.optimizer import (
    POSITION_WEIGHTS,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
    time_weights,
)
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.relaxation import relaxed
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, Roadmap, shortest_path, turned_to_rotations
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.problem import MotionProblem
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.validation import Array, as_generator

PLANNING_TIME_SCALE = 4.0
"""Trajectories are planned as if they took so many times the demonstrated time; time parameterization comes last."""
SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses


@dataclass(frozen=True)
class ArmPlanner:
    """One arm with its limits, samples and collision model.

    Attributes
    ----------
    limits : MotionLimits
    reachability_map : ReachabilityMap
        Reachability map of ``limits.arm``.
    bank : SeedBank
    collisions : Collisions, optional
    """

    limits: MotionLimits
    reachability_map: ReachabilityMap
    bank: SeedBank
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | None, random: np.random.Generator
    ) -> "ArmPlanner":
        """Sample the arm within its limits."""
        require_trackable(limits.arm, spec)
        reachability_map = ReachabilityMap(limits.arm, spec, random_state=random, collisions=collisions)
        return cls(limits, reachability_map, SeedBank.build(limits.arm, random_state=random, spec=spec), collisions)

    def plan(
        self,
        problem: MotionProblem,
        time_scale: float,
        tolerance: float,
        effort: Effort,
        random: np.random.Generator,
        progress: Callable[[float], None],
    ) -> Array:
        """Find configurations at all waypoints (n, dof), for a duration of `time_scale` times the demonstrated one."""
        time = time_scale * (problem.time - problem.time[0])
        stages = stages_of(time, effort.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(problem[stages], int(more * effort.nodes), random)
        progress(0.4)
        weight, largest = smoothness(time) * JOINT_MOTION_WEIGHT, self.largest_changes(time[stages])
        q = nodes.q[shortest_path(nodes, time[stages], largest, weight)]
        progress(0.6)
        terms = coarse_terms(problem, time, effort)
        q = optimize(problem[stages], time[stages], q, terms, POSITION_WEIGHTS[0])
        q = interpolated(time[stages], q, time)
        coarse_tolerance = 1e-3  # [m]; a smaller one is met after the time parameterization
        return optimize_to_tolerance(problem, time, q, terms, max(tolerance, coarse_tolerance))[0]

    def roadmap(self, problem: MotionProblem, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        (targets,) = problem.targets
        if targets.positions is not None:
            nodes = self.reachability_map.nodes(targets, count, random)
        else:
            nodes = self._similar_ellipsoids(targets, count)
        if problem.costs:
            owner = np.repeat(np.arange(len(targets)), np.diff(nodes.first))
            squares = [np.sum(cost.residual(nodes.q, problem.time[owner]) ** 2, axis=1) for cost in problem.costs]
            nodes = replace(nodes, cost=nodes.cost + sum(squares))
        return nodes if self.collisions is None else nodes.without(self.collisions.collides(nodes.q))

    def _similar_ellipsoids(self, targets: Targets, count: int) -> Roadmap:
        """Make nodes of samples with similar ellipsoids; joints that move none of them are in their middle."""
        q, idle = self.bank.starts_for(targets, count), self.reachability_map.idle
        q[..., idle] = (0.5 * (self.limits.lower + self.limits.upper))[idle]
        owner, first = np.repeat(np.arange(len(q)), q.shape[1]), np.arange(len(q) + 1) * q.shape[1]
        q = q.reshape(-1, q.shape[-1])
        q = turned_to_rotations(targets[owner], q) if targets.turned else q
        return Roadmap(q, targets[owner].cost(q), first)

    def largest_changes(self, time: Array) -> Array:
        """Largest joint changes from stage to stage at `time`, shape (stages, dof); larger ones are jumps."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([{"rad": 0.6, "m": 0.2}[unit] for unit in self.limits.arm.joint_units])
        return np.asarray(np.minimum(SPEED_SHARE * self.limits.velocity * gaps, largest))


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
        Each arm with all joints that move it.
    collisions : Collisions, optional
        Of all arms with themselves, with each other and with obstacles.
    """

    limits: MotionLimits
    spec: EllipsoidSpec
    arms: tuple[ArmPlanner, ...]
    collisions: Collisions | None = None

    @classmethod
    def of(
        cls, limits: MotionLimits, spec: EllipsoidSpec, collisions: Collisions | bool, random_state: Any = 0
    ) -> "Planner":
        """Sample the arms within their limits, each with the same seed; ``collisions=True``: self-collisions.

        Raises
        ------
        InvalidInputError
            When an arm has too few joints, or coupled ones.
        """
        group, model = as_group(limits.arm), as_collisions(collisions, limits.arm)
        alone = (None,) * len(group) if model is None else model.of_arms
        generators = copies(as_generator(random_state), len(group))
        parts = zip(group.arms, group.columns, group.specs(spec), alone, generators, strict=True)
        arms = tuple(
            ArmPlanner.of(limits.of_joints(arm, columns), own, around, random)
            for arm, columns, own, around, random in parts
        )
        return cls(limits, spec, arms, model)

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
            require_alike("the planner was made for", pair, (self.spec, spec), limits=False)


def copies(generator: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Return a generator for each arm, all in the same state; the last is the original."""
    return [*(deepcopy(generator) for _ in range(count - 1)), generator]


def smoothness(time: Array) -> float:
    """Factor of the smoothness costs for times (n,) on the planning time scale.

    Less smoothness is more accurate, but the limits then slow the trajectory down: by about the same share, which is
    more seconds for a long recording. The factor grows with the root of the demonstrated duration.
    """
    return 0.04 * float(np.sqrt((time[-1] - time[0]) / PLANNING_TIME_SCALE))


def coarse_terms(problem: MotionProblem, time: Array, effort: Effort) -> TrajectoryTerms:
    """Smoothness, limits and collisions of a trajectory on the planning time scale."""
    share = smoothness(time)
    return TrajectoryTerms(
        share * 0.12,
        share * 4e-3,
        velocity=SPEED_SHARE * problem.limits.velocity,
        collisions=problem.collisions,
        rel_tol=effort.rel_tol,
    )


def stages_of(time: Array, longest: float) -> NDArray[np.intp]:
    """Rows of waypoints at most `longest` [s] apart where the waypoints allow, the first and last included."""
    rows, last = [0], len(time) - 1
    for i in range(1, last + 1):
        if i == last or time[i + 1] - time[rows[-1]] > longest:
            rows.append(i)
    return np.array(rows)


def interpolated(known: NDArray[Any], q: Array, time: NDArray[Any]) -> Array:
    """Joint positions at times (n,), linear between those at known times (m,)."""
    return np.stack([np.interp(time, known, column) for column in q.T], axis=1)


def time_parameterized(
    problem: MotionProblem, speed_scale: float, q: Array, tolerance: float, rate: float, effort: Effort
) -> tuple[Array, Timed]:
    """Time a trajectory, optimize it with the smoothness that its time demands, and time it again.

    `tolerance` is that of the 95th percentile of the position error [m].
    """
    earliest = 1.0 / speed_scale * (problem.time - problem.time[0])
    limits, collisions = problem.limits, problem.collisions
    at = retime(limits, earliest, q, rate=rate).at
    terms = TrajectoryTerms(
        3e-3,
        1e-6,
        time_weights(earliest) * (at[-1] - at[0]) / (earliest[-1] - earliest[0]),
        SPEED_SHARE * limits.velocity,
        SPEED_SHARE * limits.acceleration,
        collisions,
        effort.rel_tol,
    )
    q, weight = optimize_to_tolerance(problem, at, q, terms, tolerance)
    timed = retime(limits, earliest, q, rate=rate)
    other = relaxed(problem, at, q, terms, weight, tolerance) if effort.relaxation else q
    if other is q:
        return q, timed
    other_timed = retime(limits, earliest, other, rate=rate)
    if colliding_share(collisions, other_timed) > colliding_share(collisions, timed):
        return q, timed
    return other, other_timed


def colliding_share(collisions: Collisions | None, timed: Timed) -> float:
    """Share of the samples that collide."""
    return 0.0 if collisions is None else float(collisions.collides(timed.positions).mean())
