"""Functions of symmetric matrices through their eigenvalues, and their Mandel vectors."""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import ILL_CONDITIONED, compose, eigh, require_in_range
from maniport.util.validation import (
    MAX_DIMENSION,
    MIN_DIMENSION,
    Array,
    as_finite,
    as_number,
    as_spd,
    as_symmetric,
)

_above = cache(np.triu_indices)  # Rows and columns of the entries above the diagonal


def apply(matrices: Array, function: Callable[[Array], Array]) -> Array:
    """Apply a function to the eigenvalues of symmetric matrices, shape (..., d, d); input unchecked."""
    values, vectors = eigh(matrices)
    return compose(function(values), vectors)


def logarithm(products: Array) -> Array:
    """Logarithms of F X Fᵀ and other matrices (..., d, d) that are SPD but for rounding."""
    values, vectors = eigh(products)
    if not np.all(values > 0.0):
        raise NotSPDError(ILL_CONDITIONED)
    return compose(np.log(values), vectors)


def bounded(function: Callable[[Array], Array], name: str) -> Callable[[Array], Array]:
    """Guard an exponential or power: raise, naming the argument, where its result would overflow or vanish."""

    def guarded(values: Array) -> Array:
        with np.errstate(over="ignore", under="ignore"):
            results = function(values)
        require_in_range(results, name)
        return results

    return guarded


def logm(points: ArrayLike) -> Array:
    """Matrix logarithm of SPD matrices.

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        Symmetric positive-definite.

    Returns
    -------
    ndarray, shape (..., d, d)
        Symmetric.

    Raises
    ------
    NotSPDError
        When a matrix is asymmetric, indefinite or singular.
    """
    return apply(as_spd(points, "points", copy=False), np.log)


def expm(symmetric: ArrayLike) -> Array:
    """Matrix exponential of symmetric matrices, shape (..., d, d); the inverse of `logm`.

    Parameters
    ----------
    symmetric : array_like, shape (..., d, d)

    Returns
    -------
    ndarray, shape (..., d, d)
        SPD.
    """
    return apply(as_symmetric(symmetric, "symmetric"), bounded(np.exp, "symmetric"))


def powm(points: ArrayLike, exponent: float) -> Array:
    """Real power P^s of SPD matrices, shape (..., d, d): moves points along the geodesic through the identity.

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        SPD.
    exponent : float

    Returns
    -------
    ndarray, shape (..., d, d)
    """
    s = as_number(exponent, "exponent")
    return apply(
        as_spd(points, "points", copy=False), bounded(lambda values: values**s, "exponent")
    )


def to_vector(symmetric: ArrayLike) -> Array:
    """Mandel vectors of symmetric matrices: diagonal first, then the upper triangle times √2.

    The factor makes the Euclidean norm of the vector the Frobenius norm of the matrix.

    Parameters
    ----------
    symmetric : array_like, shape (..., d, d)
        Symmetric.

    Returns
    -------
    ndarray, shape (..., d (d + 1) / 2)
        Diagonal, then the rows of the strict upper triangle.
    """
    matrices = as_symmetric(symmetric, "symmetric")
    d = matrices.shape[-1]
    rows, columns = _above(d, 1)
    diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
    return np.concatenate([diagonal, np.sqrt(2.0) * matrices[..., rows, columns]], axis=-1)


def from_vector(vector: ArrayLike) -> Array:
    """Symmetric matrices from their Mandel vectors; the inverse of `to_vector`.

    Parameters
    ----------
    vector : array_like, shape (..., m)
        With m = d (d + 1) / 2 for a d from 2 to 12.

    Returns
    -------
    ndarray, shape (..., d, d)
    """
    vectors = as_finite(vector, "vector")
    if vectors.ndim:
        m = vectors.shape[-1]
    else:
        m = 0
    d = round((np.sqrt(8 * m + 1) - 1) / 2)
    if not MIN_DIMENSION <= d <= MAX_DIMENSION or d * (d + 1) != 2 * m:
        raise InvalidInputError(
            f"vector must have d (d + 1) / 2 entries, such as 3, 6, 10 or 21, for d from {MIN_DIMENSION} to "
            f"{MAX_DIMENSION}; found shape {vectors.shape}"
        )
    rows, columns = _above(d, 1)
    matrices = np.zeros((*vectors.shape[:-1], d, d))
    matrices[..., np.arange(d), np.arange(d)] = vectors[..., :d]
    matrices[..., rows, columns] = matrices[..., columns, rows] = vectors[..., d:] / np.sqrt(2.0)
    return matrices


@cache
def mandel_basis(d: int) -> Array:
    """Orthonormal basis of the symmetric matrices, shape (d (d + 1) / 2, d, d)."""
    basis = from_vector(np.eye(d * (d + 1) // 2))
    basis.flags.writeable = False
    return basis
