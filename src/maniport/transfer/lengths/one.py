"""The lengths field compiled for one ellipsoid in a control loop; importing this file compiles it."""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels import WIDEST
from maniport.spd.kernels.pieces import admit, congruence, exp, mirror, piece
from maniport.spd.kernels.words import load, store, width
from maniport.transfer.lengths.kernels import image, logarithm, unturned
from maniport.validation import Array

PARTS = "3c08243ad89a"
"""Digest of `lanes.py`, `pieces.py` and `words.py` in `spd/kernels` and of `kernels.py` here. Numba's cache does not
see the files of the functions called from here: whenever one changes, so must this line. A test tells the digest."""

BLOCK = "f8[:, ::1]" if WIDEST.ndim == 2 else "f8[::1]"
"""Type of what holds sixteen numbers to a row."""


@piece
def kernel_values(terms, start, groups, u, square, size, space):  # type: ignore[no-untyped-def]
    """Fill rows from `space` on with the kernel values at what U holds of the centers in rows from `start` on."""
    for group in range(groups):
        row = start + (size + 1) * group
        exponent = load(terms, row) + square
        for k in range(size):
            exponent = exponent + load(terms, row + 1 + k) * u[k]
        store(terms, space + group, exp(exponent))


@njit(
    f"i8(f8[:, ::1], {BLOCK}, f8[:, ::1])",
    cache=True, nogil=True, error_model="numpy", fastmath={"contract"},
)  # fmt: skip
def map_one(point, terms, out):  # type: ignore[no-untyped-def]  # Numba infers the types
    """Fill `out` with the map of R (X + ε I) Rᵀ, the eigenvalues of X first lifted to a floor; R where there is one.

    `terms` are what `terms_of_one` makes. Kernel values are worked out for sixteen centers at a time and added up one
    by one, as for sixteen matrices at a time. Returns what `admit` does, and 2 when an eigenvalue or its image is out
    of range, 3 when sizes differ.
    """
    n = len(out)
    size, numbers = n * (n + 1) // 2, terms.reshape(-1)
    if point.shape != (n, n) or out.shape != (n, n) or numbers[0] != n:
        return 3
    state = numbers[width(terms) :][: 20 * n * n].reshape(10, 2 * n * n)
    left, a, b, v, x, u = state[0], state[1], state[2], state[3], state[4], state[5]
    added, floor, mounted = state[6, 0], state[6, 1], state[6, 2]
    turned, count = np.int64(state[6, 3]), np.int64(state[6, 4])
    failed = admit(point, a, v, x, added, floor, n)
    if failed != 0:
        return failed
    if mounted > 0.0:
        congruence(left, a, b, n)
        mirror(a, n)
    fine, square = logarithm(a, state[7], b, v, x, u, n)
    if not fine:
        return 2
    # whole rows: 1 + those of the state, their kernel values, the centers, their coefficients, the same of what turns
    space, groups = 1 + -(-20 * n * n // width(terms)), -(-count // width(terms))
    start, near = space + groups, numbers[space * width(terms) :]
    lengths = numbers[(start + (size + 1) * groups) * width(terms) :]
    if turned > 0:
        pivots, some = start + (size + 4) * groups, -(-turned // width(terms))
        turns = numbers[(pivots + (size + 1) * some) * width(terms) :]
        kernel_values(terms, pivots, some, u, square, size, space)
        for j in range(turned):
            for k in range(size):
                u[size + k] = u[size + k] + turns[size * j + k] * near[j]
    if state[6, 5] > 0.0:
        square = (-0.5 * state[7, 3]) * unturned(
            u, numbers[width(terms) + 16 * n * n :][:36].reshape(6, 6), state[7, 4]
        )
    kernel_values(terms, start, groups, u, square, size, space)
    first, second, third = 0.0, 0.0, 0.0
    for j in range(count):
        first = first + lengths[3 * j] * near[j]
        second = second + lengths[3 * j + 1] * near[j]
        third = third + lengths[3 * j + 2] * near[j]
    if not image(a, state[7], first, second, third, turned > 0, state[7, 5:], v, x, u, n):
        return 2
    for i in range(n):
        for j in range(n):
            out[i, j] = a[i * n + j]
    return 0


def terms_of_one(mounting: Array | None, added: float, floor: float, terms: tuple[Array, ...], release: Array) -> Array:
    """Return what `map_one` takes as `terms`, from what `change_lengths` takes and what comes before: rows of sixteen.

    They hold d; R, space, then ε, the floor, whether there is R, how many turns and centers and whether an axis, then
    `base` and `release`, as eight rows of 2 d², and in two more the harmonics; space; and the centers, each number of
    sixteen in a row, with the coefficients, those of lengths and, where there are any, those of turns.
    """
    base, harmonics, centers, lengths, pivots, turns = terms
    d = round((np.sqrt(8 * centers.shape[1] - 7) - 1) / 2)
    state = np.zeros((10, 2 * d * d))
    if mounting is not None:
        state[0, : d * d] = mounting.ravel()
    state[6, :6] = added, floor, mounting is not None, len(turns), len(centers), len(harmonics) > 0
    state[7, :5], state[7, 5:7] = base, release
    state[8:].ravel()[: harmonics.size] = harmonics.ravel()
    parts = [np.array([d]), state, np.zeros(len(centers) + -len(centers) % WIDEST.size)]
    for places, coefficients in ((centers, lengths), (pivots, turns)):
        if len(places):
            missing = -len(places) % WIDEST.size
            both = [np.pad(each, ((0, missing), (0, 0))) for each in (np.roll(places, 1, axis=1), coefficients)]
            parts += [both[0].reshape(-1, WIDEST.size, places.shape[1]).swapaxes(1, 2), both[1]]
    return np.concatenate([np.pad(part.ravel(), (0, -part.size % WIDEST.size)) for part in parts]).reshape(
        -1, *WIDEST.shape[1:]
    )
