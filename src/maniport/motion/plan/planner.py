"""The planner of one arm: reachability map, roadmap, graph search, optimizer, time parameterization.

Trajectories are optimized as if they took `planning_time_scale` times the demonstrated time, then timed, optimized with
the smoothness that this time demands, relaxed around large position errors, and timed again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.motion.configurations import Configurations
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.optimizer import (
    POSITION_WEIGHTS,
    TrajectoryCost,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
    relaxed,
    time_weights,
)
from maniport.motion.plan.plan_options import PlanOptions
from maniport.motion.plan.reachability_map import ReachabilityMap
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
from maniport.util.progress import ReportFraction, ignore_fraction
from maniport.util.validation import Array

PLANNING_TIME_SCALE = 4.0
SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses
SMOOTHNESS = 0.04
"""Factor of the smoothness costs [1/√s], which grow with the root of the demonstrated duration. Less smoothness is more
accurate, but the limits then slow the trajectory down: by about the same share, more seconds for a long recording."""


def planning_time_scale(options: PlanOptions) -> float:
    """Return how many times the demonstrated time a trajectory is planned for."""
    return max(1.0 / options.speed_scale, 1.0 if options.real_time else PLANNING_TIME_SCALE)


def planning_terms(time: Array, options: PlanOptions) -> tuple[Array, TrajectoryTerms, float]:
    """Return times on the planning time scale, terms of smoothness there, and the joint motion weight of the search."""
    planned = planning_time_scale(options) * (time - time[0])
    share = SMOOTHNESS * float(np.sqrt(planned[-1] / PLANNING_TIME_SCALE))
    # on two clips, three times this cost of jerk: 3 to 9 % larger distances; a tenth of it: 20 to 26 % longer motions
    terms = TrajectoryTerms(share * 0.12, share * 1.2e-3, rel_tol=options.budget.rel_tol)
    return planned, terms, share * JOINT_MOTION_WEIGHT


def coarse_terms(
    problem: MotionProblem, options: PlanOptions
) -> tuple[Array, TrajectoryTerms, float]:
    """Return the same with the limits and collisions of a problem."""
    time, terms, joint_motion_weight = planning_terms(problem.time, options)
    velocity = SPEED_SHARE * problem.limits.velocity
    terms = replace(terms, velocity=velocity, collisions=problem.collisions)
    return time, terms, joint_motion_weight


@dataclass(frozen=True)
class ArmPlanner:
    """One arm with its limits and samples."""

    limits: MotionLimits
    reachability_map: ReachabilityMap  # of `limits.arm`
    bank: SeedBank

    def solve(
        self,
        problem: MotionProblem,
        options: PlanOptions,
        random: np.random.Generator,
        progress: ReportFraction = ignore_fraction,
    ) -> tuple[Array, Trajectory]:
        """Plan a motion; return the configurations at the waypoints (n, dof), and the timed motion."""
        time, terms, joint_motion_weight = coarse_terms(problem, options)
        stages = stages_of(time, options.budget.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(problem[stages], int(more * options.budget.nodes), random)
        progress(0.4)
        path = self.search(nodes, time[stages], joint_motion_weight)
        progress(0.6)
        q = optimize(problem[stages], time[stages], nodes.q[path], terms, POSITION_WEIGHTS[0])
        q = interpolated(time[stages], q, time)
        starts = [q]
        if problem.start is not None:
            starts.append(problem.start)
        coarse_tolerance = 1e-3  # [m]; less than this is met with the time
        tolerance = max(options.position_tolerance, coarse_tolerance)
        optimized = []
        for start in starts:
            optimized.append(optimize_to_tolerance(problem, time, start, terms, tolerance))
        q = best_trajectory(problem, time, optimized, terms, tolerance)
        return time_parameterized(problem, q, options, options.position_tolerance)

    def roadmap(self, problem: MotionProblem, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        (arm,) = problem.arms
        if arm.target.positions is not None:
            nodes = self.reachability_map.nodes(arm, count, random)
        else:  # joints that do not change the ellipsoid are in their middle
            q = self.bank.starts_for(arm.target, count)
            idle = self.reachability_map.idle
            q[..., idle] = (0.5 * (self.limits.arm.lower + self.limits.arm.upper))[idle]
            stages, nodes_per_stage, dof = q.shape
            first = np.arange(stages + 1) * nodes_per_stage
            arm_at_nodes = arm[np.repeat(np.arange(stages), nodes_per_stage)]
            q = q.reshape(-1, dof)
            if arm.orientation is not None:
                q = turned_to_rotations(arm_at_nodes, q)
            nodes = Roadmap(q, arm_at_nodes.cost(q), first)
        time = np.repeat(problem.time, np.diff(nodes.first))
        at = Configurations(problem.robot, nodes.q, time)
        for cost in problem.costs:
            square = np.sum(cost.residual(at) ** 2, axis=1)
            nodes = replace(nodes, cost=nodes.cost + square)
        if self.limits.arm.chain.payload:
            nodes = self._without_overload(nodes, problem.time)
        if problem.collisions is None:
            return nodes
        return nodes.without(problem.collisions.collides(nodes.q))

    def _without_overload(self, nodes: Roadmap, time: Array) -> Roadmap:
        """Drop nodes at which a joint cannot hold the payload; an error where a stage has no others."""
        dynamics = self.limits.dynamics
        limits = self.limits
        assert dynamics is not None  # with a payload
        torques = np.abs(dynamics.gravity(nodes.q))
        shares = (torques / limits.effort).max(axis=1)
        least = np.minimum.reduceat(shares, nodes.first[:-1])
        if least.max() >= 1.0:
            stage = int(least.argmax())
            node = int(
                nodes.first[stage] + shares[nodes.first[stage] : nodes.first[stage + 1]].argmin()
            )
            joint = int((torques[node] / limits.effort).argmax())
            raise InvalidInputError(
                f"{limits.arm.name!r} cannot hold its payload on the path {time[stage] - time[0]:.2f} s after the "
                f"start; at best {limits.held_fault(joint, float(torques[node, joint]))}"
            )
        return nodes.without(shares >= 1.0)

    def search(self, nodes: Roadmap, time: Array, joint_motion_weight: float) -> NDArray[np.intp]:
        """Choose a node for each stage; larger changes from stage to stage than these are jumps."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([LARGEST_CHANGE[unit] for unit in self.limits.arm.joint_units])
        largest = np.minimum(SPEED_SHARE * self.limits.velocity * gaps, largest)
        return shortest_path(nodes, time, largest, joint_motion_weight)


def best_trajectory(
    problem: MotionProblem,
    time: Array,
    trajectories: Sequence[Array],
    terms: TrajectoryTerms,
    tolerance: float,
) -> Array:
    """Return the trajectory (n, dof) whose position error is within the tolerance and whose other costs are lowest."""
    free = problem.with_position_weight(0.0)
    cost = TrajectoryCost(problem.robot, free, time, terms)
    ranks = []
    for q in trajectories:
        errors = problem.position_errors(q)
        reached = 0.0
        if errors is not None:
            reached = float(np.percentile(errors, 95.0, axis=0).max())
        ranks.append((max(reached, tolerance), cost.evaluate(q)[0]))
    return trajectories[ranks.index(min(ranks))]


def as_early_as_possible(problem: MotionProblem, q: Array, options: PlanOptions) -> Trajectory:
    """Time a trajectory (n, dof) within the limits, no faster than the speed scale allows."""
    earliest = (problem.time - problem.time[0]) / options.speed_scale
    return retime(problem.limits, earliest, q, rate=options.rate)


def time_parameterized(
    problem: MotionProblem, q: Array, options: PlanOptions, tolerance: float
) -> tuple[Array, Trajectory]:
    """Time a trajectory, optimize it with the smoothness that this time demands, relax it, and time it again."""
    time = as_early_as_possible(problem, q, options).time
    limits = problem.limits
    collisions = problem.collisions
    weights = time_weights(problem.time) * np.ptp(time) / np.ptp(problem.time)
    speeds = SPEED_SHARE * limits.velocity
    accelerations = SPEED_SHARE * limits.acceleration
    terms = TrajectoryTerms(
        3e-3, 1e-6, weights, speeds, accelerations, collisions, options.budget.rel_tol
    )
    q = optimize_to_tolerance(problem, time, q, terms, tolerance)
    timed = as_early_as_possible(problem, q, options)
    other = relaxed(problem, time, q, terms, tolerance)
    if other is q:
        return q, timed
    other_timed = as_early_as_possible(problem, other, options)
    if collisions is not None:
        before, after = (
            collisions.collides(motion.control_positions).mean() for motion in (timed, other_timed)
        )
        if after > before:
            return q, timed
    return other, other_timed
