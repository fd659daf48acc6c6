"""The loops over many small matrices that everything else stands on; private to maniport.

Here are the kernels as the other modules call them: batches of any shape, compiled.

- `loops`, made of `pieces`, which are written in `words`: the compiled loops;
- `lanes`: what lets them take sixteen matrices at a time. Where it cannot be loaded they take one, with a warning;
- `twins`: the same in plain NumPy, for comparison;
- `threads`: sharing a large batch.

A matrix gets the same bits alone and in any batch, sixteen or one at a time.

Eigenvalues come from cyclic Jacobi (Golub & Van Loan, Matrix Computations, § 8.5). It is also the more accurate choice:
a rotation is skipped only when the off-diagonal entry is below machine precision relative to its two diagonal entries,
so that small eigenvalues of graded matrices keep their digits.
"""

import importlib
import math
import os
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np

from maniport.errors import InvalidInputError, NotSPDError, PerformanceWarning
from maniport.spd.kernels import loops, twins
from maniport.spd.kernels.threads import in_parts
from maniport.spd.kernels.twins import (
    MAX_SWEEPS,
    IntArray,
    Moments,
    Pair,
    cholesky,
    eigh_numpy,
    factored,
    mandel_basis,
    mandel_indices,
    symmetrize,
)
from maniport.spd.kernels.words import LANES, ONE, SIXTEEN
from maniport.validation import Array

__all__ = [
    "ILL_CONDITIONED",
    "LANES",
    "MAX_EIGENVALUE",
    "MAX_SWEEPS",
    "MIN_EIGENVALUE",
    "WIDEST",
    "Moments",
    "Pair",
    "cholesky",
    "compose",
    "congruence",
    "distances",
    "eigh",
    "eigh_numpy",
    "factored",
    "mandel_basis",
    "mandel_indices",
    "moments",
    "power_congruence",
    "require_in_range",
    "symmetrize",
]

FEW = 2
"""Largest batch that is faster one matrix at a time: sixteen take as long as about three one by one."""

MIN_EIGENVALUE, MAX_EIGENVALUE = 1e-150, 1e150
"""Range of the eigenvalues that an exponential or power may produce."""

ILL_CONDITIONED = "the matrices are too ill-conditioned together: rounding makes one indefinite"


def _widest() -> Array:
    """Load what lets loops take sixteen matrices at a time; return such a block, or one of a single matrix."""
    try:
        if os.environ.get("MANIPORT_KERNELS") == "plain":
            raise ImportError("the environment sets MANIPORT_KERNELS=plain")
        importlib.import_module("maniport.spd.kernels.lanes")
    except Exception as error:  # noqa: BLE001  # it reaches into Numba, which may change in any way
        warnings.warn(
            "batches of ellipsoids take up to ten times as long, one at a time instead of sixteen: "
            f"maniport.spd.kernels.lanes cannot be loaded with Numba {numba.__version__} "
            f"({type(error).__name__}: {error})",
            PerformanceWarning,
            stacklevel=2,
        )
        return ONE
    return SIXTEEN


WIDEST = _widest()
"""A block of as many matrices as the loops can take at a time."""


def eigh(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of symmetric matrices.

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
    d = matrices.shape[-1]
    flat = _flat(matrices)
    values, vectors = np.empty((len(flat), d)), np.empty((len(flat), d, d))
    _run(loops.eigh_loop, len(flat), d, flat, values, vectors)
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


def compose(values: Array, vectors: Array) -> Array:
    """Build V diag(values) Vᵀ, exactly symmetric; shapes (..., d) and (..., d, d)."""
    d = vectors.shape[-1]
    batch = _common(values.shape[:-1], vectors.shape[:-2])
    flat_values = _writable(_over(batch, values, 1)).reshape(-1, d)
    flat = _flat(_over(batch, vectors, 2))
    results = np.empty((len(flat), d, d))
    _run(loops.compose_loop, len(flat), d, flat_values, flat, results)
    return results.reshape(*batch, d, d)


def congruence(left: Array, matrices: Array) -> Array:
    """Build L M Lᵀ, exactly symmetric, of symmetric M; shapes (..., d, d)."""
    d = matrices.shape[-1]
    batch = _common(left.shape[:-2], matrices.shape[:-2])
    count = math.prod(batch)
    factors, each = _in_turn(left, batch)
    flat, repeat = _in_turn(matrices, batch)
    results = np.empty((count, d, d))
    _run(loops.congruence_loop, count, d, factors, each, flat, repeat, results)
    return results.reshape(*batch, d, d)


def distances(a: Array, b: Array) -> Array:
    """Affine-invariant distances sqrt(Σ log² λ_i(A⁻¹B)) of SPD matrices, shapes (..., d, d); shape (...).

    Raises
    ------
    NotSPDError
        Where a matrix has no Cholesky factor.
    """
    d = a.shape[-1]
    batch = _common(a.shape[:-2], b.shape[:-2])
    results = np.empty(math.prod(batch))
    flat_a, each = _in_turn(a, batch)
    flat_b, repeat = _in_turn(b, batch)
    _run(loops.distance_loop, len(results), d, flat_a, each, flat_b, repeat, results)
    results = results.reshape(batch)
    if np.any(rough := np.isnan(results)):
        results[rough] = _exact_distances(_over(batch, a, 2)[rough], _over(batch, b, 2)[rough])
    return results


def _exact_distances(a: Array, b: Array) -> Array:
    try:
        return twins.distances_numpy(a, b)
    except np.linalg.LinAlgError:
        raise NotSPDError(ILL_CONDITIONED) from None


def power_congruence(left: Array, points: Array, exponent: float, right: Array, name: str = "points") -> Array:
    """Build R (L X Lᵀ)^s Rᵀ in one pass: recentre, dilate, rotate and move.

    Parameters
    ----------
    left, right : ndarray, shape (d, d)
        L and R, invertible.
    points : ndarray, shape (..., d, d)
        SPD, unchecked.
    exponent : float
        s.
    name : str
        What to call the points in an error.

    Returns
    -------
    ndarray, shape (..., d, d)
        Exactly symmetric.

    Raises
    ------
    NotSPDError, InvalidInputError
        Where rounding makes L X Lᵀ indefinite, or an eigenvalue of its power would overflow or vanish.
    """
    flat, d = _flat(points), points.shape[-1]
    results, limits = np.empty(flat.shape), (MIN_EIGENVALUE, MAX_EIGENVALUE)
    if all(_run(loops.power_loop, len(flat), d, _flat(left), flat, float(exponent), _flat(right), *limits, results)):
        return results.reshape(points.shape)
    values, vectors = eigh(congruence(left, points))
    if not np.all(values > 0):
        raise NotSPDError(f"{name} are too ill-conditioned: rounding makes them indefinite when they are recentred")
    with np.errstate(over="ignore", under="ignore"):
        raised = values**exponent
    require_in_range(raised, name)
    return congruence(right, compose(raised, vectors))


def moments(points: Array, whitening: Array, weights: Array, sizes: Array, curved: bool) -> Moments | None:
    """Cost, gradient and (when `curved`) Hessian of the Fréchet mean, over points whitened to W X W.

    Parameters
    ----------
    points : ndarray, shape (n, d, d)
        SPD.
    whitening : ndarray, shape (d, d)
        W, symmetric.
    weights, sizes : ndarray, shape (n,)
        See `Moments`.
    curved : bool
        Whether the Hessian is wanted.

    Returns
    -------
    Moments or None
        None where rounding made a whitened point indefinite.
    """
    d = points.shape[-1]
    flat, inner, w, s = _flat(points), _flat(whitening), _writable(weights), _writable(sizes)
    m = d * (d + 1) // 2

    def add(first: int, last: int) -> Array | None:
        sums = np.empty(2 + m + (m * (m + 1) // 2 if curved else 0))
        return sums if loops.moments_loop(flat, inner, w, s, sums, curved, first, last, WIDEST) else None

    total = np.zeros(())
    for sums in in_parts(add, len(flat), d):
        if sums is None:
            return None
        total = total + sums
    gradient = _symmetric(total[2 : 2 + m], d)
    return Moments(float(total[0]), float(total[1]), gradient, _symmetric(total[2 + m :], m) if curved else None)


def require_in_range(eigenvalues: Array, name: str) -> None:
    """Raise, naming the argument, where the eigenvalues of a result would overflow or vanish."""
    bad = (eigenvalues < MIN_EIGENVALUE) | (eigenvalues > MAX_EIGENVALUE)
    if np.any(bad):
        raise InvalidInputError(
            f"{name} takes the result out of range: an eigenvalue would be {eigenvalues[bad][0]:.3g}; "
            f"allowed are {MIN_EIGENVALUE:g} to {MAX_EIGENVALUE:g}"
        )


def _run(loop: Callable[..., Any], count: int, d: int, *arguments: Any) -> list[Any]:
    """Run a loop over a batch of `count` d×d matrices; return what it returns for each part of the batch."""
    like = ONE if count <= FEW else WIDEST
    return in_parts(lambda first, last: loop(*arguments, first, last, like), count, d)


def _writable(array: Array) -> Array:
    """Contiguous and writable: of a read-only array Numba would make another type, and compile again."""
    contiguous = np.ascontiguousarray(array, dtype=np.float64)
    return contiguous if contiguous.flags.writeable and contiguous.flags.aligned else contiguous.copy()


def _flat(matrices: Array) -> Array:
    d = matrices.shape[-1]
    return _writable(matrices).reshape(-1, d, d)


def _common(one: tuple[int, ...], other: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a batch from two that broadcast; equal ones without NumPy's detour, which costs more than a matrix."""
    return one if one == other else np.broadcast_shapes(one, other)


def _over(batch: tuple[int, ...], array: Array, core: int) -> Array:
    """Repeat an array along the axes of a batch, all but its last `core` ones."""
    shape = array.shape[:-core]
    return array if shape == batch else np.broadcast_to(array, (*batch, *array.shape[-core:]))


def _in_turn(matrices: Array, batch: tuple[int, ...]) -> tuple[Array, int]:
    """Flatten an operand of a batch and say how many results in a row each matrix serves; copy it only if need be.

    Result i belongs to matrix (i // each) modulo their number: the trailing axes of length one give the division, the
    leading ones the remainder.
    """
    if matrices.shape[:-2] == batch or matrices.ndim == 2:  # which NumPy would take longer to find out than to compute
        return _flat(matrices), 1 if matrices.shape[:-2] == batch else math.prod(batch)
    own = (1,) * (len(batch) - matrices.ndim + 2) + matrices.shape[:-2]
    last = max((axis + 1 for axis, size in enumerate(own) if size != 1), default=0)
    first = min((axis for axis, size in enumerate(own) if size != 1), default=0)
    if own[first:last] != batch[first:last]:
        return _flat(_over(batch, matrices, 2)), 1
    return _flat(matrices), math.prod(batch[last:])


def _symmetric(upper: Array, n: int) -> Array:
    """Fill a symmetric matrix from the rows of its upper triangle."""
    matrix = np.empty((n, n))
    rows, columns = _upper_triangle(n)
    matrix[rows, columns] = matrix[columns, rows] = upper
    return matrix


@cache
def _upper_triangle(n: int) -> tuple[IntArray, IntArray]:
    return np.triu_indices(n)
