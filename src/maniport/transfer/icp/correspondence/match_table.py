"""The best match by score between two clouds that are not large, all of whose shapes are compared once.

Turning a cloud changes directions alone: how alike two ellipsoids are in condition and volume stays. It is worked out
for all pairs, and the student's are sorted into leaves of like shape. A teacher ellipsoid opens the leaves in the order
of the likest shape in each, until directions that agree wholly could no longer make up for it.
"""

import numpy as np

from maniport.compiling import njit
from maniport.spd.kernels import LANES, WIDEST
from maniport.spd.kernels.pieces import exp
from maniport.spd.kernels.words import anywhere, load, magnitude, spread, store, take, width
from maniport.transfer.icp.correspondence.contract import Indices
from maniport.transfer.icp.correspondence.match_tree import SLACK, TIE, EllipsoidFeatures
from maniport.validation import Array

PARTS = "dd964c72f705"
"""Digest of `lanes.py`, `pieces.py` and `words.py` in `spd/kernels`. Numba's cache does not see the files of the
functions called from here: whenever one changes, so must this line. A test tells the digest."""

LARGEST_TABLE = 512 * 512
"""Most pairs that are compared: 2 MB, about what a processor's cache holds."""

compiled = njit(cache=True, nogil=True, error_model="numpy")


class MatchTable:
    """Two clouds, prepared for matching under many rotations."""

    def __init__(self, teacher: EllipsoidFeatures, student: EllipsoidFeatures):
        self._teacher = np.concatenate([teacher.minor, teacher.major], axis=1)
        self._order = _leaves(student)
        members = np.concatenate([student.minor, student.major], axis=1)[self._order]
        self._members = _in_rows(members.transpose(0, 2, 1))
        shapes = _in_rows(np.stack([student.condition[self._order], student.volume[self._order]], axis=1))
        pairs = len(self._teacher), len(self._order)
        self._likeness = np.empty((*pairs, *shapes.shape[2:]))
        self._turn, self._promise = np.empty(pairs, np.intp), np.empty(pairs)
        _compare(teacher.condition, teacher.volume, shapes, self._likeness, self._turn, self._promise)

    def query(self, rotation: Array, seeking: Indices) -> tuple[Indices, Array]:
        """For some teacher ellipsoids, turned, the index of the best match and the score, shapes (n,)."""
        d = len(rotation)
        directions = (self._teacher[seeking].reshape(-1, d) @ rotation.T).reshape(-1, 2 * d)
        index, score = np.empty(len(seeking), np.intp), np.empty(len(seeking))
        _search(
            directions, seeking, self._order, self._members, self._likeness, self._turn, self._promise, index, score
        )
        return index, score


def _leaves(student: EllipsoidFeatures) -> Indices:
    """Sort ellipsoids by condition, and within parts of equal size by volume; shape (b, 16), the last one repeated."""
    count = len(student.volume)
    leaves = -(-count // LANES)
    order = np.argsort(student.condition, kind="stable")
    size = LANES * -(-leaves // round(np.sqrt(leaves)))
    for first in range(0, count, size):
        part = order[first : first + size]
        part[:] = part[np.argsort(student.volume[part], kind="stable")]
    return np.pad(order, (0, leaves * LANES - count), mode="edge").reshape(leaves, LANES)


def _in_rows(array: Array) -> Array:
    """Break the last axis, sixteen long, into the rows of a block."""
    return np.ascontiguousarray(array).reshape(*array.shape[:-1], -1, *WIDEST.shape[1:])


@compiled
def _compare(condition, volume, shapes, likeness, turn, promise):  # type: ignore[no-untyped-def]
    """Fill what condition and volume add to each score, and the leaves by the most that scores there can be."""
    for i in range(len(turn)):
        for leaf in range(turn.shape[1]):
            shape, like, best = shapes[leaf], likeness[i, leaf], 0.0
            for row in range(len(like)):
                one = exp(-magnitude(load(shape[0], row) - condition[i]))
                store(like, row, one + exp(-magnitude(load(shape[1], row) - volume[i])))
            for row in range(len(like)):
                for lane in range(width(like)):
                    best = max(best, take(like, row, lane))
            best += 2.0 + SLACK
            place = leaf
            while place > 0 and promise[i, place - 1] < best:
                promise[i, place], turn[i, place] = promise[i, place - 1], turn[i, place - 1]
                place -= 1
            promise[i, place], turn[i, place] = best, leaf


@compiled
def _search(directions, seeking, order, members, likeness, turn, promise, index, score):  # type: ignore[no-untyped-def]
    """Fill `index` and `score`: the largest score and, of equal ones, the first."""
    d = directions.shape[1] // 2
    value = np.empty(members[0, 0].shape)
    for i in range(len(seeking)):
        here, best, best_index = seeking[i], -1.0, 0
        for place in range(turn.shape[1]):
            if promise[here, place] < best:
                break
            leaf = turn[here, place]
            member, like = members[leaf], likeness[here, leaf]
            near = False
            for row in range(len(value)):
                low, high = spread(0.0, value), spread(0.0, value)
                for k in range(d):
                    low = low + load(member[k], row) * directions[i, k]
                    high = high + load(member[d + k], row) * directions[i, d + k]
                total = magnitude(low) + magnitude(high) + load(like, row)
                store(value, row, total)
                near = near or anywhere(total > best - TIE)
            if not near:
                continue
            found = best
            for row in range(len(value)):
                for lane in range(width(value)):
                    found = max(found, take(value, row, lane))
            if found > best + TIE:
                best_index = order.size
            best = found
            for row in range(len(value)):
                for lane in range(width(value)):
                    if take(value, row, lane) >= best - TIE:
                        best_index = min(best_index, order[leaf, row * width(value) + lane])
        index[i], score[i] = best_index, best
