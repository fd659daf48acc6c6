"""One compiled pass over many small matrices that vouches for those which are plainly SPD, and NumPy's verdict.

Only `validation` uses them: the verdict wherever the pass has a doubt.
"""

import numpy as np
from numpy.typing import NDArray

from maniport.util.jit import kernel


@kernel
def vouch(matrices, results, fraction, tolerance, low, high, definite):  # type: ignore[no-untyped-def]
    """Write the symmetric parts of matrices (count, n, n); True when each is certainly finite, symmetric and SPD."""
    count, n = matrices.shape[0], matrices.shape[1]
    writes, factor = len(results) > 0, np.empty((n, n))
    margin = 4.0 * n * np.finfo(np.float64).eps
    for row in range(count):
        gap, scale, trace = 0.0, 0.0, 0.0
        for i in range(n):
            trace += matrices[row, i, i]
            for j in range(i + 1):
                x, y = matrices[row, i, j], matrices[row, j, i]
                if not (abs(x) < high and abs(y) < high):  # nan, too
                    return False
                gap = max(gap, abs(x - y))
                scale = max(scale, abs(x), abs(y))
                mean = 0.5 * (x + y)
                factor[i, j] = mean
                if writes:
                    results[row, i, j] = results[row, j, i] = mean
        if gap > (tolerance * scale if writes else 0.0):
            return False
        if not definite:
            continue
        if not low <= abs(trace) <= high:
            return False
        for j in range(n):  # root-free: factor[i, k] holds L_ik D_k below the diagonal and 1 / D_k on it
            size = factor[j, j]
            pivot = size - fraction * abs(trace)
            for k in range(j):
                pivot -= factor[j, k] * factor[j, k] * factor[k, k]
            if not pivot > margin * size:
                return False
            factor[j, j] = 1.0 / pivot
            for i in range(j + 1, n):
                total = factor[i, j]
                for k in range(j):
                    total -= factor[i, k] * factor[j, k] * factor[k, k]
                factor[i, j] = total
    return True


def not_above(array: NDArray[np.float64], fraction: float) -> NDArray[np.bool_]:
    """Which symmetric matrices (..., d, d) have eigenvalues that do not lie above `fraction` of the trace."""
    limit = fraction * np.abs(np.trace(array, axis1=-2, axis2=-1))
    tiny = np.finfo(np.float64).tiny if fraction < 0 else 0.0  # a zero matrix is semidefinite, yet has no factor
    try:
        np.linalg.cholesky(array - (limit - tiny)[..., None, None] * np.eye(array.shape[-1]))
    except np.linalg.LinAlgError:
        worst = np.linalg.eigvalsh(array)[..., 0] - limit
        bad = worst <= 0 if fraction > 0 else worst < 0
        return np.asarray(bad if np.any(bad) else worst == worst.min())
    return np.zeros(array.shape[:-2], dtype=bool)
