"""The affine-invariant metric on SPD matrices: ⟨L₁, L₂⟩_P = tr(P⁻¹ L₁ P⁻¹ L₂).

Congruence by any invertible matrix is an isometry: d(C A Cᵀ, C B Cᵀ) = d(A, B). Formulas after Pennec, Fillard &
Ayache, A Riemannian Framework for Tensor Computing, IJCV 2006, and Bhatia, Positive Definite Matrices, 2007, ch. 6.
All functions broadcast over leading axes. Points are SPD, tangents symmetric, both of shape (..., d, d).
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import NotSPDError
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply, congruence, roots, symmetrize
from maniport.validation import Array, as_finite, as_spd, as_symmetric


def distance(a: ArrayLike, b: ArrayLike) -> Array:
    """Geodesic distance d(A, B) = ‖log(A^-½ B A^-½)‖_F = sqrt(Σ log² λ_i(A⁻¹B)).

    Parameters
    ----------
    a, b : array_like, shape (..., d, d)
        SPD; leading axes broadcast.

    Returns
    -------
    ndarray, shape (...)
        Dimensionless: the root of the summed squared logarithms of the axis ratios (of the squared semi-axes).

    Raises
    ------
    NotSPDError
        When a matrix is asymmetric, indefinite or singular.
    """
    points_a = as_spd(a, "a")
    return distance_unchecked(points_a, as_spd(b, "b", dimension=points_a.shape[-1]))


def distance_unchecked(a: Array, b: Array) -> Array:
    """Same as `distance` on float64 arrays that are known to be SPD."""
    # The Cholesky factor whitens as well as A^-½ does (they differ by a rotation) and costs less.
    inverse = np.linalg.inv(np.linalg.cholesky(a))
    values, _ = eigh(congruence(inverse, b))
    if np.any(values <= 0):
        raise NotSPDError("a and b are too ill-conditioned for their distance: rounding makes A⁻¹B indefinite")
    return np.asarray(np.sqrt(np.sum(np.log(values) ** 2, axis=-1)))


def inner(base: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Inner product tr(P⁻¹ L₁ P⁻¹ L₂) of two tangents at `base`; shape (...)."""
    point = as_spd(base, "base")
    d = point.shape[-1]
    one = np.linalg.solve(point, as_symmetric(first, "first", d))
    two = np.linalg.solve(point, as_symmetric(second, "second", d))
    return np.asarray(np.einsum("...ij,...ji->...", one, two))


def log(base: ArrayLike, point: ArrayLike) -> Array:
    """Tangent at `base` that points to `point`: P^½ log(P^-½ M P^-½) P^½."""
    center = as_spd(base, "base")
    root, inverse_root = roots(center)
    whitened = congruence(inverse_root, as_spd(point, "point", center.shape[-1]))
    return congruence(root, apply(whitened, np.log))


def exp(base: ArrayLike, tangent: ArrayLike) -> Array:
    """Point reached from `base` along `tangent`: P^½ exp(P^-½ L P^-½) P^½; the inverse of `log`."""
    center = as_spd(base, "base")
    root, inverse_root = roots(center)
    whitened = congruence(inverse_root, as_symmetric(tangent, "tangent", center.shape[-1]))
    return congruence(root, apply(whitened, np.exp))


def geodesic(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """Point at parameter t on the geodesic from A (t = 0) to B (t = 1): A^½ (A^-½ B A^-½)^t A^½.

    Parameters
    ----------
    a, b : array_like, shape (..., d, d)
        SPD end points.
    t : array_like, shape (...)
        Any real; outside [0, 1] the geodesic is extended.
    """
    start = as_spd(a, "a")
    root, inverse_root = roots(start)
    whitened = congruence(inverse_root, as_spd(b, "b", start.shape[-1]))
    exponent = as_finite(t, "t")[..., None]
    return congruence(root, apply(_broadcast(whitened, exponent[..., None]), lambda values: values**exponent))


def transport(tangent: ArrayLike, start: ArrayLike, end: ArrayLike) -> Array:
    """Parallel transport of a tangent along the geodesic from `start` to `end`: E L Eᵀ, E = (P₂ P₁⁻¹)^½."""
    origin = as_spd(start, "start")
    d = origin.shape[-1]
    return congruence(transporter(origin, as_spd(end, "end", d)), as_symmetric(tangent, "tangent", d))


def transporter(start: Array, end: Array) -> Array:
    """Return E = (P₂ P₁⁻¹)^½, shape (..., d, d), computed as P₁^½ (P₁^-½ P₂ P₁^-½)^½ P₁^-½; input unchecked.

    The symmetric form needs only eigenvalues of SPD matrices; the product P₂ P₁⁻¹ itself is not symmetric.
    """
    root, inverse_root = roots(start)
    return np.asarray(root @ apply(congruence(inverse_root, end), np.sqrt) @ inverse_root)


def _broadcast(matrices: Array, parameter: Array) -> Array:
    """Repeat matrices to the shape that they take against a parameter of shape (..., 1, 1)."""
    return symmetrize(np.broadcast_to(matrices, np.broadcast_shapes(matrices.shape, parameter.shape)))
