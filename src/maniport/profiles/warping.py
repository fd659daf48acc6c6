"""The cheapest way to step through two series together: dynamic time warping on a matrix of costs.

Sakoe & Chiba, Dynamic Programming Algorithm Optimization for Spoken Word Recognition, IEEE TASSP 1978, with the steps
(1, 0), (0, 1) and (1, 1), all of weight one. Written here because no kept library fits: of those that take a matrix of
costs, dtw-python is under the GPL, tslearn needs statsmodels and pandas and compiles for 6 s in every new process,
pyts for 21 s at import, and librosa brings the stack of audio; dtaidistance knows Euclidean costs only.
"""

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array

Path = NDArray[np.intp]


def cheapest_path(costs: Array) -> tuple[Path, float]:
    """Cheapest path through a matrix of costs from its first entry to its last.

    Parameters
    ----------
    costs : ndarray, shape (n, m)
        Non-negative: what it costs to match point i of one series with point j of the other.

    Returns
    -------
    path : ndarray, shape (l, 2)
        Matched indices, from (0, 0) to (n − 1, m − 1); among equally cheap steps the diagonal one is taken.
    cost : float
        Sum of the costs on the path, its end points included.
    """
    n, m = costs.shape
    total = np.full((n + 1, m + 1), np.inf)
    total[0, 0] = 0.0
    for diagonal in range(n + m - 1):  # entries of an antidiagonal depend on the two before it only
        i = np.arange(max(0, diagonal - m + 1), min(diagonal, n - 1) + 1)
        j = diagonal - i
        before = np.minimum(np.minimum(total[i, j], total[i, j + 1]), total[i + 1, j])
        total[i + 1, j + 1] = costs[i, j] + before
    i, j = n, m
    path = [(n - 1, m - 1)]
    while (i, j) != (1, 1):
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        i, j = min(steps, key=lambda entry: total[entry])
        path.append((i - 1, j - 1))
    return np.array(path[::-1], dtype=np.intp), float(total[n, m])
