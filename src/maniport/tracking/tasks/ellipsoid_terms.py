"""The compiled part of the ellipsoid task: error and derivative in the tangent space of the present ellipsoid."""

import numpy as np
from numba import njit

from maniport.spd.kernels.pieces import diagonalise_one

PARTS = "01ea17046f6c"
"""Digest of `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

SINGULAR = 1e-14
"""Smallest ratio of eigenvalues of an ellipsoid that is not taken for rounding."""


@njit(cache=True, nogil=True, error_model="numpy")
def fill_terms(rows, changes, epsilon, damped, root, turned, error, jacobian):  # type: ignore[no-untyped-def]
    """Fill error (m,) and Jacobian (m, dof) of the present ellipsoid M = rows rowsᵀ + epsilon I. False: M is singular.

    With `turned`, both are expressed at the target W: F = M^-½ is replaced by Oᵀ M^-½, another root of M⁻¹,
    with the orthogonal factor O = (M^-½ W M^-½)^-½ M^-½ W^½.

    Parameters
    ----------
    rows : ndarray, shape (d, dof)
        Of the Jacobian, columns times the joint weights.
    changes : ndarray, shape (dof, d, d)
        ∂M/∂q_k.
    damped, root : ndarray, shape (d, d)
        W, damping included, and W^½, which is read where `turned`.
    """
    d, dof = rows.shape
    m, v, factor, x = np.empty((d, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d))
    for i in range(d):
        for j in range(i, d):
            m[i, j] = epsilon if i == j else 0.0
            for k in range(dof):
                m[i, j] += rows[i, k] * rows[j, k]
    diagonalise_one(m, v)
    if not _spread_enough(m):
        return False
    _compose(v, m, 0, factor)
    _congruence(factor, damped, x)
    diagonalise_one(x, v)
    if not _spread_enough(x):
        return False
    if turned:
        # Oᵀ = W^½ M^-½ X^-½; the error turned, Oᵀ log(X) O, has the eigenvectors Oᵀ U.
        _compose(v, x, 0, m)
        turn = root @ factor @ m
        v = turn @ v
        factor = turn @ factor
    _compose(v, x, 1, m)
    _mandel(m, error)
    row = np.empty(len(error))
    for k in range(dof):
        _congruence(factor, changes[k], m)
        _mandel(m, row)
        for i in range(len(error)):
            jacobian[i, k] = -row[i]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _spread_enough(diagonal):  # type: ignore[no-untyped-def]
    lowest, highest = diagonal[0, 0], diagonal[0, 0]
    for k in range(len(diagonal)):
        lowest, highest = min(lowest, diagonal[k, k]), max(highest, diagonal[k, k])
    return lowest > SINGULAR * highest and highest < np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def _compose(v, diagonal, logarithm, result):  # type: ignore[no-untyped-def]
    """Fill result with V f(D) Vᵀ, f the logarithm or the inverse root."""
    d = len(v)
    for i in range(d):
        for j in range(d):
            result[i, j] = 0.0
            for k in range(d):
                value = np.log(diagonal[k, k]) if logarithm else 1.0 / np.sqrt(diagonal[k, k])
                result[i, j] += v[i, k] * value * v[j, k]


@njit(cache=True, nogil=True, error_model="numpy")
def _congruence(factor, matrix, result):  # type: ignore[no-untyped-def]
    """Fill result with F A Fᵀ, symmetric to the last bit."""
    d = len(factor)
    for i in range(d):
        for j in range(i, d):
            total = 0.0
            for k in range(d):
                for n in range(d):
                    total += factor[i, k] * matrix[k, n] * factor[j, n]
            result[i, j] = total
            result[j, i] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _mandel(matrix, vector):  # type: ignore[no-untyped-def]
    d = len(matrix)
    row = d
    for i in range(d):
        vector[i] = matrix[i, i]
        for j in range(i + 1, d):
            vector[row] = np.sqrt(2.0) * matrix[i, j]
            row += 1
