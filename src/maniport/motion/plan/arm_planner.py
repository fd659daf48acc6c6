"""The planner of one arm: reachability map, roadmap, graph search, optimizer, time parameterization.

Trajectories are optimized as if they took `PLANNING_TIME_SCALE` times the demonstrated time, then timed, optimized with
the smoothness that this time demands, and timed again.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from maniport.arms.collisions import Collisions
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.optimizer import (
    CLEARANCE,
    POSITION_WEIGHTS,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
    time_weights,
)
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, Roadmap, shortest_path, stages_of, turned_to_rotations
from maniport.motion.plan.time_parameterization import retime
from maniport.motion.problem import MotionProblem
from maniport.motion.search import PathCost, SeedBank
from maniport.motion.trajectory import Trajectory, interpolated
from maniport.util.progress import Part, ignore_fraction
from maniport.util.validation import Array

PLANNING_TIME_SCALE = 4.0
SMOOTHNESS = 0.04
"""Factor of the smoothness costs [1/√s], which grow with the root of the demonstrated duration. Less smoothness is more
accurate, but the limits then slow the trajectory down: by about the same share, more seconds for a long recording."""
SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses
FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large


def planning_time_scale(settings: PlanSettings) -> float:
    """Return how many times the demonstrated time a trajectory is planned for."""
    return max(1.0 / settings.speed_scale, PLANNING_TIME_SCALE)


class Coarse(NamedTuple):
    """How a trajectory is planned on the planning time scale."""

    time: Array  # (n,), of the waypoints, from 0 [s]
    terms: TrajectoryTerms
    joint_motion_weight: float  # of the graph search

    @classmethod
    def of(cls, problem: MotionProblem, settings: PlanSettings) -> "Coarse":
        """Return times, smoothness, limits and collisions."""
        time = planning_time_scale(settings) * (problem.time - problem.time[0])
        share = SMOOTHNESS * float(np.sqrt((time[-1] - time[0]) / PLANNING_TIME_SCALE))
        terms = TrajectoryTerms(
            share * 0.12,
            share * 4e-3,
            velocity=SPEED_SHARE * problem.limits.velocity,
            collisions=problem.collisions,
            rel_tol=settings.budget.rel_tol,
        )
        return cls(time, terms, share * JOINT_MOTION_WEIGHT)


@dataclass(frozen=True)
class ArmPlanner:
    """One arm with its limits, samples and collision model."""

    limits: MotionLimits
    reachability_map: ReachabilityMap  # of `limits.arm`
    bank: SeedBank
    collisions: Collisions | None = None

    def solve(
        self,
        problem: MotionProblem,
        settings: PlanSettings,
        random: np.random.Generator,
        progress: Part = ignore_fraction,
    ) -> tuple[Array, Trajectory]:
        """Plan a motion; return the configurations at the waypoints (n, dof), and the timed motion."""
        time, terms, joint_motion_weight = Coarse.of(problem, settings)
        stages = stages_of(time, settings.budget.stage)
        # short paths get more nodes: of a UR5's motion of 10 s the distance is 14 % less with 700 than with 300
        more = float(np.clip(150.0 / len(stages), 1.0, 2.4))
        nodes = self.roadmap(problem[stages], int(more * settings.budget.nodes), random)
        progress(0.4)
        path = shortest_path(nodes, time[stages], self.largest_changes(time[stages]), joint_motion_weight)
        progress(0.6)
        q = optimize(problem[stages], time[stages], nodes.q[path], terms, POSITION_WEIGHTS[0])
        q, coarse_tolerance = interpolated(time[stages], q, time), 1e-3  # [m]; less than this is met with the time
        q, _ = optimize_to_tolerance(problem, time, q, terms, max(settings.position_tolerance, coarse_tolerance))
        return time_parameterized(problem, q, settings, settings.position_tolerance)

    def roadmap(self, problem: MotionProblem, count: int, random: np.random.Generator) -> Roadmap:
        """Make nodes on the path, or, without one, with similar ellipsoids; collision-free where possible."""
        (targets,) = problem.targets
        if targets.positions is not None:
            nodes = self.reachability_map.nodes(targets, count, random)
        else:  # joints that do not change the ellipsoid are in their middle
            q, idle = self.bank.starts_for(targets, count), self.reachability_map.idle
            q[..., idle] = (0.5 * (self.limits.lower + self.limits.upper))[idle]
            owner, first = np.repeat(np.arange(len(q)), q.shape[1]), np.arange(len(q) + 1) * q.shape[1]
            q = q.reshape(-1, q.shape[-1])
            q = turned_to_rotations(targets[owner], q) if targets.axes else q
            nodes = Roadmap(q, targets[owner].cost(q), first)
        if problem.costs:
            time = np.repeat(problem.time, np.diff(nodes.first))
            squares = [np.sum(cost.residual(nodes.q, time) ** 2, axis=1) for cost in problem.costs]
            nodes = replace(nodes, cost=nodes.cost + sum(squares))
        return nodes if self.collisions is None else nodes.without(self.collisions.collides(nodes.q))

    def largest_changes(self, time: Array) -> Array:
        """Largest joint changes from stage to stage at `time`, shape (stages, dof); larger ones are jumps."""
        gaps = np.diff(time, prepend=time[0] - 1.0)[:, None]
        largest = np.array([{"rad": 0.6, "m": 0.2}[unit] for unit in self.limits.arm.joint_units])
        return np.asarray(np.minimum(SPEED_SHARE * self.limits.velocity * gaps, largest))


def time_parameterized(
    problem: MotionProblem, q: Array, settings: PlanSettings, tolerance: float
) -> tuple[Array, Trajectory]:
    """Time a trajectory, optimize it with the smoothness that its time demands, and time it again.

    `tolerance` is that of the 95th percentile of the position error [m].
    """
    earliest = 1.0 / settings.speed_scale * (problem.time - problem.time[0])
    limits, collisions = problem.limits, problem.collisions
    at = retime(limits, earliest, q, rate=settings.rate).time
    terms = TrajectoryTerms(
        3e-3,
        1e-6,
        time_weights(earliest) * (at[-1] - at[0]) / (earliest[-1] - earliest[0]),
        SPEED_SHARE * limits.velocity,
        SPEED_SHARE * limits.acceleration,
        collisions,
        settings.budget.rel_tol,
    )
    q, weight = optimize_to_tolerance(problem, at, q, terms, tolerance)
    timed = retime(limits, earliest, q, rate=settings.rate)
    other = relaxed(problem, at, q, terms, weight, tolerance)
    if other is q:
        return q, timed
    other_timed = retime(limits, earliest, other, rate=settings.rate)
    if collisions is not None:
        before, after = (collisions.collides(motion.control_positions).mean() for motion in (timed, other_timed))
        if after > before:
            return q, timed
    return other, other_timed


def relaxed(
    problem: PathCost, time: Array, q: Array, terms: TrajectoryTerms, weight: float, tolerance: float, rounds: int = 6
) -> Array:
    """Optimize again with half the clearance and 1.5 times the duration around large errors, as long as that helps.

    The position has priority: where a path leads through a narrow passage, or from one branch of configurations to
    another, clearance and duration alone cause large position errors. Those above `FAR` tolerances count.
    """

    def largest_error(q: Array) -> Array:
        error = problem.position_error(q)
        return np.zeros(len(q)) if error is None else np.asarray(error.reshape(len(q), -1).max(axis=1))

    clearance, error = np.full(len(time), CLEARANCE), largest_error(q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time)))
        # few waypoints are a small share of the cost
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(problem, time, q, changed, weight)
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        trial_error = largest_error(trial)
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q, error = trial, trial_error
    return q
