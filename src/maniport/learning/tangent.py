"""Tangent spaces in whitened Mandel coordinates, covariances in them, and the weights of a tracking task.

The coordinates of X at P are vec(log(P^-½ X P^-½)), a vector of m = d (d + 1) / 2 whose length is the affine-invariant
distance. Parallel transport from P₁ to P₂ along their geodesic, E L Eᵀ with E = (P₂ P₁⁻¹)^½, becomes a rotation of
them: V → Q V Qᵀ with Q = P₂^-½ E P₁^½ = P₂^-½ P₁^½ (P₁^-½ P₂ P₁^-½)^½, which is orthogonal.
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import mandel_basis
from maniport.spd.matrix_functions import compose, congruence, roots, to_vector
from maniport.util.validation import SPD_TOLERANCE, Array, as_finite, as_number


def coordinates(centers: Array, points: Array) -> Array:
    """Return whitened Mandel coordinates (..., m) of points at centers, shapes (..., d, d) that broadcast."""
    values, vectors = whitened_eigh(roots(centers)[1], points)
    return to_vector(compose(np.log(values), vectors))


def turns(starts: Array, ends: Array) -> Array:
    """Return the rotations Q (..., d, d) of parallel transport in whitened coordinates."""
    root, inverse_root = roots(starts)
    values, vectors = whitened_eigh(inverse_root, ends)
    return np.asarray(roots(ends)[1] @ root @ compose(np.sqrt(values), vectors))


def on_vectors(rotations: Array) -> Array:
    """Return the orthogonal matrices (..., m, m) of V → Q V Qᵀ on Mandel vectors; Q has shape (..., d, d)."""
    images = congruence(rotations[..., None, :, :], mandel_basis(rotations.shape[-1]))
    return np.swapaxes(to_vector(images), -1, -2)


def tracking_weights(covariance: ArrayLike, damping: float = 0.1) -> Array:
    """Return the weights of a tracking task: large where demonstrations agree.

    Parameters
    ----------
    covariance : array_like, shape (n, m, m)
        Of a profile, in whitened Mandel coordinates at its ellipsoids; see `ProfileGMM.predict`.
    damping : float
        ρ ≥ 0: the weights are (C + ρ c I)⁻¹, c the mean variance over all times and directions. A direction has at most
        1 + 1 / ρ times the weight of one of mean variance.

    Returns
    -------
    ndarray, shape (n, m, m)
        W, dimensionless, for the cost eᵀ W e of the error e = vec(log(M^-½ M_target M^-½)); its mean weight, tr(W) / m
        averaged over the n times, is one.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a covariance is not symmetric positive-semidefinite, all are zero, or one is singular without damping.
    """
    array = as_finite(covariance, "covariance")
    if array.ndim < 2 or array.shape[-1] != array.shape[-2]:
        raise InvalidInputError(f"covariance must have shape (..., m, m); found {array.shape}")
    if not array.size:
        raise InvalidInputError(f"covariance must not be empty; found shape {array.shape}")
    rho = as_number(damping, "damping", minimum=0.0)
    transposed = np.swapaxes(array, -1, -2)
    gap, scale = (np.abs(part).max(axis=(-1, -2)) for part in (array - transposed, array))
    if np.any(gap > 1e-8 * scale):
        raise NotSPDError(f"covariance must be symmetric; found |A - Aᵀ| up to {gap.max():.3g}")
    values, vectors = np.linalg.eigh(0.5 * (array + transposed))
    if np.any(values[..., 0] < -1e-10 * scale):
        raise NotSPDError(f"covariance must have no negative eigenvalue; found {values.min():.3g}")
    values = values / max(float(np.abs(values).max()), np.finfo(np.float64).tiny)  # weights have no unit
    variance = float(values.mean())
    if variance <= 0:
        raise InvalidInputError("covariance must not be zero at all times")
    values = np.maximum(values, 0.0) + rho * variance
    if np.any(values <= SPD_TOLERANCE * variance):
        raise InvalidInputError("covariance is singular at some time; use a damping above 0")
    weights = 1.0 / values
    weights /= weights.mean()
    result = (vectors * weights[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(0.5 * (result + np.swapaxes(result, -1, -2)))
