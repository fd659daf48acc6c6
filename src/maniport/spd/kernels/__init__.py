"""Fast operations on batches of small symmetric matrices, unchecked; private to maniport.

`loops` has the compiled loops; large batches are divided among threads. The same bits come from any batch and any
number of threads.
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import config
from numpy.typing import NDArray

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels.loops import (
    WIDTH,
    compose_loop,
    congruence_loop,
    distance_loop,
    eigh_loop,
    power_congruence_loop,
    release_loop,
)
from maniport.util.validation import Array

MIN_EIGENVALUE, MAX_EIGENVALUE = 1e-150, 1e150  # Range of the eigenvalues that an exponential or power may produce

ILL_CONDITIONED = "the matrices are too ill-conditioned together: rounding makes one indefinite"


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
    """Ascending eigenvalues and orthonormal eigenvectors (columns) of symmetric matrices (..., d, d)."""
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
    _run(lambda part: compose_loop(flat_values[part], flat[part], results[part]), *results.shape[:2])
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
    results = np.empty(math.prod(batch))
    _run(lambda part: distance_loop(_rows(flat_a, part), _rows(flat_b, part), results[part]), len(results), d)
    results = results.reshape(batch)
    if np.any(rough := np.isnan(results)):
        pair = (np.broadcast_to(points, (*batch, d, d))[rough] for points in (a, b))
        try:
            results[rough] = 2.0 * np.linalg.norm(np.log(factored(*pair).singular), axis=-1)
        except np.linalg.LinAlgError:
            raise NotSPDError(ILL_CONDITIONED) from None
    return results


def power_congruence(left: Array, points: Array, exponent: float, right: Array) -> Array:
    """Build R (L X Lᵀ)^s Rᵀ for matrices X (..., d, d), exactly symmetric: recenter, dilate, rotate and move."""
    flat, factors, invalid = _flat(points), (_flat(left), _writable(right)), list[float]()
    results = np.empty(flat.shape)

    def fill(part: slice) -> None:
        bounds = MIN_EIGENVALUE, MAX_EIGENVALUE
        value = power_congruence_loop(factors[0], flat[part], exponent, factors[1], *bounds, results[part])
        if not np.isnan(value):
            invalid.append(value)

    _run(fill, len(flat), flat.shape[-1])
    if invalid:
        if min(invalid) < 0.0:
            raise NotSPDError("points are too ill-conditioned: rounding makes them indefinite when they are recentered")
        require_in_range(np.array(invalid), "points")
    return results.reshape(points.shape)


def release(points: Array, epsilon: float) -> Array:
    """Take damping ε off SPD matrices (..., d, d): an eigenvalue becomes the y with y (y + ε) / (y + κ ε) equal to it.

    Subtracting ε I would make images of a map indefinite where they are flatter than the damping.
    """
    flat = _flat(points)
    results = np.empty(flat.shape)
    _run(lambda part: release_loop(flat[part], epsilon, results[part]), *flat.shape[:2])
    return results.reshape(points.shape)


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
    orders = tuple(np.r_[np.arange(d), above] for above in np.triu_indices(d, 1))
    for indices in orders:
        indices.flags.writeable = False
    return orders[0], orders[1]


@cache
def mandel_basis(d: int) -> Array:
    """Orthonormal basis of the symmetric matrices, shape (d (d + 1) / 2, d, d)."""
    rows, columns = mandel_indices(d)
    basis = np.zeros((len(rows), d, d))
    entry = np.arange(len(rows))
    basis[entry, rows, columns] = basis[entry, columns, rows] = np.where(rows == columns, 1.0, np.sqrt(0.5))
    basis.flags.writeable = False
    return basis


def _run(work: Callable[[slice], None], count: int, d: int) -> None:
    """Call work(part) on slices of a batch of `count` d×d matrices, by several threads where that pays."""
    size = WIDTH * max(1, 65_000 // (WIDTH * d**3))  # parts of some 0.1 ms, which stay in the processor's cache
    if 0 < count <= size:
        work(slice(0, count))
        return
    parts = [slice(first, min(first + size, count)) for first in range(0, count, size)]
    threads = min(int(config.NUMBA_NUM_THREADS), len(parts) // 8)

    def take(several: Sequence[slice]) -> None:
        for part in several:
            work(part)

    if threads < 2:
        take(parts)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(take, [parts[i::threads] for i in range(threads)]))


def _pairs(a: Array, b: Array) -> tuple[tuple[int, ...], Array, Array]:
    """Flatten matrices that broadcast; return the shape of the batch, too. One matrix for all stays one."""
    d = a.shape[-1]
    batch = _common(a.shape[:-2], b.shape[:-2])
    first, second = (_flat(x if x.size == d * d else _over(x, (*batch, d, d))) for x in (a, b))
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


def _common(shape: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a batch from two that broadcast; equal ones without NumPy's detour, which costs more than a matrix."""
    return shape if shape == other else np.broadcast_shapes(shape, other)
