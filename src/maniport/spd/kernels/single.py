"""One small matrix at a time, where a single answer is wanted soon: control loops and sums over few pairs.

The batch kernels work on sixteen matrices at once and take as long for one. The functions here are compiled and are
called from compiled code; they write into arrays that the caller owns.
"""

import numpy as np
from numba import njit

EPS2 = float(np.finfo(np.float64).eps) ** 2
MAX_SWEEPS = 40


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def diagonalise_one(a, v):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Turn a symmetric matrix, of which the upper triangle is read, into diag(a) and eigenvectors v; cyclic Jacobi."""
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            v[i, j] = 1.0 if i == j else 0.0
    for _ in range(MAX_SWEEPS):
        turned = False
        for p in range(n - 1):
            for q in range(p + 1, n):
                app, aqq, apq = a[p, p], a[q, q], a[p, q]
                if apq * apq <= EPS2 * abs(app * aqq):
                    continue
                turned = True
                gap = aqq - app
                t = 2.0 * apq / (gap + np.copysign(np.sqrt(gap * gap + 4.0 * apq * apq), gap))
                c = 1.0 / np.sqrt(1.0 + t * t)
                s = t * c
                a[p, p], a[q, q], a[p, q] = app - t * apq, aqq + t * apq, 0.0
                for k in range(n):
                    if k != p and k != q:  # only the upper triangle is kept up to date
                        ip, jp = (k, p) if k < p else (p, k)
                        iq, jq = (k, q) if k < q else (q, k)
                        x, y = a[ip, jp], a[iq, jq]
                        a[ip, jp], a[iq, jq] = c * x - s * y, s * x + c * y
                    x, y = v[k, p], v[k, q]
                    v[k, p], v[k, q] = c * x - s * y, s * x + c * y
        if not turned:
            break


@njit(
    "i8(f8[:, ::1], f8[:, :, ::1], f8, f8, f8, f8, f8[:, ::1])",
    cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"},
)  # fmt: skip
def power_congruence_one(point, state, power, added, floor, released, out):  # type: ignore[no-untyped-def]
    """Fill `out` with R (L (X + added I) Lᵀ)^power Rᵀ − released I, the eigenvalues of X first lifted to `floor`.

    `state` holds L, R and space for three matrices. Returns 0, or the number of the check that failed: 1 when X is not
    symmetric and finite, 2 when an eigenvalue is not positive and finite, before or after, 3 when sizes differ.
    """
    n = state.shape[1]
    if point.shape[0] != n or point.shape[1] != n or out.shape[0] != n or out.shape[1] != n:
        return 3
    left, right, a, b, v = state[0], state[1], state[2], state[3], state[4]
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(point[i, j]))
    for i in range(n):
        for j in range(n):
            if not abs(point[i, j] - point[j, i]) <= 1e-8 * largest:  # also true for nan
                return 1
            a[i, j] = 0.5 * (point[i, j] + point[j, i])
    if floor > 0.0:
        diagonalise_one(a, v)
        for i in range(n):
            if a[i, i] < -1e-14 * n * largest:
                return 2
            b[i, i] = max(a[i, i], floor)
        for i in range(n):
            for j in range(n):
                a[i, j] = 0.0
                for k in range(n):
                    a[i, j] += v[i, k] * b[k, k] * v[j, k]
    for i in range(n):
        a[i, i] += added
    for i in range(n):
        for j in range(n):
            b[i, j] = 0.0
            for k in range(n):
                b[i, j] += left[i, k] * a[k, j]
    for i in range(n):
        for j in range(i, n):
            a[i, j] = 0.0
            for k in range(n):
                a[i, j] += b[i, k] * left[j, k]
    diagonalise_one(a, v)
    lowest, highest = a[0, 0], a[0, 0]
    for k in range(n):
        lowest, highest = min(lowest, a[k, k]), max(highest, a[k, k])
    if not (lowest > 1e-14 * highest and highest < np.inf):
        return 2
    for k in range(n):
        value = a[k, k] ** power
        if not (value > 0.0 and value < np.inf):
            return 2
        root = np.sqrt(value)
        for i in range(n):
            b[i, k] = 0.0
            for j in range(n):
                b[i, k] += right[i, j] * v[j, k]
            b[i, k] *= root
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(n):
                total += b[i, k] * b[j, k]
            out[i, j] = total
            out[j, i] = total
        out[i, i] -= released
    return 0
