"""Postures that follow one another along a motion: each is searched for from the one before it."""

import numpy as np

from maniport.tracking.search.descent import Target, descend
from maniport.validation import Array

TRAVEL_COST = 1.0
"""What the fourth power of a joint's change between neighbouring points counts for, beside d² [1/rad⁴ or 1/m⁴].

A motion in steps of 0.3 rad costs next to nothing, while a change of posture such as elbow up to elbow down, 3 rad in
two joints, costs more than any ellipsoid is worth.
"""
FIRST_STEPS, STEPS, TOLERANCE = 20, 6, 1e-4


def postures_along(target: Target, starts: Array, count: int = 1) -> tuple[Array, Array]:
    """Move along `count` motions from several starts each; the postures (count, n, dof) and costs (count,) of the best.

    What is nearest at each point by itself may lie in different postures at neighbouring points, with no motion to
    join them. Here each search begins at the point before, so that the arm stays in its posture, or pays for leaving.

    Parameters
    ----------
    target : Target
        count · n points: those of the first motion in their order, then those of the second and so on.
    starts : ndarray, shape (count, k, dof)
        At the first point of each motion.
    count : int

    Returns
    -------
    q : ndarray, shape (count, n, dof)
    cost : ndarray, shape (count,)
        Mean over the points of |r|² + TRAVEL_COST · Σ_j (q_j − q_j before)⁴, the least of all starts.
    """
    k, dof = starts.shape[1:]
    rows = np.arange(len(target.whitening)).reshape(count, -1)
    n = rows.shape[1]
    q, cost = np.empty((n, count * k, dof)), np.zeros(count * k)
    for i in range(n):
        here = target[np.repeat(rows[:, i], k)]
        before = starts.reshape(count * k, dof) if i == 0 else q[i - 1]
        q[i] = descend(here, before[:, None], TOLERANCE, STEPS if i else FIRST_STEPS)
        cost += here.evaluate(q[i])[0] ** 2 + (TRAVEL_COST * np.sum((q[i] - before) ** 4, axis=1) if i else 0.0)
    best = np.argmin(cost.reshape(count, k), axis=1) + k * np.arange(count)
    return np.swapaxes(q[:, best], 0, 1), cost[best] / n
