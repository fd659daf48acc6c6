"""Eigen-decomposition of many small symmetric matrices: the loops that everything else stands on.

Private to maniport. `eigh` is what the other modules call. It runs cyclic Jacobi (Golub & Van Loan, Matrix
Computations, § 8.5) compiled by Numba on blocks of eight matrices, whose entries lie side by side so that the
compiler can work on all eight at once. From 12×12 up LAPACK is as fast and takes over.

Jacobi is also the more accurate choice: a rotation is skipped only when the off-diagonal entry is below machine
precision relative to its two diagonal entries, so that small eigenvalues of graded matrices keep their digits.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

LANES = 8
LAPACK_FROM = 12
MAX_SWEEPS = 40
EPS2 = float(np.finfo(np.float64).eps) ** 2
TINY = 1e-300


def eigh(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of symmetric matrices.

    Parameters
    ----------
    matrices : ndarray, shape (..., d, d)
        Symmetric, finite, unchecked. Only the upper triangle is read below 12×12.

    Returns
    -------
    values : ndarray, shape (..., d)
        Ascending.
    vectors : ndarray, shape (..., d, d)
        Orthonormal columns, in the order of the values.
    """
    d = matrices.shape[-1]
    if d >= LAPACK_FROM:
        values, vectors = np.linalg.eigh(matrices)
        return values, vectors
    flat = np.ascontiguousarray(matrices, dtype=np.float64).reshape(-1, d, d)
    values, vectors = np.empty((len(flat), d)), np.empty((len(flat), d, d))
    if len(flat):
        _jacobi(flat, values, vectors)
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


def eigh_numpy(matrices: Array) -> tuple[Array, Array]:
    """Same as `eigh` in plain NumPy: the same rotations in the same order, on the whole batch at once."""
    d = matrices.shape[-1]
    a = np.array(matrices, dtype=np.float64).reshape(-1, d, d)
    v = np.broadcast_to(np.eye(d), a.shape).copy()
    pairs = [(p, q) for p in range(d - 1) for q in range(p + 1, d)]
    for _ in range(MAX_SWEEPS):
        rotated = False
        for p, q in pairs:
            app, aqq, apq = a[:, p, p], a[:, q, q], a[:, p, q]
            turn = apq * apq > EPS2 * np.abs(app * aqq)
            if not turn.any():
                continue
            rotated = True
            gap = aqq - app
            tangent = 2.0 * apq * np.copysign(1.0, gap) / (np.abs(gap) + np.sqrt(gap * gap + 4.0 * apq * apq) + TINY)
            tangent = np.where(turn, tangent, 0.0)
            cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
            rotation = np.broadcast_to(np.eye(d), a.shape).copy()
            rotation[:, p, p] = rotation[:, q, q] = cosine
            rotation[:, p, q] = tangent * cosine
            rotation[:, q, p] = -tangent * cosine
            diagonal = app - tangent * apq, aqq + tangent * apq
            a = np.swapaxes(rotation, 1, 2) @ a @ rotation
            a[:, p, p], a[:, q, q] = diagonal
            a[:, p, q] = a[:, q, p] = np.where(turn, 0.0, apq)
            v = v @ rotation
        if not rotated:
            break
    values = np.diagonal(a, axis1=1, axis2=2)
    order = np.argsort(values, axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    vectors = np.take_along_axis(v, order[:, None, :], axis=2)
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _jacobi(matrices, values, vectors):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Diagonalise matrices (count, n, n) into ascending values (count, n) and columns vectors (count, n, n)."""
    count, n = matrices.shape[0], matrices.shape[1]
    a = np.empty((n, n, LANES))
    v = np.empty((n, n, LANES))
    cosine, sine, tangent = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for first in range(0, count, LANES):
        for i in range(n):
            for j in range(n):
                for lane in range(LANES):
                    a[i, j, lane] = matrices[min(first + lane, count - 1), i, j]
                    v[i, j, lane] = 1.0 if i == j else 0.0
        for _ in range(MAX_SWEEPS):
            rotated = False
            for p in range(n - 1):
                for q in range(p + 1, n):
                    turns = 0.0
                    for lane in range(LANES):
                        app, aqq, apq = a[p, p, lane], a[q, q, lane], a[p, q, lane]
                        turn = 1.0 if apq * apq > EPS2 * abs(app * aqq) else 0.0
                        turns = max(turns, turn)
                        gap = aqq - app
                        t = 2.0 * apq * np.copysign(1.0, gap) / (abs(gap) + np.sqrt(gap * gap + 4.0 * apq * apq) + TINY)
                        t *= turn
                        c = 1.0 / np.sqrt(1.0 + t * t)
                        tangent[lane], cosine[lane], sine[lane] = t, c, t * c
                        a[p, p, lane] = app - t * apq
                        a[q, q, lane] = aqq + t * apq
                        a[p, q, lane] = apq * (1.0 - turn)
                    if turns == 0.0:
                        continue
                    rotated = True
                    for k in range(n):
                        if k != p and k != q:
                            # only the upper triangle is kept up to date
                            ip, jp = (k, p) if k < p else (p, k)
                            iq, jq = (k, q) if k < q else (q, k)
                            for lane in range(LANES):
                                x, y = a[ip, jp, lane], a[iq, jq, lane]
                                a[ip, jp, lane] = cosine[lane] * x - sine[lane] * y
                                a[iq, jq, lane] = sine[lane] * x + cosine[lane] * y
                    for k in range(n):
                        for lane in range(LANES):
                            x, y = v[k, p, lane], v[k, q, lane]
                            v[k, p, lane] = cosine[lane] * x - sine[lane] * y
                            v[k, q, lane] = sine[lane] * x + cosine[lane] * y
            if not rotated:
                break
        for lane in range(min(LANES, count - first)):
            for j in range(n):
                rank = 0
                for k in range(n):
                    if a[k, k, lane] < a[j, j, lane] or (a[k, k, lane] == a[j, j, lane] and k < j):
                        rank += 1
                values[first + lane, rank] = a[j, j, lane]
                for i in range(n):
                    vectors[first + lane, i, rank] = v[i, j, lane]
