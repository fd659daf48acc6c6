"""Fast operations on batches of small symmetric matrices, unchecked; private to maniport.

`loops` has the compiled loops and `threads` divides large batches among threads. The same bits come from any batch and
any number of threads.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels.loops import compose_loop, congruence_loop, distance_loop, eigh_loop, hessian_loop
from maniport.spd.kernels.threads import in_parts
from maniport.validation import Array

T = TypeVar("T")

MIN_EIGENVALUE, MAX_EIGENVALUE = 1e-150, 1e150
"""Range of the eigenvalues that an exponential or power may produce."""

ILL_CONDITIONED = "the matrices are too ill-conditioned together: rounding makes one indefinite"


class Moments(NamedTuple):
    """Terms of a step toward the Fréchet mean, from whitened points Y_i with weights w_i.

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

    def plus(self, other: "Moments") -> "Moments":
        """Add those of other points."""
        hessian = None if self.hessian is None or other.hessian is None else self.hessian + other.hessian
        sums = self.cost + other.cost, self.rounding + other.rounding, self.gradient + other.gradient
        return Moments(*sums, hessian)


class Pair(NamedTuple):
    """Two SPD matrices A = F Fᵀ and B = K Kᵀ: F, F⁻¹, K, K⁻¹ and U, σ, Vᵀ with F⁻¹ K = U diag(σ) Vᵀ; see `factored`."""

    start: Array
    start_inverse: Array
    end: Array
    end_inverse: Array
    left: Array
    singular: Array
    right: Array


def eigh(matrices: Array) -> tuple[Array, Array]:
    """Compute eigenvalues and eigenvectors of symmetric matrices.

    Parameters
    ----------
    matrices : ndarray, shape (..., d, d)
        Symmetric, finite, unchecked. Only the upper triangle is read.

    Returns
    -------
    values : ndarray, shape (..., d)
        Ascending.
    vectors : ndarray, shape (..., d, d)
        Orthonormal columns, in the order of the values.
    """
    flat = _flat(matrices)
    values, vectors = np.empty(flat.shape[:-1]), np.empty(flat.shape)
    _run(lambda part: eigh_loop(flat[part], values[part], vectors[part]), *flat.shape[:2])
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


def compose(values: Array, vectors: Array) -> Array:
    """Build V diag(values) Vᵀ, exactly symmetric; shapes (..., n) and (..., d, n)."""
    d, n = vectors.shape[-2:]
    batch = _common(values.shape[:-1], vectors.shape[:-2])
    flat_values = _writable(_over(values, (*batch, n))).reshape(-1, n)
    flat = _writable(_over(vectors, (*batch, d, n))).reshape(-1, d, n)
    results = np.empty((len(flat), d, d))
    _run(lambda part: compose_loop(flat_values[part], flat[part], results[part]), *flat.shape[:2])
    return results.reshape(*batch, d, d)


def congruence(left: Array, matrices: Array) -> Array:
    """Build L M Lᵀ, exactly symmetric, of symmetric M; shapes (..., d, d)."""
    batch, factors, flat = _pairs(left, matrices)
    results = np.empty((math.prod(batch), *matrices.shape[-2:]))
    _run(lambda part: congruence_loop(_rows(factors, part), _rows(flat, part), results[part]), *results.shape[:2])
    return results.reshape(*batch, *matrices.shape[-2:])


def distances(a: Array, b: Array) -> Array:
    """Affine-invariant distances sqrt(Σ log² λ_i(A⁻¹B)) of SPD matrices, shapes (..., d, d); shape (...)."""
    d = a.shape[-1]
    batch, flat_a, flat_b = _pairs(a, b)
    count = math.prod(batch)
    results = np.empty(count)
    _run(lambda part: distance_loop(_rows(flat_a, part), _rows(flat_b, part), results[part]), count, d)
    results = results.reshape(batch)
    if np.any(rough := np.isnan(results)):
        pair = (np.broadcast_to(points, (*batch, d, d))[rough] for points in (a, b))
        try:
            results[rough] = 2.0 * np.linalg.norm(np.log(factored(*pair).singular), axis=-1)
        except np.linalg.LinAlgError:
            raise NotSPDError(ILL_CONDITIONED) from None
    return results


def power_congruence(left: Array, points: Array, exponent: float, right: Array, name: str = "points") -> Array:
    """Build R (L X Lᵀ)^s Rᵀ: recentre, dilate, rotate and move."""
    flat, first, last = _flat(points), _flat(left), _flat(right)
    results = np.empty(flat.shape)

    def work(part: slice) -> None:
        moved, values = np.empty(flat[part].shape), np.empty(flat[part].shape[:-1])
        congruence_loop(first, flat[part], moved)
        eigh_loop(moved, values, moved)
        if not np.all(values[:, 0] > 0.0):
            raise NotSPDError(f"{name} are too ill-conditioned: rounding makes them indefinite when they are recentred")
        with np.errstate(over="ignore", under="ignore"):
            raised = values**exponent
        require_in_range(raised, name)
        compose_loop(raised, last @ moved, results[part])

    _run(work, *flat.shape[:2])
    return results.reshape(points.shape)


def moments(points: Array, whitening: Array, weights: Array, sizes: Array, curved: bool) -> Moments | None:
    """Cost, gradient and (when `curved`) Hessian of the Fréchet mean, over points whitened to W X W."""
    flat, inner, d = _flat(points), _flat(whitening), points.shape[-1]
    weights = _writable(weights)

    def work(part: slice) -> Moments | None:
        vectors, values, w = np.empty(flat[part].shape), np.empty(flat[part].shape[:-1]), weights[part]
        congruence_loop(inner, flat[part], vectors)
        eigh_loop(vectors, values, vectors)
        if not np.all(values[:, 0] > 0.0):
            return None
        logs = np.log(values)
        cost, rounding = 0.5 * float(w @ np.sum(logs**2, axis=-1)), float(w @ (sizes[part] / values[:, 0]))
        weighted = np.empty(vectors.shape)
        compose_loop(w[:, None] * logs, vectors, weighted)
        gradient = weighted.sum(axis=0)
        if not curved:
            return Moments(cost, rounding, gradient, None)
        m = d * (d + 1) // 2
        rows = np.empty((len(w), m, m))
        hessian_loop(values, logs, vectors, w, rows)
        rows = rows.reshape(-1, m)
        return Moments(cost, rounding, gradient, rows.T @ rows)

    total: Moments | None = None
    for one in _run(work, *flat.shape[:2]):
        if one is None:
            return None
        total = one if total is None else total.plus(one)
    return total


def require_in_range(eigenvalues: Array, name: str) -> None:
    """Raise, naming the argument, where the eigenvalues of a result would overflow or vanish."""
    bad = (eigenvalues < MIN_EIGENVALUE) | (eigenvalues > MAX_EIGENVALUE)
    if np.any(bad):
        raise InvalidInputError(
            f"{name} takes the result out of range: an eigenvalue would be {eigenvalues[bad][0]:.3g}; "
            f"allowed are {MIN_EIGENVALUE:g} to {MAX_EIGENVALUE:g}"
        )


def factored(a: Array, b: Array) -> Pair:
    """Factor two SPD matrices, shapes (..., d, d): the eigenvalues of A⁻¹ B are σ²."""
    (start, start_inverse), (end, end_inverse) = cholesky(a), cholesky(b)
    return Pair(start, start_inverse, end, end_inverse, *np.linalg.svd(start_inverse @ end))


def cholesky(matrices: Array) -> tuple[Array, Array]:
    """Cholesky factors of SPD matrices and their inverses."""
    factors = np.asarray(np.linalg.cholesky(matrices), dtype=np.float64)
    return factors, np.asarray(np.linalg.inv(factors), dtype=np.float64)


def symmetrize(matrices: Array) -> Array:
    """Average a matrix with its transpose, to remove rounding."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


@cache
def mandel_indices(d: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
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


def _run(work: Callable[[slice], T], count: int, d: int) -> list[T]:
    """Call work(part) on slices of a flat batch, see `in_parts`."""
    return in_parts(lambda first, last: work(slice(first, last)), count, d)


def _pairs(a: Array, b: Array) -> tuple[tuple[int, ...], Array, Array]:
    """Flatten matrices that broadcast; return the shape of the batch, too. One matrix for all stays one."""
    d = a.shape[-1]
    batch = _common(a.shape[:-2], b.shape[:-2])
    first, second = (_flat(one if one.size == d * d else _over(one, (*batch, d, d))) for one in (a, b))
    return batch, first, second


def _rows(matrices: Array, part: slice) -> Array:
    return matrices if len(matrices) == 1 else matrices[part]


def _writable(array: Array) -> Array:
    """Contiguous and writable: of a read-only array Numba would make another type, and compile again."""
    contiguous = np.ascontiguousarray(array, dtype=np.float64)
    return contiguous if contiguous.flags.writeable and contiguous.flags.aligned else contiguous.copy()


def _flat(matrices: Array) -> Array:
    d = matrices.shape[-1]
    return _writable(matrices).reshape(-1, d, d)


def _over(array: Array, shape: tuple[int, ...]) -> Array:
    return array if array.shape == shape else np.broadcast_to(array, shape)


def _common(one: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a batch from two that broadcast; equal ones without NumPy's detour, which costs more than a matrix."""
    return one if one == other else np.broadcast_shapes(one, other)
