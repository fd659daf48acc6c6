"""Relaxation: half the clearance and more time where position errors are large."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from maniport.motion.plan.optimizer import CLEARANCE, TrajectoryTerms, optimize
from maniport.motion.problem import MotionProblem
from maniport.util.validation import Array

FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large


def relaxed(
    problem: MotionProblem,
    time: Array,
    q: Array,
    terms: TrajectoryTerms,
    weight: float,
    tolerance: float,
    rounds: int = 6,
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


def _largest_error(problem: MotionProblem, q: Array) -> Array:
    """Largest position error of all arms (n,) [m]; zero without a path."""
    error = problem.tip_error(q)
    return np.zeros(len(q)) if error is None else np.asarray(error.reshape(len(q), -1).max(axis=1))
