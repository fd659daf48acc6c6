"""The affine-invariant metric on SPD matrices: ⟨L₁, L₂⟩_P = tr(P⁻¹ L₁ P⁻¹ L₂).

Congruence by any invertible matrix is an isometry: d(C A Cᵀ, C B Cᵀ) = d(A, B). Formulas after Pennec, Fillard &
Ayache, A Riemannian Framework for Tensor Computing, IJCV 2006, and Bhatia, Positive Definite Matrices, 2007, ch. 6.
All functions broadcast over leading axes. Points are SPD, tangents symmetric, both of shape (..., d, d).

Any factor F of P = F Fᵀ whitens as P^½ does. The singular values of F⁻¹ K for Q = K Kᵀ lose no more than rounding moves
the points themselves, some eps (κ_P + κ_Q). Where that is a distance of more than 0.01, there is an error.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from maniport.errors import NotSPDError
from maniport.spd.kernels import (
    FactoredPair,
    cholesky,
    compose,
    congruence,
    distances,
    eigh,
    factored,
    roots,
)
from maniport.spd.matrix_functions import apply, bounded, logarithm, to_vector
from maniport.util.validation import (
    Array,
    as_finite,
    as_scalar,
    as_spd,
    as_symmetric,
    require_broadcast,
)


def distance(a: ArrayLike, b: ArrayLike) -> Array | np.float64:
    """Geodesic distance d(A, B) = ‖log(A^-½ B A^-½)‖_F = sqrt(Σ log² λ_i(A⁻¹B)).

    Parameters
    ----------
    a, b : array_like, shape (..., d, d)
        SPD; leading axes broadcast.

    Returns
    -------
    ndarray, shape (...), or float for two matrices
        Dimensionless: the root of the summed squared logarithms of the axis ratios (of the squared semi-axes).

    Raises
    ------
    NotSPDError
        When a matrix is asymmetric, indefinite or singular.
    """
    points_a = as_spd(a, "a", copy=False)
    points_b = as_spd(b, "b", points_a.shape[-1], copy=False)
    require_broadcast(a=points_a, b=points_b)
    return as_scalar(distances(points_a, points_b))


Indices = NDArray[np.intp]
distance_unchecked = distances  # Same as `distance` on float64 arrays that are known to be SPD


def inner(base: ArrayLike, first: ArrayLike, second: ArrayLike) -> Array | np.float64:
    """Inner product tr(P⁻¹ L₁ P⁻¹ L₂) of two tangents.

    Parameters
    ----------
    base : array_like, shape (..., d, d)
        SPD.
    first, second : array_like, shape (..., d, d)
        Symmetric, at `base`.

    Returns
    -------
    ndarray, shape (...), or float for one point
    """
    point = as_spd(base, "base")
    d = point.shape[-1]
    left = as_symmetric(first, "first", d)
    right = as_symmetric(second, "second", d)
    require_broadcast(base=point, first=left, second=right)
    products = np.einsum(
        "...ij,...ji->...", np.linalg.solve(point, left), np.linalg.solve(point, right)
    )
    return as_scalar(np.asarray(products))


def log(base: ArrayLike, point: ArrayLike) -> Array:
    """Tangent at `base` that points to `point`: P^½ log(P^-½ M P^-½) P^½.

    Parameters
    ----------
    base, point : array_like, shape (..., d, d)
        SPD; leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., d, d)
        Symmetric; its length at `base` is the distance of both.

    Raises
    ------
    NotSPDError
        When a matrix is not SPD, or so ill-conditioned that rounding moves the end of the tangent by more than 0.01:
        from a condition number of about 2e12 on.
    """
    center = as_spd(base, "base")
    other = as_spd(point, "point", center.shape[-1])
    require_broadcast(base=center, point=other)
    pair, _ = _factored(center, other)
    return congruence(pair.start, compose(2.0 * np.log(pair.singular), pair.left))


def exp(base: ArrayLike, tangent: ArrayLike) -> Array:
    """Point reached from `base` along `tangent`: P^½ exp(P^-½ L P^-½) P^½; the inverse of `log`.

    Parameters
    ----------
    base : array_like, shape (..., d, d)
        SPD.
    tangent : array_like, shape (..., d, d)
        Symmetric.

    Returns
    -------
    ndarray, shape (..., d, d)

    Raises
    ------
    NotSPDError
        When `base` is not SPD, or rounding may move the result by more than 0.01: geodesics diverge.
    """
    center = as_spd(base, "base")
    step = as_symmetric(tangent, "tangent", center.shape[-1])
    require_broadcast(base=center, tangent=step)
    factor, inverse = cholesky(center)
    logs, vectors = eigh(congruence(inverse, step))
    moved = (
        _rounding(center, inverse) * np.maximum(1.0, np.abs(logs).max(axis=-1)) * _growth(logs, 1.0)
    )
    return _point(factor, inverse, bounded(np.exp, "tangent")(logs), vectors, moved)


def geodesic(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """Point at parameter t on the geodesic from A (t = 0) to B (t = 1): A^½ (A^-½ B A^-½)^t A^½.

    Parameters
    ----------
    a, b : array_like, shape (..., d, d)
        SPD end points.
    t : array_like, shape (...)
        Any real; outside [0, 1] the geodesic is extended.

    Returns
    -------
    ndarray, shape (..., d, d)

    Raises
    ------
    NotSPDError
        When an end is not SPD, or so ill-conditioned that rounding moves the result by more than 0.01.
    """
    start = as_spd(a, "a")
    end = as_spd(b, "b", start.shape[-1])
    exponent = as_finite(t, "t")[..., None]
    require_broadcast(a=start, b=end, t=exponent[..., None])
    pair, moved = _factored(start, end)
    logs = 2.0 * np.log(pair.singular)
    beyond = np.maximum(np.abs(exponent), np.abs(1.0 - exponent))[..., 0]
    moved = moved * np.maximum(1.0, _growth(logs, beyond) / _growth(logs, 1.0))
    powers = bounded(lambda logs: np.exp(exponent * logs), "t")(logs)
    return _point(pair.start, pair.start_inverse, powers, pair.left, moved)


def transport(tangent: ArrayLike, start: ArrayLike, end: ArrayLike) -> Array:
    """Parallel transport of a tangent along the geodesic from `start` to `end`: E L Eᵀ, E = (P₂ P₁⁻¹)^½.

    Parameters
    ----------
    tangent : array_like, shape (..., d, d)
        Symmetric, at `start`.
    start, end : array_like, shape (..., d, d)
        SPD; leading axes broadcast.

    Returns
    -------
    ndarray, shape (..., d, d)
        Symmetric, at `end`.

    Raises
    ------
    NotSPDError
        When an end is not SPD, or so ill-conditioned that rounding changes the result by more than 0.01 of its length.
    """
    origin = as_spd(start, "start")
    target = as_spd(end, "end", origin.shape[-1])
    vector = as_symmetric(tangent, "tangent", origin.shape[-1])
    require_broadcast(tangent=vector, start=origin, end=target)
    pair, _ = _factored(origin, target)
    # (P₂ P₁⁻¹)^½ = K (V Uᵀ) F⁻¹ with P₁ = F Fᵀ, P₂ = K Kᵀ and F⁻¹ K = U σ Vᵀ: no root, and no product, of both points
    turn = np.swapaxes(pair.left @ pair.right, -1, -2)
    return congruence(pair.end @ turn, congruence(pair.start_inverse, vector))


class NeighborIndex:
    """Exact nearest neighbors among SPD matrices under the affine-invariant distance."""

    def __init__(self, points: Array):
        self.points = points
        # A congruence changes no affine-invariant distance, and about the identity the two metrics agree best.
        _, self._whitening = roots(apply(apply(points, np.log).mean(axis=0), np.exp))
        self._cloud, vectors = self._seen(points)
        self._tree = cKDTree(vectors)

    def query(self, queries: Array) -> tuple[Indices, Array]:
        """For every query, shape (n, d, d), the index of the nearest point and the distance to it, shapes (n,)."""
        queried, vectors = self._seen(queries)
        best = np.zeros(len(queried), np.intp)
        distance = np.full(len(queried), np.inf)
        open_queries = np.arange(len(queried))
        count = min(8, len(self._cloud))
        while len(open_queries):
            block = max(1, 16_000_000 // (count * queried[0].nbytes))  # bounds the memory [bytes]
            still_open = []
            for part in np.split(open_queries, range(block, len(open_queries), block)):
                lower, candidates = self._tree.query(vectors[part], k=[*range(1, count + 1)])
                distances = distance_unchecked(queried[part][:, None], self._cloud[candidates])
                choice = np.argmin(distances, axis=1)
                rows = np.arange(len(part))
                best[part] = candidates[rows, choice]
                distance[part] = distances[rows, choice]
                still_open.append(part[lower[:, -1] < distance[part]])
            if count == len(self._cloud):
                break
            open_queries = np.concatenate(still_open)
            count = min(4 * count, len(self._cloud))
        return best, distance

    def _seen(self, points: Array) -> tuple[Array, Array]:
        """Return points (n, d, d) about the identity, and the vectors of their logarithms."""
        whitened = congruence(self._whitening, points)
        return whitened, to_vector(logarithm(whitened))


def nearest(queries: Array, points: Array) -> tuple[Indices, Array]:
    """Index of the nearest of `points` (m, d, d) and the distance to it, for every query (n, d, d)."""
    return NeighborIndex(points).query(queries)


def whitened_eigh(inverse_root: Array, points: Array) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of P^-½ X P^-½, given P^-½; raises where they are not exact. Input unchecked."""
    values, vectors = eigh(congruence(inverse_root, points))
    with np.errstate(divide="ignore", over="ignore"):
        _require_exact(_rounding(points, inverse_root) / np.maximum(values[..., 0], 0.0))
    return values, vectors


def _factored(start: Array, end: Array) -> tuple[FactoredPair, Array]:
    """Factor two points; also return how far rounding may move them, and raise where that is too far."""
    pair = factored(start, end)
    moved = _rounding(start, pair.start_inverse) + _rounding(end, pair.end_inverse)
    _require_exact(moved)
    return pair, moved


def _point(factor: Array, inverse: Array, values: Array, vectors: Array, moved: Array) -> Array:
    """Return F V diag(values) Vᵀ Fᵀ; raises where rounding, its own included, moves it too far."""
    result = compose(values, factor @ vectors)
    undone = np.swapaxes(vectors, -1, -2) @ inverse / np.sqrt(values)[..., None]
    _require_exact(moved + _rounding(result, undone))
    return result


def _rounding(matrices: Array, inverse: Array) -> Array:
    """Bound the distance by which rounding moves A, given G with A⁻¹ = Gᵀ G: tr(A) tr(A⁻¹) bounds the condition."""
    per_condition = 8.0 * float(np.finfo(np.float64).eps)  # measured against fifty digits
    return np.asarray(
        per_condition * np.trace(matrices, axis1=-2, axis2=-1) * np.sum(inverse**2, axis=(-2, -1))
    )


def _growth(logarithms: Array, t: Array | float) -> Array:
    """Growth of a Jacobi field at t times a tangent with these eigenvalues: sinh(t x) / x."""
    x = np.maximum(0.5 * (logarithms.max(axis=-1) - logarithms.min(axis=-1)), 1e-6)
    with np.errstate(over="ignore"):
        return np.asarray(np.sinh(t * x) / x)


def _require_exact(moved: Array, tolerance: float = 0.01) -> None:
    """Raise where rounding moves a result by more than a tolerable distance."""
    if not np.all(moved <= tolerance):
        raise NotSPDError(
            f"the matrices are too ill-conditioned together: rounding may move the result by {np.max(moved):.2g}; "
            f"allowed is a distance of {tolerance:g}"
        )
