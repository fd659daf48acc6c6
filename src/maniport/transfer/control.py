"""One ellipsoid at a time, for control loops: a fitted map as a small callable that allocates nothing."""

from collections.abc import Callable
from typing import Any

import numpy as np

from maniport.compiling import njit
from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE
from maniport.spd.kernels.pieces import admit, power_between
from maniport.validation import SPD_TOLERANCE, Array

PARTS = "0b7b0df068b1"
"""Digest of `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

OTHER_ARRAYS = 3
REASONS = {
    1: "is not symmetric and finite",
    2: "or its image is not positive-definite and finite",
}


@njit(
    "i8(f8[:, ::1], f8[:, ::1], f8, f8, f8, f8, f8[:, ::1])",
    cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"},
)  # fmt: skip
def map_one(point, state, power, added, floor, released, out):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Fill `out` with R (L (X + added I) Lᵀ)^power Rᵀ − released I, the eigenvalues of X first lifted to `floor`.

    `state` holds L, R and space for three matrices and a vector, shape (6, n²). Returns 0, or the number of the check
    that failed: 1 when X is not symmetric and finite, 2 when an eigenvalue is not positive and finite, before or
    after, 3 when sizes differ.
    """
    n = len(out)
    if point.shape != (n, n) or out.shape != (n, n) or state.shape[1] != n * n:
        return 3
    left, right, a, b, v, x = state[0], state[1], state[2], state[3], state[4], state[5]
    failed = admit(point, a, v, x, added, floor, n)
    if failed != 0:
        return failed
    if not power_between(left, a, power, right, MIN_EIGENVALUE, MAX_EIGENVALUE, b, v, x, n):
        return 2
    lowest, highest = x[0], x[0]
    for i in range(n):
        lowest, highest = min(lowest, x[i]), max(highest, x[i])
    if not lowest > SPD_TOLERANCE**power * highest:  # a singular X, whose zero was rounded up
        return 2
    for i in range(n):
        for j in range(n):
            out[i, j] = a[i * n + j]
        out[i, i] -= released
    return 0


class CompiledMap:
    """The map of a fitted adapter for one ellipsoid at a time; made by `compiled()` of the adapter.

    Parameters
    ----------
    function : callable
        Compiled; takes the ellipsoid, the arguments and `out`, and returns 0 or why it failed, as `map_one` does.
    d : int
        Size of the ellipsoids.
    *arguments
        Plain numbers and arrays, and working space.

    Notes
    -----
    A call takes about a microsecond for d = 3, and none of Python's memory when `out` is given. The object has
    working space of its own: take one for each thread.
    """

    __slots__ = ("_arguments", "_function", "_shape")

    def __init__(self, function: Callable[..., int], d: int, *arguments: Any):
        self._function, self._shape, self._arguments = function, (d, d), arguments

    @classmethod
    def rigid(
        cls, left: Array, power: float, right: Array, added: float, floor: float, released: float
    ) -> "CompiledMap":
        """Make that of a rigid map; the arguments are those of `map_one`, by name."""
        state = np.zeros((6, left.size))
        state[:2] = left.ravel(), right.ravel()
        return cls(map_one, len(left), state, power, added, floor, released)

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
        if out is None:
            out = np.empty(self._shape)
        try:
            failed = self._function(point, *self._arguments, out)
        except TypeError:
            failed = OTHER_ARRAYS
        if failed == OTHER_ARRAYS:
            found = " and ".join(f"{getattr(a, 'dtype', type(a).__name__)} {np.shape(a)}" for a in (point, out))
            raise InvalidInputError(
                f"point and out must be C-contiguous float64 arrays of shape {self._shape}; found {found}"
            )
        if failed:
            reason = REASONS[failed]
            raise NotSPDError(f"point {reason}: {np.array2string(np.asarray(point), precision=4, separator=', ')}")
        return out
