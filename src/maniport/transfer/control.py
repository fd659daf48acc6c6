"""One ellipsoid at a time, for control loops: a fitted map as a small callable that allocates nothing."""

from collections.abc import Callable
from typing import Any, NoReturn

import numba
import numpy as np

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE, ROUNDED
from maniport.spd.kernels.loops import release
from maniport.spd.kernels.single import compose, congruence, diagonalize, multiply
from maniport.util.jit import kernel, part
from maniport.util.validation import SPD_TOLERANCE, SYMMETRY_TOLERANCE, Array


@kernel
def map_rigidly(point, left, right, numbers, out):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Fill `out` with R (L (X + ε I) Lᵀ)^s Rᵀ, released from the student's damping; return whether it is possible."""
    n, (power, epsilon, student) = len(left), numbers
    if point.shape != (n, n) or out.shape != (n, n):
        return False
    a, b, v, x = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    if not damp(point, a, epsilon):
        return False
    congruence(left, a, b)
    diagonalize(a, v)
    for i in range(n):
        x[i] = a[i, i] ** power if a[i, i] > 0.0 else 0.0
    lowest, highest = x.min(), x.max()
    # the last bound refuses a singular X, whose zero was rounded up
    if not (
        lowest >= MIN_EIGENVALUE
        and highest <= MAX_EIGENVALUE
        and lowest > SPD_TOLERANCE**power * highest
    ):
        return False
    multiply(right, v, b)
    compose(x, b, a)
    if student > 0.0:
        diagonalize(a, v)
        for i in range(n):
            if not a[i, i] > 0.0:
                return False
            x[i] = release(a[i, i], student)
        compose(x, v, a)
    out[:] = a
    return True


def compiled_map(function: Any, d: int, *terms: Array) -> Callable[..., Array]:
    """Return the map of an ellipsoid (d, d) into `out` by a kernel that returns whether it is possible."""
    shape = (d, d)
    function(np.eye(d), *terms, np.empty(shape))  # compiles it, or loads it
    if not numba.config.DISABLE_JIT:
        function.disable_compile()  # arrays of other types are errors

    def mapped(
        point: Array, out: Array | None = None
    ) -> Array:  # called 10 % faster than an object with a method
        if out is None:
            out = np.empty(shape)
        try:
            possible = function(point, *terms, out)
        except TypeError:
            possible = False
        if not possible:
            _refuse(shape, point, out)
        return out

    return mapped


def _refuse(shape: tuple[int, int], point: Array, out: Array) -> NoReturn:
    for array in (point, out):
        fits = isinstance(array, np.ndarray) and array.shape == shape and array.dtype == np.float64
        if not (fits and array.flags.c_contiguous):
            text = " and ".join(
                f"{getattr(a, 'dtype', type(a).__name__)} {np.shape(a)}" for a in (point, out)
            )
            raise InvalidInputError(
                f"point and out must be C-contiguous float64 arrays of shape {shape}; found {text}"
            )
    raise NotSPDError(
        "point and its image must be symmetric, finite and positive-definite; found "
        f"{np.array2string(point, precision=4, separator=', ')}"
    )


@kernel
def map_lengths(point, base_rotation, numbers, parts, table, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the length field's map of R (X + ε I) Rᵀ, released from the student's damping.

    The terms are those of `LengthsMap.terms`; the return value is that of `map_rigidly`.
    """
    n = len(base_rotation)
    if point.shape != (n, n) or out.shape != (n, n):
        return False
    epsilon, student, power, shift, level, inverse_square, soft = numbers
    a, b, v, x, u = (
        np.empty((n, n)),
        np.empty((n, n)),
        np.empty((n, n)),
        np.empty(n),
        np.empty(n * (n + 1) // 2),
    )
    if not damp(point, a, epsilon):
        return False
    congruence(base_rotation, a, b)
    diagonalize(a, v)
    trace = 0.0
    for i in range(n):
        trace += a[i, i]
    for i in range(n):
        if not a[i, i] > ROUNDED * trace:
            return False
        x[i] = power * np.log(a[i, i]) + shift
    compose(x, v, a)
    _fill_mandel(a, u)
    if len(parts) > 0:
        _fill_features(u, parts, soft)
    first, second, third = _field(u, table, inverse_square)
    for i in range(n):
        t = np.tanh(0.5 * x[i])
        x[i] = np.exp(x[i] + first + t * (second + t * third) + level)
        if student > 0.0:
            x[i] = release(x[i], student)
        if not MIN_EIGENVALUE <= x[i] <= MAX_EIGENVALUE:
            return False
    compose(x, v, a)
    out[:] = a
    return True


@part(fastmath=True)
def _field(u, table, inverse_square):  # type: ignore[no-untyped-def]
    """Sum kernel values at u times coefficients; columns of the table: center / w², its exponent, and a_jr."""
    size, square, near = len(u), 0.0, table[len(u)].copy()
    for k in range(size):
        square += u[k] * u[k]
        for j in range(len(near)):
            near[j] += table[k, j] * u[k]
    shift, first, second, third = 0.5 * inverse_square * square, 0.0, 0.0, 0.0
    for j in range(len(near)):
        # exp(x) as exp(x / 256)^256, which becomes vector instructions as np.exp does not; below −40 it is negligible
        x = max(near[j] - shift, -40.0) / 256.0
        power = 1.0 + x / 7.0 * (1.0 + x / 8.0)
        for factor in range(6, 0, -1):
            power = 1.0 + x / factor * power
        for _ in range(8):
            power *= power
        first += table[size + 1, j] * power
        second += table[size + 2, j] * power
        third += table[size + 3, j] * power
    return first, second, third


@part
def _fill_mandel(a, u):  # type: ignore[no-untyped-def]
    row, root2 = len(a), np.sqrt(2.0)
    for i in range(len(a)):
        u[i] = a[i, i]
        for j in range(i + 1, len(a)):
            u[row] = root2 * a[i, j]
            row += 1


@part
def _fill_features(u, parts, soft):  # type: ignore[no-untyped-def]
    """Replace u by its `features` about an axis, whose `harmonics` (6, 6) are `parts`, with δ²."""
    h = np.zeros(6)
    for i in range(6):
        for k in range(6):
            h[i] += parts[i, k] * u[k]
    along, mean, a, b, c, e = h[0], h[1], h[2], h[3], h[4], h[5]
    once, twice = a * a + b * b, c * c + e * e
    both, squares, product = once + 4.0 * twice + soft, a * a - b * b, 2.0 * (a * b)
    once, twice = np.sqrt(once + soft), np.sqrt(twice + soft)
    scale = 1.0 / (once * np.sqrt(both))
    u[0], u[1], u[2], u[3] = along, mean, once, twice
    u[4], u[5] = (squares * c + product * e) * scale, (product * c - squares * e) * scale


@part
def damp(point, a, added):  # type: ignore[no-untyped-def]
    """Set A ← P + added I; return whether P is symmetric and finite."""
    n, largest = len(point), 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(point[i, j]))
    for i in range(n):
        for j in range(n):
            if (
                not abs(point[i, j] - point[j, i]) <= SYMMETRY_TOLERANCE * largest
            ):  # also true for nan
                return False
            a[i, j] = 0.5 * (point[i, j] + point[j, i])
        a[i, i] += added
    return True
