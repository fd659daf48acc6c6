"""The last step of planning: time, optimize with this time, relax around large position errors, and time again."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from maniport.motion.plan.optimizer import (
    CLEARANCE,
    POSITION_WEIGHTS,
    TrajectoryTerms,
    optimize,
    optimize_to_tolerance,
    time_weights,
)
from maniport.motion.plan.plan_settings import PlanSettings
from maniport.motion.plan.time_parameterization import retime
from maniport.motion.problem import MotionProblem
from maniport.motion.status import FAR
from maniport.motion.trajectory import Trajectory
from maniport.util.validation import Array

SPEED_SHARE = 0.9  # Share of the limits of velocity and acceleration that the optimizer uses


def time_parameterized(
    problem: MotionProblem, q: Array, settings: PlanSettings, tolerance: float
) -> tuple[Array, Trajectory]:
    """Time a trajectory, optimize it with the smoothness that this time demands, relax it, and time it again."""
    earliest = 1.0 / settings.speed_scale * (problem.time - problem.time[0])
    limits = problem.limits
    at = retime(limits, earliest, q, rate=settings.rate).time
    terms = TrajectoryTerms(
        3e-3,
        1e-6,
        time_weights(earliest) * (at[-1] - at[0]) / (earliest[-1] - earliest[0]),
        SPEED_SHARE * limits.velocity,
        SPEED_SHARE * limits.acceleration,
        problem.collisions,
        settings.budget.rel_tol,
    )
    q = optimize_to_tolerance(problem, at, q, terms, tolerance)
    timed = retime(limits, earliest, q, rate=settings.rate)
    other = relaxed(problem, at, q, terms, tolerance)
    if other is q:
        return q, timed
    other_timed, collisions = retime(limits, earliest, other, rate=settings.rate), problem.collisions
    if collisions is not None:
        before, after = (collisions.collides(motion.control_positions).mean() for motion in (timed, other_timed))
        if after > before:
            return q, timed
    return other, other_timed


def relaxed(
    problem: MotionProblem, time: Array, q: Array, terms: TrajectoryTerms, tolerance: float, rounds: int = 6
) -> Array:
    """Optimize again with half the clearance and 1.5 times the duration around large errors, as long as that helps.

    Where a path leads through a narrow passage, or from one branch of configurations to another, clearance and duration
    alone cause large position errors.
    """

    def largest_error(q: Array) -> Array:
        error = problem.position_error(q)
        return np.zeros(len(q)) if error is None else np.asarray(error.max(axis=1))

    clearance, error = np.full(len(time), CLEARANCE), largest_error(q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time)))
        # few waypoints are a small share of the cost
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(problem, time, q, changed, POSITION_WEIGHTS[-1])
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        trial_error = largest_error(trial)
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q, error = trial, trial_error
    return q
