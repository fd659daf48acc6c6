"""The kernels as the other modules call them: batches of any shape, compiled below 12×12, LAPACK from there up."""

import math

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import loops, twins
from maniport.spd.kernels.threads import in_parts
from maniport.spd.kernels.twins import Moments

Array = NDArray[np.float64]

LAPACK_FROM = 12
MIN_EIGENVALUE, MAX_EIGENVALUE = 1e-150, 1e150
"""Range of the eigenvalues that an exponential or power may produce."""

ILL_CONDITIONED = "the matrices are too ill-conditioned together: rounding makes A^-½ B A^-½ indefinite"


def eigh(matrices: Array) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors of symmetric matrices.

    Parameters
    ----------
    matrices : ndarray, shape (..., d, d)
        Symmetric, finite, unchecked. Only the upper triangle is read below 12×12.

    Returns
    -------
    values : ndarray, shape (..., d)
        Ascending.
    vectors : ndarray, shape (..., d, d)
        Orthonormal columns, in the order of the values.
    """
    d = matrices.shape[-1]
    if d >= LAPACK_FROM:
        values, vectors = np.linalg.eigh(matrices)
        return values, vectors
    flat = _flat(matrices)
    values, vectors = np.empty((len(flat), d)), np.empty((len(flat), d, d))
    in_parts(lambda first, last: loops.eigh_loop(flat, values, vectors, first, last), len(flat), d)
    return values.reshape(matrices.shape[:-1]), vectors.reshape(matrices.shape)


def compose(values: Array, vectors: Array) -> Array:
    """Build V diag(values) Vᵀ, exactly symmetric; shapes (..., d) and (..., d, d)."""
    d = vectors.shape[-1]
    if d >= LAPACK_FROM:
        return twins.compose_numpy(values, vectors)
    batch = np.broadcast_shapes(values.shape[:-1], vectors.shape[:-2])
    flat_values = _writable(np.broadcast_to(values, (*batch, d))).reshape(-1, d)
    flat = _flat(np.broadcast_to(vectors, (*batch, d, d)))
    results = np.empty((len(flat), d, d))
    in_parts(lambda first, last: loops.compose_loop(flat_values, flat, results, first, last), len(flat), d)
    return results.reshape(*batch, d, d)


def congruence(left: Array, matrices: Array) -> Array:
    """Build L M Lᵀ, exactly symmetric, of symmetric M; shapes (..., d, d)."""
    d = matrices.shape[-1]
    if d >= LAPACK_FROM:
        return twins.congruence_numpy(left, matrices)
    batch = np.broadcast_shapes(left.shape[:-2], matrices.shape[:-2])
    count = math.prod(batch)
    factors, each = _in_turn(left, batch)
    flat, repeat = _in_turn(matrices, batch)
    results = np.empty((count, d, d))
    in_parts(
        lambda first, last: loops.congruence_loop(factors, each, flat, repeat, results, first, last),
        count,
        d,
    )
    return results.reshape(*batch, d, d)


def distances(a: Array, b: Array) -> Array:
    """Affine-invariant distances sqrt(Σ log² λ_i(A⁻¹B)) of SPD matrices, shapes (..., d, d); shape (...).

    Raises
    ------
    NotSPDError
        Where rounding makes A^-½ B A^-½ indefinite.
    """
    d = a.shape[-1]
    if d >= LAPACK_FROM:
        found = twins.distances_numpy(a, b)
        if found is None:
            raise NotSPDError(ILL_CONDITIONED)
        return found
    batch = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    results = np.empty(math.prod(batch))
    flat_a, each = _in_turn(a, batch)
    flat_b, repeat = _in_turn(b, batch)
    if not all(
        in_parts(
            lambda first, last: loops.distance_loop(flat_a, each, flat_b, repeat, results, first, last),
            len(results),
            d,
        )
    ):
        raise NotSPDError(ILL_CONDITIONED)
    return results.reshape(batch)


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
    d = points.shape[-1]
    flat = _flat(points)
    if d < LAPACK_FROM:
        results = np.empty(flat.shape)
        inner, outer = _flat(left), _flat(right)
        if all(
            in_parts(
                lambda first, last: loops.power_loop(
                    inner, flat, float(exponent), outer, MIN_EIGENVALUE, MAX_EIGENVALUE, results, first, last
                ),
                len(flat),
                d,
            )
        ):
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
    if d >= LAPACK_FROM:
        return twins.moments_numpy(points, whitening, weights, sizes, curved)
    flat, inner, w, s = _flat(points), _flat(whitening), _writable(weights), _writable(sizes)
    m = d * (d + 1) // 2

    def add(first: int, last: int) -> Array | None:
        sums = np.empty(2 + m + (m * (m + 1) // 2 if curved else 0))
        return sums if loops.moments_loop(flat, inner, w, s, sums, curved, first, last) else None

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


def _writable(array: Array) -> Array:
    """Contiguous and writable: of a read-only array Numba would make another type, and compile again."""
    contiguous = np.ascontiguousarray(array, dtype=np.float64)
    return contiguous if contiguous.flags.writeable and contiguous.flags.aligned else contiguous.copy()


def _flat(matrices: Array) -> Array:
    d = matrices.shape[-1]
    return _writable(matrices).reshape(-1, d, d)


def _in_turn(matrices: Array, batch: tuple[int, ...]) -> tuple[Array, int]:
    """Flatten an operand of a batch and say how many results in a row each matrix serves; copy it only if need be.

    Result i belongs to matrix (i // each) modulo their number: the trailing axes of length one give the division, the
    leading ones the remainder.
    """
    own = (1,) * (len(batch) - matrices.ndim + 2) + matrices.shape[:-2]
    last = max((axis + 1 for axis, size in enumerate(own) if size != 1), default=0)
    first = min((axis for axis, size in enumerate(own) if size != 1), default=0)
    if own[first:last] != batch[first:last]:
        return _flat(np.broadcast_to(matrices, (*batch, *matrices.shape[-2:]))), 1
    return _flat(matrices), math.prod(batch[last:])


def _symmetric(upper: Array, n: int) -> Array:
    """Fill a symmetric matrix from the rows of its upper triangle."""
    matrix = np.empty((n, n))
    rows, columns = np.triu_indices(n)
    matrix[rows, columns] = matrix[columns, rows] = upper
    return matrix
