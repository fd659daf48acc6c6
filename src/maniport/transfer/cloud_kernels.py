"""Loops over all pairs of two sets of vectors, compiled; one set lies beside one another, sixteen at a time.

A matrix of all distances would leave the processor's cache, and BLAS would start threads for it.
"""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels import WIDEST
from maniport.spd.kernels.words import load, root, spread, store, take, where, width
from maniport.validation import Array

PARTS = "54f9f8e174ca"
"""Digest of `lanes.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})


def beside(vectors: Array, fill: float = 0.0) -> Array:
    """Lay vectors (n, k) beside one another in the rows of a block, `fill` behind them; shape (k, rows, 16)."""
    count, size = vectors.shape
    rows = np.full((size, count + -count % WIDEST.size), fill)
    rows[:, :count] = vectors.T
    return rows.reshape(size, -1, *WIDEST.shape[1:])


@compiled
def sum_distances(vectors, others, valid, sums, columns):  # type: ignore[no-untyped-def]
    """Fill sums of |v_i − w_j| over j, shape (n,), and over i, a block; `valid` is one where there is a w_j, else 0."""
    lanes = np.empty(columns[:1].shape)
    for row in range(len(columns)):
        store(columns, row, spread(0.0, columns))
    for i in range(len(vectors)):
        total = spread(0.0, columns)
        for row in range(len(columns)):
            squared = spread(0.0, columns)
            for k in range(len(others)):
                gap = load(others[k], row) - vectors[i, k]
                squared = squared + gap * gap
            distance = root(squared) * load(valid, row)
            store(columns, row, load(columns, row) + distance)
            total = total + distance
        store(lanes, 0, total)
        sums[i] = 0.0
        for lane in range(width(lanes)):
            sums[i] += take(lanes, 0, lane)


@compiled
def nearest_distances(vectors, others, found):  # type: ignore[no-untyped-def]
    """Fill the distance from each vector to the nearest of the others; infinities lie behind these."""
    lanes = np.empty(others[0, :1].shape)
    for i in range(len(vectors)):
        least = spread(np.inf, lanes)
        for row in range(others.shape[1]):
            squared = spread(0.0, lanes)
            for k in range(len(others)):
                gap = load(others[k], row) - vectors[i, k]
                squared = squared + gap * gap
            least = where(squared < least, squared, least)
        store(lanes, 0, root(least))
        found[i] = np.inf
        for lane in range(width(lanes)):
            found[i] = min(found[i], take(lanes, 0, lane))


@compiled
def count_above(vectors, others, limit, found):  # type: ignore[no-untyped-def]
    """Fill, in a block, with how many vectors each of the others has a scalar product above a limit."""
    here = np.empty(others[:, 0].shape)  # near at hand while all vectors pass by
    for row in range(len(found)):
        for k in range(len(here)):
            store(here, k, load(others[k], row))
        total = spread(0.0, found)
        for i in range(len(vectors)):
            product = spread(0.0, found)
            for k in range(len(here)):
                product = product + load(here, k) * vectors[i, k]
            total = total + where(product > limit, 1.0, spread(0.0, found))
        store(found, row, total)
