"""The quickest way along a path within linear limits of speed and acceleration: two sweeps, compiled.

With x = ṡ² and u = s̈, constant on each piece of the path, all limits are linear, |a u + b x| ≤ 1. Back from the end
the largest x is found from which the rest can be passed; then, from the start on, each piece takes the largest u [1]_.
A speed of 0 is always possible, and what is possible is convex: the largest x is found by halving.

References
----------
.. [1] Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
   Transactions on Robotics, 2018.
"""

import numpy as np
from numba import njit

EXACT = 1e-12
"""Share of a squared speed to which it is found."""


@njit(cache=True, nogil=True, error_model="numpy")
def fastest(a, b, steps, most):  # type: ignore[no-untyped-def]
    """Largest squared speeds x at the grid (k,), from rest to rest.

    Parameters
    ----------
    a, b : ndarray, shape (k - 1, m)
        |a u + b x| ≤ 1 with x at the start of each piece.
    steps : ndarray, shape (k - 1,)
        Lengths of the pieces.
    most : ndarray, shape (k,)
        Largest x.
    """
    count = len(most)
    allowed, found = np.zeros(count), np.zeros(count)
    for i in range(count - 2, 0, -1):
        low, high = 0.0, most[i]
        if _possible(a[i], b[i], steps[i], high, allowed[i + 1])[0]:
            low = high
        while high - low > EXACT * high:
            middle = 0.5 * (low + high)
            if _possible(a[i], b[i], steps[i], middle, allowed[i + 1])[0]:
                low = middle
            else:
                high = middle
        allowed[i] = low
    for i in range(count - 1):
        u = _possible(a[i], b[i], steps[i], found[i], allowed[i + 1])[1]
        found[i + 1] = min(max(found[i] + 2.0 * steps[i] * u, 0.0), allowed[i + 1])
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _possible(a, b, step, x, ahead):  # type: ignore[no-untyped-def]
    """Whether a piece can be begun at x and ended between 0 and `ahead`, and the largest u that does it."""
    least, largest = -0.5 * x / step, 0.5 * (ahead - x) / step
    for j in range(len(a)):
        first, second = (-1.0 - b[j] * x) / a[j], (1.0 - b[j] * x) / a[j]
        if a[j] == 0.0:
            if abs(b[j] * x) > 1.0:
                return False, largest
        elif a[j] > 0.0:
            least, largest = max(least, first), min(largest, second)
        else:
            least, largest = max(least, second), min(largest, first)
    return least <= largest, largest
