"""Compiled loops over all pairs of two sets of vectors, which need no matrix of all distances.

One set, `vectors`, has the shape (n, k), the other, `others`, (k, m): its vectors lie side by side in memory, so that
the compiler makes vector instructions of the innermost loops.
"""

import numpy as np

from maniport.jit import kernel, part


@kernel(fastmath=True)
def sum_distances(vectors, others, sums, columns):  # type: ignore[no-untyped-def]
    """Fill sums of |v_i − w_j| over j, shape (n,), and over i, shape (m,)."""
    squares = np.empty(len(columns))
    columns[:] = 0.0
    for i in range(len(vectors)):
        _fill_squares(vectors, others, i, squares)
        total = 0.0
        for j in range(len(squares)):
            squares[j] = np.sqrt(squares[j])
            columns[j] += squares[j]
        for j in range(len(squares)):
            total += squares[j]
        sums[i] = total


@kernel(fastmath=True)
def nearest_distances(vectors, others, found):  # type: ignore[no-untyped-def]
    """Fill the distance from each vector to the nearest of the others."""
    squares = np.empty(others.shape[1])
    for i in range(len(vectors)):
        _fill_squares(vectors, others, i, squares)
        least = np.inf
        for j in range(len(squares)):
            least = min(least, squares[j])
        found[i] = np.sqrt(least)


@part
def _fill_squares(vectors, others, i, squares):  # type: ignore[no-untyped-def]
    squares[:] = 0.0
    for k in range(len(others)):
        for j in range(len(squares)):
            gap = others[k, j] - vectors[i, k]
            squares[j] += gap * gap


@kernel(fastmath=True)
def count_above(vectors, others, limit, found):  # type: ignore[no-untyped-def]
    """Fill, for each of the others, how many vectors have a scalar product with it above a limit, shape (m,)."""
    products = np.empty(len(found))
    found[:] = 0.0
    for i in range(len(vectors)):
        products[:] = 0.0
        for k in range(len(others)):
            for j in range(len(found)):
                products[j] += others[k, j] * vectors[i, k]
        for j in range(len(found)):
            found[j] += 1.0 if products[j] > limit else 0.0
