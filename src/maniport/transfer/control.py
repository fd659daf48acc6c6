"""One ellipsoid at a time, for control loops: a fitted map as a small callable that allocates nothing."""

from typing import Any, NoReturn, Protocol

import numba
import numpy as np

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE
from maniport.spd.kernels.loops import diagonalize_one
from maniport.spd.kernels.single import admit, compose, congruence, multiply
from maniport.util.jit import kernel
from maniport.util.validation import SPD_TOLERANCE, Array

OTHER_ARRAYS = 3
REASONS = {
    1: "is not symmetric and finite",
    2: "or its image is not positive-definite and finite",
}


@kernel
def map_one(point, left, right, numbers, out):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Fill `out` with R (L (X + ε I) Lᵀ)^s Rᵀ − δ I, the eigenvalues of X first lifted to a floor."""
    n, power = len(left), numbers[0]
    if point.shape != (n, n) or out.shape != (n, n):
        return 3
    a, b, v, x = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty(n)
    failed = admit(point, a, v, x, numbers[1], numbers[2])
    if failed != 0:
        return failed
    congruence(left, a, b)
    diagonalize_one(a, v)
    lowest, highest = MAX_EIGENVALUE, MIN_EIGENVALUE
    for i in range(n):
        x[i] = a[i, i] ** power
        if not (a[i, i] > 0.0 and MIN_EIGENVALUE <= x[i] <= MAX_EIGENVALUE):
            return 2
        lowest, highest = min(lowest, x[i]), max(highest, x[i])
    if not lowest > SPD_TOLERANCE**power * highest:  # a singular X, whose zero was rounded up
        return 2
    multiply(right, v, b)
    compose(x, b, a)
    for i in range(n):
        for j in range(n):
            out[i, j] = a[i, j]
        out[i, i] -= numbers[3]
    return 0


class CompiledMap(Protocol):
    """The map of a fitted adapter for one ellipsoid at a time; made by `compiled()` of the adapter."""

    def __call__(self, point: Array, out: Array | None = None) -> Array:
        """Map one ellipsoid of the teacher to the student."""


def compiled_map(function: Any, d: int, *terms: Array) -> CompiledMap:
    """Return the map of ellipsoids (d, d) by what is compiled."""
    shape = (d, d)
    function(np.eye(d), *terms, np.empty(shape))  # compiles it, or loads it
    if not numba.config.DISABLE_JIT:
        function.disable_compile()  # arrays of other types are errors

    def mapped(point: Array, out: Array | None = None) -> Array:  # called 10 % faster than an object with a method
        if out is None:
            out = np.empty(shape)
        try:
            failed = function(point, *terms, out)
        except TypeError:
            failed = OTHER_ARRAYS
        if failed:
            _refuse(failed, shape, point, out)
        return out

    mapped.__doc__ = CompiledMap.__call__.__doc__
    return mapped


def _refuse(failed: int, shape: tuple[int, int], point: Array, out: Array) -> NoReturn:
    if failed == OTHER_ARRAYS:
        found = " and ".join(f"{getattr(a, 'dtype', type(a).__name__)} {np.shape(a)}" for a in (point, out))
        raise InvalidInputError(f"point and out must be C-contiguous float64 arrays of shape {shape}; found {found}")
    reason = REASONS[failed]
    raise NotSPDError(f"point {reason}: {np.array2string(np.asarray(point), precision=4, separator=', ')}")
