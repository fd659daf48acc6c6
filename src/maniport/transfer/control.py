"""One ellipsoid at a time, for control loops: a fitted map as a small callable that allocates nothing."""

from collections.abc import Callable
from typing import Any, NoReturn, Protocol

import numpy as np
from numba import carray, types
from numba.extending import intrinsic, overload

from maniport.compiling import njit
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE
from maniport.spd.kernels.pieces import admit, power_between
from maniport.spd.kernels.words import load
from maniport.validation import SPD_TOLERANCE, Array

PARTS = "0b7b0df068b1"
"""Digest of `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

OTHER_ARRAYS = 3
REASONS = {
    1: "is not symmetric and finite",
    2: "or its image is not positive-definite and finite",
}


@intrinsic  # type: ignore[untyped-decorator]  # Numba is untyped
def _pointer(_: Any, address: Any) -> tuple[Any, Callable[..., Any]]:
    """Make a pointer of an address."""

    def emit(context: Any, builder: Any, _: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), emit


def _borrowed(array: Array) -> Array:
    """Return the array as one that its parts keep no count of: counting takes a fifth of a microsecond in `map_one`."""
    return array


@overload(_borrowed)
def _borrowed_compiled(array):  # type: ignore[no-untyped-def]
    return lambda array: carray(_pointer(array.ctypes.data), array.shape, np.float64)


@njit(
    "i8(f8[:, ::1], f8[:, ::1], f8[:, ::1])",
    cache=True, error_model="numpy", fastmath={"contract", "nsz"},
)  # fmt: skip
def map_one(point, state, out):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Fill `out` with R (L (X + ε I) Lᵀ)^s Rᵀ − δ I, the eigenvalues of X first lifted to a floor.

    `state`, shape (8, n²), is what `rigid_state` makes: one array is handed over faster than many numbers. Returns 0,
    or the number of the check that failed: 1 when X is not symmetric and finite, 2 when an eigenvalue is not positive
    and finite, before or after, 3 when sizes differ. It keeps Python's lock: for half a microsecond, giving it away
    would take longer, and who waits for it might keep it for milliseconds.
    """
    n = len(out)
    if point.shape != (n, n) or out.shape != (n, n) or state.shape != (8, n * n):
        return 3
    space = _borrowed(state)
    left, right, a, b, v, x = space[0], space[1], space[2], space[3], space[4], space[5]
    power, added, floor, released = state[6, 0], state[6, 1], state[6, 2], state[6, 3]
    failed = admit(point, a, v, x, added, floor, n)
    if failed != 0:
        return failed
    if not power_between(left, a, power, right, MIN_EIGENVALUE, MAX_EIGENVALUE, b, v, x, n):
        return 2
    lowest, highest = x[0], x[0]
    for i in range(1, n):
        value = load(x, i)
        lowest, highest = value if value < lowest else lowest, value if value > highest else highest
    if not lowest > state[7, 0] * highest:  # a singular X, whose zero was rounded up
        return 2
    for i in range(n):
        for j in range(n):
            out[i, j] = load(a, i * n + j)
        out[i, i] -= released
    return 0


def rigid_state(left: Array, power: float, right: Array, added: float, floor: float, released: float) -> Array:
    """Return L, R, space for three matrices and a vector, then s, ε, the floor and δ, and the least ratio of lengths.

    Shapes (d, d) of L and R; (8, d²) of the result, a row for each.
    """
    state = np.zeros((8, left.size))
    state[:2] = left.ravel(), right.ravel()
    state[6, :4], state[7, 0] = (power, added, floor, released), SPD_TOLERANCE**power
    return state


class CompiledMap(Protocol):
    """The map of a fitted adapter for one ellipsoid at a time; made by `compiled()` of the adapter.

    Notes
    -----
    A call takes about a microsecond for d = 3, and none of Python's memory when `out` is given. The object has
    working space of its own: take one for each thread.
    """

    def __call__(self, point: Array, out: Array | None = None) -> Array:
        """Map one ellipsoid of the teacher to the student.

        Parameters
        ----------
        point : ndarray of float64, shape (d, d)
            C-contiguous.
        out : ndarray of float64, shape (d, d), optional
            Where the result goes, C-contiguous; `point` itself is allowed. Default: a new array.

        Returns
        -------
        ndarray, shape (d, d)
            `out`.

        Raises
        ------
        InvalidInputError
            When an array has another size, type or layout.
        NotSPDError
            When `point` is asymmetric or not finite, or with its regularisation not positive-definite; `out` is
            untouched then.
        """


def compiled_map(function: Callable[..., int], d: int, state: Array) -> CompiledMap:
    """Return the map of ellipsoids (d, d) by what is compiled.

    Parameters
    ----------
    function : callable
        Compiled; takes the ellipsoid, `state` and `out`, and returns 0 or why it failed, as `map_one` does.
    d : int
        Size of the ellipsoids.
    state : ndarray
        What it is told, and working space.
    """
    shape = (d, d)

    def mapped(point: Array, out: Array | None = None) -> Array:  # called 10 % faster than an object with a method
        if out is None:
            out = np.empty(shape)
        try:
            failed = function(point, state, out)
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
