"""One compiled pass over many small matrices that vouches for plainly SPD ones; `validation` checks the others."""

import numpy as np

from maniport.util.jit import kernel


@kernel
def vouch(matrices, results, fraction, tolerance, low, high, definite):
    """Write the symmetric parts of matrices (count, n, n); True when each is certainly finite, symmetric and SPD."""
    count = matrices.shape[0]
    n = matrices.shape[1]
    writes = len(results) > 0
    factor = np.empty((n, n))
    margin = 4.0 * n * np.finfo(np.float64).eps
    for row in range(count):
        gap = 0.0
        scale = 0.0
        trace = 0.0
        for i in range(n):
            trace += matrices[row, i, i]
            for j in range(i + 1):
                x = matrices[row, i, j]
                y = matrices[row, j, i]
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
        for j in range(
            n
        ):  # root-free: factor[i, k] holds L_ik D_k below the diagonal and 1 / D_k on it
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
