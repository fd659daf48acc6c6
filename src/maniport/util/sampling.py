"""Subsets, Sobol sequences, rank correlation and statistics of samples."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.util.validation import Array


def evenly_spaced(count: int, most: int | None) -> NDArray[np.intp]:
    """Return ascending indices of at most `most` of `count` entries, evenly spaced; all of them for None."""
    if most is None or most >= count:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.intp)


def sobol(dimension: int, exponent: int, generator: np.random.Generator) -> Array:
    """Draw the first 2^exponent points of a scrambled Sobol sequence in [0, 1), shape (2^exponent, dimension)."""
    from scipy.stats import qmc  # slow to load

    return np.asarray(qmc.Sobol(dimension, rng=generator).random_base2(exponent))


def rank_correlation(a: Array, b: Array) -> float:
    """Compute Spearman's rank correlation of two vectors that vary."""
    from scipy.stats import rankdata  # slow to load

    return float(np.corrcoef(rankdata(a), rankdata(b))[0, 1])


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
