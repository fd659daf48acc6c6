"""The affine-invariant metric on SPD matrices: ⟨L₁, L₂⟩_P = tr(P⁻¹ L₁ P⁻¹ L₂).

Congruence by any invertible matrix is an isometry: d(C A Cᵀ, C B Cᵀ) = d(A, B). Formulas after Pennec, Fillard &
Ayache, A Riemannian Framework for Tensor Computing, IJCV 2006, and Bhatia, Positive Definite Matrices, 2007, ch. 6.
All functions broadcast over leading axes. Points are SPD, tangents symmetric, both of shape (..., d, d).
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import NotSPDError
from maniport.spd.kernels import ILL_CONDITIONED, compose, congruence, distances, eigh
from maniport.spd.matrix_functions import apply, bounded, roots
from maniport.validation import Array, as_finite, as_spd, as_symmetric, require_broadcast


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
    points_a = as_spd(a, "a", copy=False)
    points_b = as_spd(b, "b", points_a.shape[-1], copy=False)
    require_broadcast(a=points_a, b=points_b)
    return distance_unchecked(points_a, points_b)


def distance_unchecked(a: Array, b: Array) -> Array:
    """Same as `distance` on float64 arrays that are known to be SPD."""
    return distances(a, b)


def inner(base: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array:
    """Inner product tr(P⁻¹ L₁ P⁻¹ L₂) of two tangents at `base`; shape (...)."""
    point = as_spd(base, "base")
    d = point.shape[-1]
    left, right = as_symmetric(first, "first", d), as_symmetric(second, "second", d)
    require_broadcast(base=point, first=left, second=right)
    return np.asarray(np.einsum("...ij,...ji->...", np.linalg.solve(point, left), np.linalg.solve(point, right)))


def log(base: ArrayLike, point: ArrayLike) -> Array:
    """Tangent at `base` that points to `point`: P^½ log(P^-½ M P^-½) P^½."""
    center = as_spd(base, "base")
    other = as_spd(point, "point", center.shape[-1])
    require_broadcast(base=center, point=other)
    root, inverse_root = roots(center)
    values, vectors = whitened_eigh(inverse_root, other)
    return congruence(root, compose(np.log(values), vectors))


def exp(base: ArrayLike, tangent: ArrayLike) -> Array:
    """Point reached from `base` along `tangent`: P^½ exp(P^-½ L P^-½) P^½; the inverse of `log`."""
    center = as_spd(base, "base")
    step = as_symmetric(tangent, "tangent", center.shape[-1])
    require_broadcast(base=center, tangent=step)
    root, inverse_root = roots(center)
    return congruence(root, apply(congruence(inverse_root, step), bounded(np.exp, "tangent")))


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
    end = as_spd(b, "b", start.shape[-1])
    exponent = as_finite(t, "t")[..., None]
    require_broadcast(a=start, b=end, t=exponent[..., None])
    root, inverse_root = roots(start)
    values, vectors = whitened_eigh(inverse_root, end)
    powers = bounded(lambda values: values**exponent, "t")(values)
    return congruence(root, compose(powers, vectors))


def transport(tangent: ArrayLike, start: ArrayLike, end: ArrayLike) -> Array:
    """Parallel transport of a tangent along the geodesic from `start` to `end`: E L Eᵀ, E = (P₂ P₁⁻¹)^½."""
    origin = as_spd(start, "start")
    target = as_spd(end, "end", origin.shape[-1])
    vector = as_symmetric(tangent, "tangent", origin.shape[-1])
    require_broadcast(tangent=vector, start=origin, end=target)
    return congruence(transporter(origin, target), vector)


def transporter(start: Array, end: Array) -> Array:
    """Return E = (P₂ P₁⁻¹)^½, shape (..., d, d), computed as P₁^½ (P₁^-½ P₂ P₁^-½)^½ P₁^-½; input unchecked.

    The symmetric form needs only eigenvalues of SPD matrices; the product P₂ P₁⁻¹ itself is not symmetric.
    """
    root, inverse_root = roots(start)
    values, vectors = whitened_eigh(inverse_root, end)
    return np.asarray(root @ compose(np.sqrt(values), vectors) @ inverse_root)


def whitened_eigh(inverse_root: Array, points: Array) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of P^-½ X P^-½, given P^-½; the values are the axis ratios squared."""
    values, vectors = eigh(congruence(inverse_root, points))
    if not np.all(values > 0):
        raise NotSPDError(ILL_CONDITIONED)
    return values, vectors
