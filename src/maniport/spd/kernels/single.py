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
