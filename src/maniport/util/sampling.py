"""Subsets, rank correlation and statistics of samples."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.util.validation import Array


def evenly_spaced(count: int, most: int | None) -> NDArray[np.intp]:
    """Return ascending indices of at most `most` of `count` entries, evenly spaced; all of them for None."""
    if most is None or most >= count:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.intp)


def rank_correlation(a: Array, b: Array) -> float:
    """Compute Spearman's rank correlation of two vectors that vary."""
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Array) -> Array:
    """Ranks of values (n,) from 1 on; equal ones have the mean of their ranks."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    mean_ranks = np.cumsum(counts) - 0.5 * (counts - 1)
    return np.asarray(mean_ranks[which])


def statistics(values: ArrayLike, time: ArrayLike) -> dict[str, float]:
    """Return median, 95th percentile and maximum of values (n,), with its time [s]; nan is ignored."""
    array = np.asarray(values, dtype=float)
    index = int(np.nanargmax(array))
    median, p95 = np.nanpercentile(array, [50.0, 95.0]).tolist()
    return {
        "median": median,
        "p95": p95,
        "max": float(array[index]),
        "max_at_s": float(np.asarray(time)[index]),
    }
