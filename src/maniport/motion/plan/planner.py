"""The planner of one arm: reachability map, roadmap, graph search, optimizer, time parameterization.

Trajectories are optimized as if they took `planning_time_scale` times the demonstrated time, then timed, optimized with
the smoothness that this time demands, relaxed around large position errors, and timed again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

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

PLANNED_VELOCITY_COST = 0.12  # λ_v of a trajectory before it is timed, relative to its smoothness
PLANNED_JERK_COST = 1.2e-3
"""λ_j of a trajectory before it is timed, relative to its smoothness. On two clips, three times as much makes distances
3 to 9 % larger, and a tenth of it motions 20 to 26 % longer."""
TIMED_VELOCITY_COST = 3e-3  # λ_v of a trajectory that is timed [s²/rad²]
TIMED_JERK_COST = 1e-6  # λ_j of a trajectory that is timed [s⁶/rad²]
COARSE_TOLERANCE = (
    1e-3  # Position tolerance before a trajectory is timed [m]; less is met afterwards
)


class PlanningTerms(NamedTuple):
    """Times and terms with which a trajectory is planned before it is timed."""

    time: Array  # (n,), of the waypoints, from 0 s, on the planning time scale
    trajectory: TrajectoryTerms
    joint_motion_weight: float  # of squared joint velocities in the graph search, relative to d²


class TimedMotion(NamedTuple):
    """Joint positions of a plan and the trajectory that passes them."""

    joint_positions: Array  # (n, dof), at the waypoints [rad or m]
    trajectory: Trajectory


def planning_time_scale(options: PlanOptions) -> float:
    """Return how many times the demonstrated time a trajectory is planned for."""
    return max(1.0 / options.speed_scale, 1.0 if options.real_time else PLANNING_TIME_SCALE)


def planning_terms(time: Array, options: PlanOptions) -> PlanningTerms:
    """Return times and terms of smoothness for demonstrated times (n,) [s], without limits and collisions."""
    planned = planning_time_scale(options) * (time - time[0])
    smoothness = SMOOTHNESS * float(np.sqrt(planned[-1] / PLANNING_TIME_SCALE))
    terms = TrajectoryTerms(
        velocity_cost=smoothness * PLANNED_VELOCITY_COST,
        jerk_cost=smoothness * PLANNED_JERK_COST,
        rel_tol=options.budget.rel_tol,
    )
    return PlanningTerms(planned, terms, smoothness * JOINT_MOTION_WEIGHT)


def limited_planning_terms(problem: MotionProblem, options: PlanOptions) -> PlanningTerms:
    """Return the planning terms of a problem, with its velocity limits and collisions."""
    terms = planning_terms(problem.time, options)
    trajectory_terms = replace(
        terms.trajectory,
        velocity=SPEED_SHARE * problem.limits.velocity,
        collisions=problem.collisions,
    )
    return terms._replace(trajectory=trajectory_terms)


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
    ) -> TimedMotion:
        """Plan the motion of a problem of this arm: roadmap, graph search, optimizer, time parameterization."""
        time, terms, joint_motion_weight = limited_planning_terms(problem, options)
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
        tolerance = max(options.position_tolerance, COARSE_TOLERANCE)
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
        """Drop nodes at which a joint cannot hold the payload; raise where a stage has no others."""
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
        """Return the node of each stage with the least cost and joint motion, shape (stages,).

        `time` (stages,) [s] and the velocity limits determine which change of a joint between two stages is a jump.
        """
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
) -> TimedMotion:
    """Time a trajectory (n, dof), optimize it with the smoothness that this time demands, relax it, time it again.

    The position tolerance is in m. Where the relaxed trajectory collides more than the other one, the other is taken.
    """
    time = as_early_as_possible(problem, q, options).time
    limits = problem.limits
    collisions = problem.collisions
    weights = time_weights(problem.time) * np.ptp(time) / np.ptp(problem.time)
    terms = TrajectoryTerms(
        velocity_cost=TIMED_VELOCITY_COST,
        jerk_cost=TIMED_JERK_COST,
        weights=weights,
        velocity=SPEED_SHARE * limits.velocity,
        acceleration=SPEED_SHARE * limits.acceleration,
        collisions=collisions,
        rel_tol=options.budget.rel_tol,
    )
    q = optimize_to_tolerance(problem, time, q, terms, tolerance)
    before = TimedMotion(q, as_early_as_possible(problem, q, options))

    q_relaxed = relaxed(problem, time, q, terms, tolerance)
    if q_relaxed is q:
        return before
    after = TimedMotion(q_relaxed, as_early_as_possible(problem, q_relaxed, options))
    if collisions is None:
        return after
    colliding_before = collisions.collides(before.trajectory.control_positions).mean()
    colliding_after = collisions.collides(after.trajectory.control_positions).mean()
    if colliding_after > colliding_before:
        return before
    return after
