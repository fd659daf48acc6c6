"""Tangent spaces in whitened Mandel coordinates, covariances in them, and the weights of a tracking task.

The coordinates of X at P are vec(log(P^-½ X P^-½)), a vector of m = d (d + 1) / 2 whose length is the affine-invariant
distance. Parallel transport from P₁ to P₂ along their geodesic, E L Eᵀ with E = (P₂ P₁⁻¹)^½, becomes a rotation of
them: V → Q V Qᵀ with Q = P₂^-½ E P₁^½ = P₂^-½ P₁^½ (P₁^-½ P₂ P₁^-½)^½, which is orthogonal.

A tracking task has the error e = vec(log(M^-½ A M^-½)) with the present ellipsoid M and the target A. The covariance C
of a profile is that of v = vec(log(A^-½ M A^-½)), the same tangent vector, up to sign, before transport from M to
A. So vᵀ C⁻¹ v = eᵀ Ô C⁻¹ Ôᵀ e, where Ô acts on Mandel vectors as the orthogonal polar factor of M^-½ A^½ does
(equation 27 of docs/method/objective.md). It rotates by 0.7°, 2.6° and 6.0° at distances of 0.12, 0.47 and 1.1
(median of 500 random pairs of 3×3).
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import mandel_basis
from maniport.spd.matrix_functions import compose, congruence, roots, to_vector
from maniport.util.validation import SPD_TOLERANCE, Array, as_finite, as_number, as_spd, require_broadcast


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


def tracking_weights(covariance: ArrayLike, damping: float = 0.1, root: bool = False) -> Array:
    """Return the weights of a tracking task: large where demonstrations agree.

    Parameters
    ----------
    covariance : array_like, shape (n, m, m)
        Of a profile, in whitened Mandel coordinates at its ellipsoids; see `ProfileGMM.predict`.
    damping : float
        ρ ≥ 0: the weights are (C + ρ c I)⁻¹, c the mean variance over all times and directions. A direction has at most
        1 + 1 / ρ times the weight of one of mean variance.
    root : bool
        Return W^½, symmetric, for tasks that multiply error and Jacobian by a matrix before squaring them.

    Returns
    -------
    ndarray, shape (n, m, m)
        W, dimensionless, for the cost eᵀ W e of the error e = vec(log(M^-½ M_target M^-½)); its mean weight, tr(W) / m
        averaged over the n times, is one. On the basis of e, see `weights_at`.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a covariance is not symmetric positive-semidefinite, all are zero, or one is singular without damping.
    """
    matrices = _as_covariance(covariance)
    rho = as_number(damping, "damping", minimum=0.0)
    values, vectors = np.linalg.eigh(matrices)
    values = values / max(float(np.abs(values).max()), np.finfo(np.float64).tiny)  # weights have no unit
    variance = float(values.mean())
    if variance <= 0:
        raise InvalidInputError("covariance must not be zero at all times")
    values = np.maximum(values, 0.0) + rho * variance
    if np.any(values <= SPD_TOLERANCE * variance):
        raise InvalidInputError("covariance is singular at some time; use a damping above 0")
    weights = 1.0 / values
    weights /= weights.mean()
    weights = np.sqrt(weights) if root else weights
    result = (vectors * weights[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(0.5 * (result + np.swapaxes(result, -1, -2)))


def weights_at(weights: ArrayLike, target: ArrayLike, achieved: ArrayLike) -> Array:
    """Rotate weights, or covariances, from the target ellipsoids' tangent basis to the achieved ones'.

    Parameters
    ----------
    weights : array_like, shape (..., m, m)
        W or W^½ in whitened Mandel coordinates at `target`.
    target, achieved : array_like, shape (..., d, d)
        SPD; leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., m, m)
        Ô W Ôᵀ for the error vec(log(M^-½ M_target M^-½)).
    """
    start = as_spd(target, "target")
    end = as_spd(achieved, "achieved", start.shape[-1])
    require_broadcast(target=start, achieved=end)
    matrices = _as_covariance(weights, "weights", start.shape[-1])
    basis = on_vectors(turns(start, end))
    require_broadcast(weights=matrices, basis=basis)
    return np.asarray(basis @ matrices @ np.swapaxes(basis, -1, -2))


def covariance_tensor(ellipsoids: ArrayLike, covariance: ArrayLike) -> Array:
    """Write a covariance as the 4th-order tensor E[L_ij L_kl] of tangents L = log_P(X) at the ellipsoids P.

    Under a congruence of all data by C it becomes C_ia C_jb C_kc C_ld S_abcd, while the matrix of `covariance` depends
    on the choice of basis, here L = P^½ V P^½ with the Mandel vector of V.

    Parameters
    ----------
    ellipsoids : array_like, shape (..., d, d)
        SPD.
    covariance : array_like, shape (..., m, m)
        In whitened Mandel coordinates at the ellipsoids, m = d (d + 1) / 2.

    Returns
    -------
    ndarray, shape (..., d, d, d, d)
        Symmetric in its first two, its last two, and the two pairs of indices.
    """
    points = as_spd(ellipsoids, "ellipsoids")
    matrices = _as_covariance(covariance, "covariance", points.shape[-1])
    require_broadcast(ellipsoids=points, covariance=matrices)
    basis = congruence(roots(points)[0][..., None, :, :], mandel_basis(points.shape[-1]))
    return np.asarray(np.einsum("...ab,...aij,...bkl->...ijkl", matrices, basis, basis, optimize=True))


def _as_covariance(value: ArrayLike, name: str = "covariance", d: int | None = None) -> Array:
    """Convert to symmetric positive-semidefinite matrices (..., m, m); m may exceed the sizes of ellipsoids."""
    array = as_finite(value, name)
    size = "m" if d is None else str(d * (d + 1) // 2)
    if array.ndim < 2 or array.shape[-1] != array.shape[-2] or (d is not None and array.shape[-1] != int(size)):
        raise InvalidInputError(f"{name} must have shape (..., {size}, {size}); found {array.shape}")
    if not array.size:
        raise InvalidInputError(f"{name} must not be empty; found shape {array.shape}")
    transposed = np.swapaxes(array, -1, -2)
    scale = np.abs(array).max(axis=(-1, -2))
    gap = np.abs(array - transposed).max(axis=(-1, -2))
    if np.any(gap > 1e-8 * scale):
        raise NotSPDError(f"{name} must be symmetric; found |A - Aᵀ| up to {gap.max():.3g}")
    symmetric = 0.5 * (array + transposed)
    lowest = np.linalg.eigvalsh(symmetric)[..., 0]
    if np.any(lowest < -1e-10 * scale):
        raise NotSPDError(f"{name} must have no negative eigenvalue; found {lowest.min():.3g}")
    return np.asarray(symmetric)
