"""The words that kernels are written in: one number of each of sixteen matrices at a time, or one number of one matrix.

A kernel works on blocks. A block has the shape (rows, 16), or (rows,) for one matrix; its type decides which of the two
a kernel is compiled for. The functions here are what it may do with a block and with what it loads from there, beside
+ - * / and comparisons. Each has a NumPy meaning (the body, so that kernels run uncompiled), a compiled one for one
matrix (here), and a compiled one for sixteen (in `lanes`, as it takes Numba's internals; or here where it does not).

One matrix goes through the same operations as each of sixteen: both give the same bits.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LANES = 16
ONE, SIXTEEN = np.empty(1), np.empty((1, LANES))
"""Blocks, to say by their type how many matrices a loop is to take at a time."""

ROOT_HALF = float(np.sqrt(0.5))
LOWEST_BITS = int(np.float64(ROOT_HALF).view(np.int64))


def _compiled(one: Callable[..., Any] | None = None, sixteen: Callable[..., Any] | None = None) -> Callable[..., Any]:
    """Register the compiled meanings of a word; for one matrix that is, by default, its body."""

    def of_one(kind: Any) -> bool:
        return isinstance(kind, types.Number | types.Boolean) or (isinstance(kind, types.Array) and kind.ndim != 2)

    def register(word: Callable[..., Any]) -> Callable[..., Any]:
        overload(word, strict=False)(lambda *kinds: (one or word) if all(map(of_one, kinds)) else sixteen)
        return word

    return register


@_compiled(lambda rows: 1, lambda rows: LANES)
def width(rows: Array) -> int:
    """How many matrices a block holds."""
    return rows.shape[1] if rows.ndim == 2 else 1


@_compiled(lambda rows, row: rows[np.uint64(row)])
def load(rows: Array, row: int) -> Array:
    """Read one row of a block."""
    return np.array(rows[row])


@_compiled()
def store(rows: Array, row: int, x: Array) -> None:
    """Write one row of a block."""
    rows[np.uint64(row)] = x


@_compiled(lambda rows, row, lane: rows[np.uint64(row)], lambda rows, row, lane: rows[row, lane])
def take(rows: Array, row: int, lane: int) -> float:
    """Read what a row holds of one matrix."""
    return float(rows.reshape(len(rows), -1)[row, lane])


def _put_sixteen(rows, row, lane, x):  # type: ignore[no-untyped-def]  # Numba infers the types
    rows[row, lane] = x


@_compiled(lambda rows, row, lane, x: store(rows, row, x), _put_sixteen)
def put(rows: Array, row: int, lane: int, x: float) -> None:
    """Write what a row holds of one matrix."""
    rows.reshape(len(rows), -1)[row, lane] = x


@_compiled(lambda matrices, first, step, rows: matrices.ravel()[first])
def gather(matrices: Array, first: int, step: int, rows: Array) -> Array:
    """Read a row for a block from an array (count, n, n): the entry `first` and those `step` apart in memory."""
    return np.asarray(matrices.reshape(-1)[first + step * np.arange(width(rows))].reshape(rows.shape[1:]))


def _scatter_one(matrices, first, step, x):  # type: ignore[no-untyped-def]
    matrices.ravel()[first] = x


@_compiled(_scatter_one)
def scatter(matrices: Array, first: int, step: int, x: Array) -> None:
    """Write a row to an array (count, n, n): to the entry `first` and those `step` apart in memory."""
    matrices.reshape(-1)[first + step * np.arange(np.size(x))] = x


@_compiled(lambda x, rows: x)
def spread(x: float, rows: Array) -> Array:
    """Make a row of a block of one number."""
    return np.full(rows.shape[1:], x)


@_compiled()
def magnitude(x: Array) -> Array:
    """Absolute value."""
    return np.abs(x)


@_compiled(lambda x: np.sqrt(x))
def root(x: Array) -> Array:
    """Square root."""
    return np.asarray(np.sqrt(x))


@_compiled()
def nearest(x: Array) -> Array:
    """Round to the nearest whole number, halves to the even one."""
    return np.rint(x)


@_compiled(lambda condition, x, y: x if condition else y)
def where(condition: Mask, x: Array | float, y: Array | float) -> Array:
    """Choose lane by lane; `x` and `y` may also be one number each."""
    return np.where(condition, x, y)


@_compiled(lambda condition: condition)
def anywhere(condition: Mask) -> bool:
    """Whether the condition holds in some lane."""
    return bool(np.any(condition))


@_compiled(lambda condition: condition)
def everywhere(condition: Mask) -> bool:
    """Whether the condition holds in all lanes."""
    return bool(np.all(condition))


@register_jitable
def _split(x):  # type: ignore[no-untyped-def]
    """Take the bits of x apart: those of x itself and, counted from √½, those of the power of two."""
    together = np.float64(x).view(np.int64)
    return together, (together - LOWEST_BITS) >> 52


def _mantissa_of_one(x):  # type: ignore[no-untyped-def]
    together, power = _split(x)
    return np.int64(together - (power << 52)).view(np.float64)


@_compiled(_mantissa_of_one)
def mantissa(x: Array) -> Array:
    """Return m of x = m · 2^k with m from √½ to √2, for positive normal numbers."""
    m = np.frexp(x)[0]
    return np.where(m < ROOT_HALF, 2.0 * m, m)


@_compiled(lambda x: np.float64(_split(x)[1]))
def exponent(x: Array) -> Array:
    """Return k of x = m · 2^k, see `mantissa`."""
    m, k = np.frexp(x)
    return k - np.where(m < ROOT_HALF, 1.0, 0.0)


@_compiled(lambda k: np.int64((np.int64(k) + 1023) << 52).view(np.float64))
def power_of_two(k: Array) -> Array:
    """Return 2^k for whole numbers from -1022 to 1023."""
    return np.ldexp(1.0, k.astype(np.int64))
