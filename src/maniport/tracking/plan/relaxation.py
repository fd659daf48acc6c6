"""Relaxation of clearance and duration where they keep the end effector far from its path: the position has priority.

A trajectory keeps more clearance than it must, and keeps within its limits in the time that it was given. Where a path
leads through a narrow passage, or from one branch of postures to another, that alone causes large position errors.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from maniport.tracking.plan.optimizer import CLEARANCE, PathCost, TrajectoryTerms, optimize
from maniport.validation import Array

FAR = 3.0
"""Position errors of so many times the tolerance of the 95th percentile are large."""


def relaxed(
    targets: PathCost, time: Array, q: Array, terms: TrajectoryTerms, weight: float, tolerance: float, rounds: int = 6
) -> Array:
    """Optimize again with half the clearance and 1.5 times the duration around large errors, as long as that helps."""
    clearance = np.full(len(time), CLEARANCE)
    error = _largest(targets, q)
    for _ in range(rounds):
        far = maximum_filter1d(error > FAR * tolerance, 5)
        if not far.any():
            break
        clearance = np.where(far, np.maximum(0.5 * clearance, 0.003), clearance)
        time = np.append(time[0], time[0] + np.cumsum(np.where(far[1:] & far[:-1], 1.5, 1.0) * np.diff(time)))
        # few waypoints are a small share of the cost
        changed = replace(terms, clearance=clearance, rel_tol=0.1 * terms.rel_tol)
        trial = optimize(targets, time, q, changed, weight)
        trial_error = _largest(targets, trial)
        if terms.collisions is not None and terms.collisions.collides(trial[far]).any():
            break
        if trial_error[far].max() > 0.95 * error[far].max():
            break
        q, error = trial, trial_error
    return q


def _largest(targets: PathCost, q: Array) -> Array:
    """Largest position error of all arms (n,) [m]; zero without a path."""
    error = targets.tip_error(q)
    return np.zeros(len(q)) if error is None else error.reshape(len(q), -1).max(axis=1)
