"""Optimization of a whole trajectory: on the planning time scale, then with the time that the limits allow."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from maniport.motion.plan.optimizer import CLEARANCE, TrajectoryTerms, optimize, optimize_to_tolerance, time_weights
from maniport.motion.plan.plan_control import PlanControl
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT
from maniport.motion.plan.time_parameterization import Timed, retime
from maniport.motion.problem import MotionProblem
from maniport.motion.search.descent import PathCost
from maniport.util.validation import Array

PLANNING_TIME_SCALE = 4.0
"""Trajectories are planned as if they took so many times the demonstrated time; time parameterization comes last."""
SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses
FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large


def planning_time_scale(settings: PlanControl) -> float:
    """Return how many times the demonstrated time a trajectory is planned for."""
    return max(1.0 / settings.speed_scale, PLANNING_TIME_SCALE)


def planning_time(problem: MotionProblem, settings: PlanControl) -> Array:
    """Return the times of the waypoints on the planning time scale (n,), from 0 [s]."""
    return np.asarray(planning_time_scale(settings) * (problem.time - problem.time[0]))


def smoothness(time: Array) -> float:
    """Return the factor of the smoothness costs for times (n,) on the planning time scale.

    Less smoothness is more accurate, but the limits then slow the trajectory down: by about the same share, which is
    more seconds for a long recording. The factor grows with the root of the demonstrated duration.
    """
    return 0.04 * float(np.sqrt((time[-1] - time[0]) / PLANNING_TIME_SCALE))


def joint_motion_weight(time: Array) -> float:
    """Return the weight of joint motion in the graph search for times (n,) on the planning time scale."""
    return smoothness(time) * JOINT_MOTION_WEIGHT


def coarse_terms(problem: MotionProblem, time: Array, settings: PlanControl) -> TrajectoryTerms:
    """Return smoothness, limits and collisions of a trajectory on the planning time scale."""
    share = smoothness(time)
    return TrajectoryTerms(
        share * 0.12,
        share * 4e-3,
        velocity=SPEED_SHARE * problem.limits.velocity,
        collisions=problem.collisions,
        rel_tol=settings.budget.rel_tol,
    )


def time_parameterized(
    problem: MotionProblem, q: Array, settings: PlanControl, tolerance: float
) -> tuple[Array, Timed]:
    """Time a trajectory, optimize it with the smoothness that its time demands, and time it again.

    `tolerance` is that of the 95th percentile of the position error [m].
    """
    earliest = 1.0 / settings.speed_scale * (problem.time - problem.time[0])
    limits, collisions = problem.limits, problem.collisions
    at = retime(limits, earliest, q, rate=settings.rate).at
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
    other = relaxed(problem, at, q, terms, weight, tolerance) if settings.budget.relaxation else q
    if other is q:
        return q, timed
    other_timed = retime(limits, earliest, other, rate=settings.rate)
    if collisions is not None and np.mean(collisions.collides(other_timed.positions)) > np.mean(
        collisions.collides(timed.positions)
    ):
        return q, timed
    return other, other_timed


def relaxed(
    problem: PathCost, time: Array, q: Array, terms: TrajectoryTerms, weight: float, tolerance: float, rounds: int = 6
) -> Array:
    """Optimize again with half the clearance and 1.5 times the duration around large errors, as long as that helps.

    The position has priority: where a path leads through a narrow passage, or from one branch of configurations to
    another, clearance and duration alone cause large position errors. Those above `FAR` tolerances count.
    """
    clearance = np.full(len(time), CLEARANCE)
    error = _largest_error(problem, q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time)))
        # few waypoints are a small share of the cost
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(problem, time, q, changed, weight)
        trial_error = _largest_error(problem, trial)
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q, error = trial, trial_error
    return q


def _largest_error(problem: PathCost, q: Array) -> Array:
    """Largest position error of all arms (n,) [m]; zero without a path."""
    error = problem.tip_error(q)
    return np.zeros(len(q)) if error is None else np.asarray(error.reshape(len(q), -1).max(axis=1))
