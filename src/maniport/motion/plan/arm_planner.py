"""The planner of one arm: reachability map, roadmap, graph search, optimizer, time parameterization."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import EllipsoidSpec
from maniport.arms.collisions import Collisions
from maniport.motion.arm_model import require_trackable
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.plan.optimizer import POSITION_WEIGHTS, optimize, optimize_to_tolerance
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.refinement import (
    SPEED_SHARE,
    coarse_terms,
    joint_motion_weight,
    planning_time,
    time_parameterized,
)
from maniport.motion.plan.roadmap import Roadmap, shortest_path, stages_of, turned_to_rotations
from maniport.motion.plan.time_parameterization import Timed
from maniport.motion.problem import MotionProblem
from maniport.motion.search.seed_bank import SeedBank
from maniport.motion.trajectory import interpolated
from maniport.util.progress import Part, nobody
from maniport.util.validation import Array


@dataclass(frozen=True)
class ArmPlanner:
    """One arm with its limits, samples and collision model."""

    limits: MotionLimits
    reachability_map: ReachabilityMap  # of `limits.arm`
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

    def solve(
        self, problem: MotionProblem, settings: PlanControl, random: np.random.Generator, progress: Part = nobody
    ) -> tuple[Array, Timed]:
        """Plan a motion; return the configurations at the waypoints (n, dof), and the timed motion."""
        time, tolerance = planning_time(problem, settings), settings.position_tolerance
        stages = stages_of(time, settings.budget.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(problem[stages], int(more * settings.budget.nodes), random)
        progress(0.4)
        weight, largest = joint_motion_weight(time), self.largest_changes(time[stages])
        q = nodes.q[shortest_path(nodes, time[stages], largest, weight)]
        progress(0.6)
        terms = coarse_terms(problem, time, settings)
        q = optimize(problem[stages], time[stages], q, terms, POSITION_WEIGHTS[0])
        q = interpolated(time[stages], q, time)
        coarse_tolerance = 1e-3  # [m]; a smaller one is met after the time parameterization
        q, _ = optimize_to_tolerance(problem, time, q, terms, max(tolerance, coarse_tolerance))
        return time_parameterized(problem, q, settings, tolerance)

    def roadmap(self, problem: MotionProblem, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        (targets,) = problem.targets
        if targets.positions is not None:
            nodes = self.reachability_map.nodes(targets, count, random)
        else:
            nodes = self._similar_ellipsoids(targets, count)
        if problem.costs:
            time = np.repeat(problem.time, np.diff(nodes.first))
            squares = [np.sum(cost.residual(nodes.q, time) ** 2, axis=1) for cost in problem.costs]
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
