"""Subsets, statistics, Sobol sequences and rank correlation, since SciPy's modules take half a second to load."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.util.validation import Array

BITS = 30

# Primitive polynomial and first direction numbers of each dimension after the first (Joe & Kuo, "Constructing Sobol
# sequences with better two-dimensional projections", SIAM J. Sci. Comput. 30, 2008)
DIRECTIONS = (
    (3, 1), (7, 1, 3), (11, 1, 3, 1), (13, 1, 1, 1), (19, 1, 1, 3, 3), (25, 1, 3, 5, 13), (37, 1, 1, 5, 5, 17),
    (41, 1, 1, 5, 5, 5), (47, 1, 1, 7, 11, 19), (55, 1, 1, 5, 1, 1), (59, 1, 1, 1, 3, 11), (61, 1, 3, 5, 5, 31),
    (67, 1, 3, 3, 9, 7, 49), (91, 1, 1, 1, 15, 21, 21), (97, 1, 3, 1, 13, 27, 49), (103, 1, 1, 1, 15, 7, 5),
    (109, 1, 3, 1, 15, 13, 25), (115, 1, 1, 5, 5, 19, 61), (131, 1, 3, 7, 11, 23, 15, 103),
    (137, 1, 3, 7, 13, 13, 15, 69), (143, 1, 1, 3, 13, 7, 35, 63), (145, 1, 3, 5, 9, 1, 25, 53),
    (157, 1, 3, 1, 13, 9, 35, 107), (167, 1, 3, 1, 5, 27, 61, 31), (171, 1, 1, 5, 11, 19, 41, 61),
    (185, 1, 3, 5, 3, 3, 13, 69), (191, 1, 1, 7, 13, 1, 19, 1), (193, 1, 3, 7, 5, 13, 19, 59),
    (203, 1, 1, 3, 9, 25, 29, 41), (211, 1, 3, 5, 13, 23, 1, 55), (213, 1, 3, 7, 3, 13, 59, 17),
)  # fmt: skip


def evenly_spaced(count: int, most: int | None) -> NDArray[np.intp]:
    """Return ascending indices of at most `most` of `count` entries, evenly spaced; all of them for None."""
    if most is None or most >= count:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.intp)


def sobol(dimension: int, exponent: int, generator: np.random.Generator) -> Array:
    """Draw the first 2^exponent points, shape (2^exponent, dimension), each in [0, 1).

    Parameters
    ----------
    dimension : int
        Above 32 the points are drawn by SciPy.
    exponent : int
        The points of a smaller exponent are the first ones of a larger.
    generator : numpy.random.Generator
        Draws the scrambling: a linear map of the digits, and a shift.

    References
    ----------
    Matoušek, "On the L2-discrepancy for anchored boxes", Journal of Complexity 14, 1998.
    """
    if dimension > len(DIRECTIONS) + 1:
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(dimension, rng=generator).random_base2(exponent))
    random, place = generator.spawn(1)[0], 2 ** np.arange(BITS, dtype=np.uint32)
    shift = random.integers(2, size=(dimension, BITS), dtype=np.uint32) @ place
    scrambling = np.tril(random.integers(2, size=(dimension, BITS, BITS), dtype=np.uint32))
    scrambling[:, np.arange(BITS), np.arange(BITS)] = 1
    digits = (_directions(dimension)[:, None] >> np.arange(BITS - 1, -1, -1)[:, None]) & 1  # (dimension, digit, column)
    vectors = place[::-1] @ ((scrambling @ digits) & 1)
    points = shift[None]
    for column in range(exponent):  # in the order of the Gray code
        points = np.concatenate([points, points[::-1] ^ vectors[:, column]])
    return points / 2.0**BITS


def _directions(dimension: int) -> NDArray[np.uint32]:
    """Direction numbers (dimension, BITS) as binary fractions."""
    vectors = np.ones((dimension, BITS), np.int64)
    for row, (polynomial, *first) in zip(vectors[1:], DIRECTIONS, strict=False):
        degree = len(first)
        row[:degree] = first
        for j in range(degree, BITS):
            row[j] = row[j - degree]
            for k in range(degree):
                if polynomial >> (degree - 1 - k) & 1:
                    row[j] ^= row[j - k - 1] << (k + 1)
    return (vectors << np.arange(BITS - 1, -1, -1)).astype(np.uint32)


def rank_correlation(a: Array, b: Array) -> float:
    """Compute Spearman's rank correlation of two vectors that vary."""
    return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Array) -> Array:
    """Ranks, those of equal values averaged."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * counts)[inverse])


def statistics(values: ArrayLike, time: ArrayLike) -> dict[str, float]:
    """Return median, 95th percentile and maximum of values (n,), with its time [s]; nan is ignored."""
    array = np.asarray(values, dtype=float)
    index = int(np.nanargmax(array))
    median, p95 = np.nanpercentile(array, [50.0, 95.0]).tolist()
    return {"median": median, "p95": p95, "max": float(array[index]), "max_at_s": float(np.asarray(time)[index])}
