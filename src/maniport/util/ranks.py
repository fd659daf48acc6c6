"""Rank correlation, without SciPy's statistics, which take half a second to load."""

import numpy as np

from maniport.util.validation import Array


def rank_correlation(a: Array, b: Array) -> float:
    """Compute Spearman's rank correlation of two vectors that vary."""
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Array) -> Array:
    """Ranks, those of equal values averaged."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * counts)[inverse])
