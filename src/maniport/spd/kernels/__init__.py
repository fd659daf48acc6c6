"""Fast operations on batches of small symmetric matrices, unchecked; private to maniport.

`loops` has the compiled loops; large batches are divided among threads. The same bits come from any batch and any
number of threads.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numba import config

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels.loops import (
    WIDTH,
    compose_loop,
    congruence_loop,
    eigh_loop,
    log_norm_loop,
    raise_loop,
    release_loop,
    whiten_loop,
)
from maniport.util.validation import SPD_TOLERANCE, Array

# Range of the eigenvalues that an exponential or power may produce
MIN_EIGENVALUE = 1e-150
MAX_EIGENVALUE = 1e150
# Share of the trace up to which an eigenvalue may be a zero that was rounded up
ROUNDED = 0.1 * SPD_TOLERANCE

Options = tuple[float, ...]  # Numbers that a loop takes after its matrices

ILL_CONDITIONED = "the matrices are too ill-conditioned together: rounding makes one indefinite"


class FactoredPair(NamedTuple):
    """Factors of SPD matrices A = F Fᵀ and B = K Kᵀ, and F⁻¹ K = U diag(σ) Vᵀ; σ² are the eigenvalues of A⁻¹ B."""

    start: Array  # F, shape (..., d, d)
    start_inverse: Array  # F⁻¹
    end: Array  # K
    end_inverse: Array  # K⁻¹
    left: Array  # U
    singular: Array  # σ, shape (..., d), descending
    right: Array  # Vᵀ


def eigh(matrices: Array) -> tuple[Array, Array]:
    """Ascending eigenvalues and orthonormal eigenvectors (columns) of symmetric matrices (..., d, d)."""
    values, vectors = _run(_eigh_loop, (matrices,), (1, 2))
    return values, vectors


def roots(points: Array) -> tuple[Array, Array]:
    """P^½ and P^-½ of SPD matrices (..., d, d)."""
    values, vectors = eigh(points)
    root = np.sqrt(values)
    return compose(root, vectors), compose(1.0 / root, vectors)


def compose(values: Array, vectors: Array) -> Array:
    """Build V diag(values) Vᵀ, exactly symmetric; shapes (..., d) and (..., d, d)."""
    return _run(compose_loop, (values[..., None, :], vectors))[0]


def congruence(left: Array, matrices: Array) -> Array:
    """Build L M Lᵀ, exactly symmetric, of symmetric M; shapes (..., d, d)."""
    return _run(congruence_loop, (left, matrices))[0]


def distances(a: Array, b: Array) -> Array:
    """Affine-invariant distances sqrt(Σ log² λ_i(A⁻¹B)) of SPD matrices, shapes (..., d, d); shape (...)."""
    results = _run(_distance_loop, (a, b), (0,))[0]
    if math.isnan(np.vdot(results, results)):  # faster than isnan and any
        rough = np.isnan(results)
        all_a = np.broadcast_to(a, (*results.shape, *a.shape[-2:]))
        all_b = np.broadcast_to(b, (*results.shape, *b.shape[-2:]))
        try:
            singular = factored(all_a[rough], all_b[rough]).singular
            results[rough] = 2.0 * np.linalg.norm(np.log(singular), axis=-1)
        except np.linalg.LinAlgError:
            raise NotSPDError(ILL_CONDITIONED) from None
    return results


def power_congruence(left: Array, points: Array, exponent: float, right: Array) -> Array:
    """Build R (L X Lᵀ)^s Rᵀ for matrices X (..., d, d), exactly symmetric: recenter, dilate, rotate and move."""
    invalid = list[float]()

    def loop(
        left: Array,
        matrices: Array,
        right: Array,
        exponent: float,
        low: float,
        high: float,
        results: Array,
    ) -> None:
        value = _power_congruence_loop(left, matrices, right, exponent, low, high, results)
        if not np.isnan(value):
            invalid.append(value)

    images = _run(loop, (left, points, right), options=(exponent, MIN_EIGENVALUE, MAX_EIGENVALUE))[
        0
    ]
    if invalid:
        if min(invalid) < 0.0:
            raise NotSPDError(
                "points are too ill-conditioned: rounding makes them indefinite when they are recentered"
            )
        require_in_range(np.array(invalid), "points")
    return images


def release(points: Array, epsilon: float) -> Array:
    """Take damping ε off SPD matrices (..., d, d): an eigenvalue becomes the y with y (y + ε) / (y + κ ε) equal to it.

    Subtracting ε I would make images of a map indefinite where they are flatter than the damping.
    """
    return _run(_release_loop, (points,), options=(epsilon,))[0]


def require_in_range(eigenvalues: Array, name: str) -> None:
    """Raise, naming the argument, where the eigenvalues of a result would overflow or vanish."""
    bad = (eigenvalues < MIN_EIGENVALUE) | (eigenvalues > MAX_EIGENVALUE)
    if np.any(bad):
        raise InvalidInputError(
            f"{name} takes the result out of range: an eigenvalue would be {eigenvalues[bad][0]:.3g}; "
            f"allowed are {MIN_EIGENVALUE:g} to {MAX_EIGENVALUE:g}"
        )


def factored(a: Array, b: Array) -> FactoredPair:
    """Factor SPD matrices A and B, shapes (..., d, d)."""
    start, start_inverse = cholesky(a)
    end, end_inverse = cholesky(b)
    left, singular, right = np.linalg.svd(start_inverse @ end)
    return FactoredPair(start, start_inverse, end, end_inverse, left, singular, right)


def cholesky(matrices: Array) -> tuple[Array, Array]:
    """Cholesky factors of SPD matrices and their inverses."""
    factors = np.asarray(np.linalg.cholesky(matrices), dtype=np.float64)
    return factors, np.asarray(np.linalg.inv(factors), dtype=np.float64)


def symmetrize(matrices: Array) -> Array:
    """Average a matrix with its transpose, to remove rounding."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def _eigh_loop(matrices: Array, values: Array, vectors: Array) -> None:
    eigh_loop(matrices, True, values, vectors)


def _distance_loop(a: Array, b: Array, results: Array) -> None:
    """Write affine-invariant distances; one A or one B serves all."""
    count = len(results)
    size = a.shape[-1]
    white = np.empty((count, size, size))
    values = np.empty((count, size))
    no_vectors = np.empty((count, 0, size))
    whiten_loop(a, b, white)
    eigh_loop(white, False, values, no_vectors)
    log_norm_loop(values, results)


def _power_congruence_loop(
    left: Array,
    matrices: Array,
    right: Array,
    exponent: float,
    low: float,
    high: float,
    results: Array,
) -> float:
    """Write R (L M Lᵀ)^s Rᵀ with one L and R; return the first power out of bounds, -1 for indefinite M, else nan."""
    inner = np.empty_like(results)
    congruence_loop(left, matrices, inner)
    values, vectors = _diagonalized(inner)
    invalid = float(raise_loop(values, exponent, low, high))
    if not math.isnan(invalid):
        return invalid

    # R V with sums in the order of the columns, for the same bits in any batch
    turned = right[:, :, :1] * vectors[:, :1]
    for k in range(1, right.shape[-1]):
        turned += right[:, :, k : k + 1] * vectors[:, k : k + 1]
    compose_loop(values[:, None], turned, results)
    return invalid


def _release_loop(matrices: Array, epsilon: float, results: Array) -> None:
    """Write matrices with released eigenvalues."""
    values, vectors = _diagonalized(matrices)
    release_loop(values, epsilon)
    compose_loop(values[:, None], vectors, results)


def _diagonalized(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues (count, d), as they are found on the diagonals, and eigenvectors (count, d, d)."""
    values = np.empty(matrices.shape[:2])
    vectors = np.empty(matrices.shape)
    eigh_loop(matrices, False, values, vectors)
    return values, vectors


def _run(
    loop: Callable[..., None],
    arrays: tuple[Array, ...],
    axes: tuple[int, ...] = (2,),
    options: Options = (),
) -> list[Array]:
    """Call a loop on broadcast matrices (..., d, d), in threads if many; results have so many `axes` of length d."""
    batch = arrays[0].shape[:-2]
    d = arrays[0].shape[-1]
    for array in arrays[1:]:
        if array.shape[:-2] != batch:
            if batch and array.ndim > 2:
                batch = np.broadcast_shapes(batch, array.shape[:-2])
            else:
                batch = batch or array.shape[:-2]
    inputs = [_flat(array, batch) for array in arrays]
    count = math.prod(batch)
    results = [np.empty((*batch, *(d,) * number)) for number in axes]
    if len(batch) == 1:
        flat = results
    else:
        flat = [result.reshape(count, *result.shape[len(batch) :]) for result in results]
    if 0 < count <= WIDTH:
        loop(*inputs, *options, *flat)
    elif count:
        _divide(loop, inputs, options, flat, d)
    return results


def _divide(
    loop: Callable[..., None], arrays: list[Array], options: Options, results: list[Array], d: int
) -> None:
    """Call a loop on parts of a batch of matrices (d, d), by several threads where that pays."""
    count = len(results[0])
    size = WIDTH * max(1, 65_000 // (WIDTH * d**3))  # some 0.1 ms, in the processor's cache
    threads = max(1, min(int(config.NUMBA_NUM_THREADS), count // (8 * size)))

    def work(number: int) -> None:
        for first in range(number * size, count, threads * size):
            rows = slice(first, first + size)
            inputs = []
            for array in arrays:
                if len(array) == 1:  # one matrix serves all
                    inputs.append(array)
                else:
                    inputs.append(array[rows])
            outputs = [result[rows] for result in results]
            loop(*inputs, *options, *outputs)

    if threads == 1:
        work(0)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, range(threads)))


def _flat(array: Array, batch: tuple[int, ...]) -> Array:
    """Return matrices as (count, d, d), contiguous and writable; one matrix for all stays alone."""
    shape = array.shape[-2:]
    if array.shape[:-2] != batch and array.size != shape[0] * shape[1]:
        array = np.broadcast_to(array, batch + shape)
    if not array.flags.carray or array.dtype != np.float64:  # Numba would compile again
        array = np.array(array, dtype=np.float64, order="C")
    if array.ndim == 3:
        return array
    return array.reshape((-1, *shape))
