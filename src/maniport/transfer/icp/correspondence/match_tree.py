"""What the score of two ellipsoids compares, and the best match by score among very many.

The best match is found without scoring all pairs, and never another one than the best. The student's ellipsoids are
sorted into leaves of similar direction, condition and volume. For a teacher ellipsoid, each leaf promises a score that
none of its members exceeds; the leaves are opened in the order of their promises until the next promise is below the
best score found (branch and bound).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from maniport.compiling import njit
from maniport.spd.kernels import LANES, WIDEST, eigh
from maniport.spd.kernels.words import (
    anywhere,
    everywhere,
    load,
    magnitude,
    put,
    root,
    spread,
    store,
    take,
    where,
    width,
)
from maniport.transfer.icp.correspondence.contract import Indices
from maniport.validation import Array

EQUAL_EIGENVALUES = 1e-6
"""Relative gap below which an eigenvector is undefined and must not decide a match."""

PARTS = "54f9f8e174ca"
"""Digest of `lanes.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the functions called
from here: whenever one changes, so must this line. A test tells the digest."""

compiled = njit(cache=True, nogil=True, error_model="numpy")

SIXTH = 1.0 / 6.0

SMALLEST_LEAF = 64
ONE_LEAF = 512

NARROW = 600.0
"""Half the range of condition or volume in a leaf up to which exponentials are taken once and for all.

There exp(−|a − b|) is the smaller of e^a e^-b and e^-a e^b, exact to 2e-13.
"""

FARTHEST = 700.0
"""A query farther than this from the middle of such a leaf is taken to be this far: exp(−100) is nothing either way."""

NEGLIGIBLE = 40.0
"""exp(−40) is 4e-18: below the rounding of a score."""

TIE = 1e-12
"""Scores that differ by less are equal: rounding depends on the leaf."""

SLACK = 1e-9
"""What promises are raised by, against rounding."""


@dataclass(frozen=True)
class EllipsoidFeatures:
    """What the paper's score compares (Reithmeir et al. 2022, eq. 18).

    The eigenvectors of the smallest and the largest eigenvalue, shapes (n, d), are zero where they are undefined. The
    condition is λ_max / λ_min (the paper calls it the inverse), the volume the product of the semi-axes, shapes (n,).
    """

    minor: Array
    major: Array
    condition: Array
    volume: Array

    @classmethod
    def of(cls, points: Array) -> "EllipsoidFeatures":
        """Measure SPD matrices, shape (n, d, d)."""
        values, vectors = eigh(points)
        low_gap = (values[:, 1] - values[:, 0]) / values[:, 1]
        high_gap = (values[:, -1] - values[:, -2]) / values[:, -1]
        return cls(
            minor=vectors[:, :, 0] * (low_gap > EQUAL_EIGENVALUES)[:, None],
            major=vectors[:, :, -1] * (high_gap > EQUAL_EIGENVALUES)[:, None],
            condition=values[:, -1] / values[:, 0],
            volume=np.sqrt(np.prod(values, axis=-1)),
        )

    def turned(self, rotation: Array) -> "EllipsoidFeatures":
        """Features of R X Rᵀ: only the directions change."""
        return EllipsoidFeatures(self.minor @ rotation.T, self.major @ rotation.T, self.condition, self.volume)

    def pick(self, index: Any) -> "EllipsoidFeatures":
        """Take some of the ellipsoids, in the order of `index`."""
        return EllipsoidFeatures(self.minor[index], self.major[index], self.condition[index], self.volume[index])


class MatchTree:
    """The student's ellipsoids, sorted for matching; memory grows with their number only."""

    def __init__(self, student: EllipsoidFeatures):
        size = _leaf_size(student)
        tree = cKDTree(_sorting_features(student), leafsize=size, compact_nodes=False)
        spans = np.array(list(_leaves(tree.tree, size)))
        slot = np.arange(size)
        filled = slot < np.diff(spans, axis=1)
        place = np.where(filled, spans[:, :1] + slot, spans[:, :1])  # places beyond a leaf's end repeat its first
        order = np.asarray(tree.indices, dtype=np.intp)[place]
        shape = np.stack([student.condition[order], student.volume[order]], axis=1)
        low, high = shape.min(axis=2), shape.max(axis=2)
        self._order, self._middle = order, 0.5 * (low + high)
        self._narrow = (high - low).max(axis=1) <= 2.0 * NARROW
        gap = shape - self._middle[:, :, None]
        up = np.exp(np.where(self._narrow[:, None, None], gap, 0.0))
        directions = np.concatenate([student.minor[order], student.major[order]], axis=2).transpose(0, 2, 1)
        self._members = _in_rows(directions)
        self._shape = _in_rows(np.concatenate([shape, up, 1.0 / up], axis=1))
        cones = [_cone(vectors[order]) for vectors in (student.minor, student.major)]
        axis = np.concatenate([axis for axis, _, _ in cones], axis=1).T
        opening = np.stack([part for _, cosine, sine in cones for part in (cosine, sine)])
        # leaves that only fill up a row of sixteen promise less than nothing: outside of cones of negative sine
        axis, opening, low, high = (
            np.pad(part, ((0, 0), (0, -len(order) % LANES)), constant_values=fill)
            for part, fill in ((axis, 0.0), (opening, -10.0), (low.T, 0.0), (high.T, 0.0))
        )
        opening[[0, 2], len(order) :] = 1.0  # no direction lies within such a cone
        self._bounds = tuple(map(_in_rows, (axis, opening, low, high)))

    def query(self, teacher: EllipsoidFeatures) -> tuple[Indices, Array]:
        """For every teacher ellipsoid the index of its best match and the score, shapes (n,)."""
        count = len(teacher.volume)
        index, score, leaf = np.zeros(count, np.intp), np.empty(count), np.zeros(count, np.intp)
        directions = np.concatenate([teacher.minor, teacher.major], axis=1)
        shapes = np.stack([teacher.condition, teacher.volume], axis=1)
        if len(self._order) > 1:
            _most_promising(directions, shapes, *self._bounds, leaf)
        # neighbours in this order open the same leaves, which then are still in the processor's cache
        turn = np.argsort(leaf, kind="stable")
        _search(
            directions, shapes, turn, self._order, self._members, self._shape, self._narrow, self._middle,
            *self._bounds, index, score,
        )  # fmt: skip
        return index, score


def _leaf_size(student: EllipsoidFeatures) -> int:
    """Choose the size of the leaves so that opening one takes about as long as going through all promises.

    A small set whose shapes allow it is one leaf: scoring all is then faster than any promise.
    """
    count = len(student.volume)
    if count <= ONE_LEAF and max(np.ptp(student.condition), np.ptp(student.volume)) <= 2.0 * NARROW:
        return max(count + -count % LANES, LANES)
    return max(SMALLEST_LEAF, 1 << int(np.ceil(np.log2(1.3 * np.sqrt(count)))))


def _in_rows(array: Array) -> Array:
    """Break the last axis, a multiple of sixteen long, into the rows of a block."""
    return np.ascontiguousarray(array).reshape(*array.shape[:-1], -1, *WIDEST.shape[1:])


def _sorting_features(student: EllipsoidFeatures) -> Array:
    """Coordinates to sort by, shape (m, d (d + 1) + 2): axes as outer products, which have no sign."""
    rows, columns = np.triu_indices(student.minor.shape[1])
    weight = np.where(rows == columns, 1.0, np.sqrt(2.0))
    outer = [v[:, rows] * v[:, columns] * weight for v in (student.minor, student.major)]
    return np.concatenate([*outer, student.condition[:, None], student.volume[:, None]], axis=1)


def _leaves(node: object, size: int) -> Iterator[tuple[int, int]]:
    """Go through the leaves of a SciPy tree; yields where they start and stop in its order.

    Equal points cannot be told apart by a tree, which then has larger leaves; these are cut into pieces.
    """
    waiting = [node]
    while waiting:
        here = waiting.pop()
        if here.split_dim < 0:  # type: ignore[attr-defined]
            start, stop = here.start_idx, here.end_idx  # type: ignore[attr-defined]
            yield from ((first, min(first + size, stop)) for first in range(start, stop, size))
        else:
            waiting += [here.greater, here.lesser]  # type: ignore[attr-defined]


def _cone(vectors: Array) -> tuple[Array, Array, Array]:
    """Narrow cones about the unit vectors of each leaf, shape (b, size, d), whatever their signs.

    Returns axes (b, d), cosines and sines (b,) of half the opening. Zero vectors (undefined directions) fit into any.
    """
    _, frames = eigh(np.swapaxes(vectors, 1, 2) @ vectors)
    axis = frames[:, :, -1]
    along = np.abs(np.einsum("bsd,bd->bs", vectors, axis))
    along = np.where(np.any(vectors != 0.0, axis=2), along, 1.0).min(axis=1)
    cosine = np.clip(along - SLACK, 0.0, 1.0)
    return axis, cosine, np.sqrt(1.0 - cosine**2)


@compiled
def _most_promising(directions_t, shape_t, axis, opening, low, high, leaf):  # type: ignore[no-untyped-def]
    """Fill `leaf` with the leaf that promises most to each query."""
    promise = np.empty(low[0].shape)
    for i in range(len(leaf)):
        _promises(directions_t[i], shape_t[i], axis, opening, low, high, promise)
        leaf[i] = _place_of_largest(promise)


@compiled
def _search(  # type: ignore[no-untyped-def]
    directions_t, shape_t, turn, order, members, shape, narrow, middle, axis, opening, low, high, index, score
):
    """Fill `index` and `score` by branch and bound, query after query in the order of `turn`."""
    promise, value = np.empty(low[0].shape), np.empty(members[0, 0].shape)
    promises, values = promise.ravel(), value.ravel()
    for i in turn:
        _promises(directions_t[i], shape_t[i], axis, opening, low, high, promise)
        best, best_index = -1.0, 0
        while True:
            leaf = _place_of_largest(promise)
            if promises[leaf] < best or promises[leaf] < 0.0:
                break
            promises[leaf] = -1.0
            _scores(directions_t[i], shape_t[i], members[leaf], shape[leaf], narrow[leaf], middle[leaf], value)
            found = values[_place_of_largest(value)]
            if found < best - TIE:
                continue
            if found > best + TIE:
                best_index = order.size
            best = max(best, found)
            for j in range(order.shape[1]):
                if values[j] >= best - TIE:
                    best_index = min(best_index, order[leaf, j])
        index[i], score[i] = best_index, best


@compiled
def _place_of_largest(rows):  # type: ignore[no-untyped-def]
    """Return the first place of the largest number in a block, counted row after row."""
    top = load(rows, 0)
    for row in range(1, len(rows)):
        x = load(rows, row)
        top = where(x > top, x, top)
    for row in range(len(rows)):
        if not everywhere(load(rows, row) < top):
            for lane in range(width(rows)):
                if not anywhere(top > take(rows, row, lane)):
                    return row * width(rows) + lane
    return 0


@compiled
def _promises(direction, shape, axis, opening, low, high, promise):  # type: ignore[no-untyped-def]
    """Bound the score of the members of each leaf from above, a row of leaves at a time."""
    d = len(axis) // 2
    for row in range(len(promise)):
        total = spread(SLACK, promise)
        for side in range(2):
            x = spread(0.0, promise)
            for k in range(side * d, side * d + d):
                x = x + load(axis[k], row) * direction[k]
            # the axis nearest to the query within the cone: cos(max(0, angle − opening))
            x, cosine, sine = magnitude(x), load(opening[2 * side], row), load(opening[2 * side + 1], row)
            rest = 1.0 - x * x
            turned = x * cosine + root(where(rest > 0.0, rest, 0.0)) * sine
            total = total + where(cosine > x, turned, 1.0)
            # exp(−g) ≤ 1 / (1 + g + g²/2 + g³/6), which costs no exponential
            below, above = load(low[side], row) - shape[side], shape[side] - load(high[side], row)
            g = where(below > above, below, above)
            g = where(g > 0.0, g, 0.0)
            total = total + 1.0 / (1.0 + g * (1.0 + g * (0.5 + g * SIXTH)))
        store(promise, row, total)


@compiled
def _scores(direction, shape_t, members, shape, narrow, middle, value):  # type: ignore[no-untyped-def]
    """Score the members of one leaf, a row at a time."""
    d = len(members) // 2
    p, v = shape_t[0] - middle[0], shape_t[1] - middle[1]
    # far from the leaf the exponentials would overflow; there they are below rounding anyway
    up_p, up_v = np.exp(min(max(p, -FARTHEST), FARTHEST)), np.exp(min(max(v, -FARTHEST), FARTHEST))
    down_p, down_v = 1.0 / up_p, 1.0 / up_v
    for row in range(len(value)):
        low, high = spread(0.0, value), spread(0.0, value)
        for k in range(d):
            low = low + load(members[k], row) * direction[k]
            high = high + load(members[d + k], row) * direction[d + k]
        total = magnitude(low) + magnitude(high)
        if narrow:
            x, y = load(shape[4], row) * up_p, load(shape[2], row) * down_p
            near = where(x < y, x, y)
            x, y = load(shape[5], row) * up_v, load(shape[3], row) * down_v
            total = total + (near + where(x < y, x, y))
        store(value, row, total)
    if not narrow:
        for row in range(len(value)):
            for lane in range(width(value)):
                for k in range(2):
                    gap = abs(shape_t[k] - take(shape[k], row, lane))
                    if gap < NEGLIGIBLE:
                        put(value, row, lane, take(value, row, lane) + np.exp(-gap))
