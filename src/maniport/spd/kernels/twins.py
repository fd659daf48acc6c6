"""The kernels in plain NumPy: what the compiled loops are compared with, and what runs where rounding has its say.

All take float64 arrays that are not checked, and broadcast over leading axes as the kernels do.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_SWEEPS = 40
EPS2 = float(np.finfo(np.float64).eps) ** 2
BLOCK_BYTES = 32_000_000
NEAR = 1e-3
"""Half the log ratio of two eigenvalues below which x coth x is taken from its series."""


class Moments(NamedTuple):
    """What a step toward the Fréchet mean needs to know about whitened points Y_i with weights w_i.

    Attributes
    ----------
    cost : float
        ½ Σ w d²(Y, I).
    rounding : float
        Σ w size / λ_min(Y), which grows with the rounding of the gradient.
    gradient : ndarray, shape (d, d)
        Σ w log Y, the negative Riemannian gradient of the cost.
    hessian : ndarray, shape (d (d + 1) / 2, d (d + 1) / 2), or None
        Of the cost, in the Mandel basis.
    """

    cost: float
    rounding: float
    gradient: Array
    hessian: Array | None


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
            gap, twice = aqq - app, np.where(turn, 2.0 * apq, 0.0)
            twice = np.where(gap < 0.0, -twice, twice)
            near = np.where(turn, np.abs(gap) + np.sqrt(gap * gap + twice * twice), 1.0)
            tangent = twice / near
            cosine, shift = 1.0 / np.sqrt(1.0 + tangent * tangent), tangent * apq
            rotation = np.broadcast_to(np.eye(d), a.shape).copy()
            rotation[:, p, p] = rotation[:, q, q] = cosine
            rotation[:, p, q] = tangent * cosine
            rotation[:, q, p] = -tangent * cosine
            diagonal = app - shift, aqq + shift
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


def compose_numpy(values: Array, vectors: Array) -> Array:
    """Build V diag(values) Vᵀ, exactly symmetric."""
    return symmetrize((vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2))


def congruence_numpy(left: Array, matrices: Array) -> Array:
    """Build L M Lᵀ, exactly symmetric."""
    return symmetrize(left @ matrices @ np.swapaxes(left, -1, -2))


def symmetrize(matrices: Array) -> Array:
    """Average a matrix with its transpose, to take off rounding."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


class Pair(NamedTuple):
    """Two SPD matrices A = F Fᵀ and B = K Kᵀ: F, F⁻¹, K, K⁻¹ and U, σ, Vᵀ with F⁻¹ K = U diag(σ) Vᵀ; see `factored`."""

    start: Array
    start_inverse: Array
    end: Array
    end_inverse: Array
    left: Array
    singular: Array
    right: Array


def factored(a: Array, b: Array) -> Pair:
    """Factor two SPD matrices, shapes (..., d, d): the eigenvalues of A⁻¹ B are σ².

    No product of both is formed, and nothing squared, so that all of it is as exact as A and B are given.
    """
    (start, start_inverse), (end, end_inverse) = cholesky(a), cholesky(b)
    return Pair(start, start_inverse, end, end_inverse, *np.linalg.svd(start_inverse @ end))


def cholesky(matrices: Array) -> tuple[Array, Array]:
    """Cholesky factors of SPD matrices and their inverses."""
    factors = np.asarray(np.linalg.cholesky(matrices), dtype=np.float64)
    return factors, np.asarray(np.linalg.inv(factors), dtype=np.float64)


def distances_numpy(a: Array, b: Array) -> Array:
    """Affine-invariant distances, as exact as A and B are given."""
    return np.asarray(2.0 * np.linalg.norm(np.log(factored(a, b).singular), axis=-1))


def power_congruence_numpy(left: Array, points: Array, power: float, right: Array) -> Array:
    """Build R (L X Lᵀ)^s Rᵀ; where (L X Lᵀ) is not positive-definite the result is nan."""
    values, vectors = np.linalg.eigh(congruence_numpy(left, points))
    with np.errstate(all="ignore"):
        return congruence_numpy(right, compose_numpy(values**power, vectors))


def moments_numpy(points: Array, whitening: Array, weights: Array, sizes: Array, curved: bool) -> Moments | None:
    """Cost, gradient and (when `curved`) Hessian of the Fréchet mean, over points whitened to W X W.

    None where rounding made a whitened point indefinite.
    """
    d = points.shape[-1]
    values, vectors = np.linalg.eigh(congruence_numpy(whitening, points))
    if not np.all(values > 0):
        return None
    logs = np.log(values)
    cost = 0.5 * float(weights @ np.sum(logs**2, axis=-1))
    gradient = np.einsum("n,nij->ij", weights, compose_numpy(logs, vectors))
    rounding = float(weights @ (sizes / values[:, 0]))
    if not curved:
        return Moments(cost, rounding, gradient, None)
    rows, columns = mandel_indices(d)
    m, own = len(rows), rows == columns
    hessian = np.zeros((m, m))
    block = max(1, BLOCK_BYTES // (8 * m * m))
    for first in range(0, len(points), block):
        v, log, w = (array[first : first + block] for array in (vectors, logs, weights))
        half_gap = 0.5 * (log[:, rows] - log[:, columns])
        small = np.abs(half_gap) < NEAR
        stretch = np.where(small, 1.0 + half_gap**2 / 3, half_gap / np.tanh(np.where(small, 1.0, half_gap)))
        stretch *= w[:, None] * np.where(own, 1.0, 2.0)
        one, other = v[:, rows], v[:, columns]
        turned = one[:, :, rows] * other[:, :, columns] + other[:, :, rows] * one[:, :, columns]
        turned *= np.where(own, 0.5, np.sqrt(0.5))[:, None]
        hessian += np.tensordot(turned * stretch[:, None], turned, axes=([0, 2], [0, 2]))
    return Moments(cost, rounding, gradient, hessian)


@cache
def mandel_indices(d: int) -> tuple[IntArray, IntArray]:
    """Row and column of each entry of a Mandel vector: the diagonal first, then the rows of the triangle above it."""
    found = tuple(np.r_[np.arange(d), above] for above in np.triu_indices(d, 1))
    for indices in found:
        indices.flags.writeable = False
    return found[0], found[1]


@cache
def mandel_basis(d: int) -> Array:
    """Orthonormal basis of the symmetric matrices, shape (d (d + 1) / 2, d, d)."""
    rows, columns = mandel_indices(d)
    basis = np.zeros((len(rows), d, d))
    entry = np.arange(len(rows))
    basis[entry, rows, columns] = basis[entry, columns, rows] = np.where(rows == columns, 1.0, np.sqrt(0.5))
    basis.flags.writeable = False
    return basis
