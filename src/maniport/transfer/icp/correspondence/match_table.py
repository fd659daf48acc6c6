"""The best match by score between two clouds that are not large, all of whose shapes are compared once.

Turning a cloud changes directions alone: how alike two ellipsoids are in condition and volume stays. It is worked out
for all pairs, and the student's are sorted into leaves of like shape. A teacher ellipsoid opens the leaves in the order
of the likest shape in each, until directions that agree wholly could no longer make up for it.
"""

import numpy as np

from maniport.jit import kernel
from maniport.transfer.icp.correspondence.contract import Indices
from maniport.transfer.icp.correspondence.match_tree import SLACK, EllipsoidFeatures, add_alignment, improved
from maniport.validation import Array

LEAF = 16
"""Student ellipsoids of a leaf."""

LARGEST_TABLE = 512 * 512
"""Most pairs that are compared: 2 MB, about what a processor's cache holds."""


class MatchTable:
    """Two clouds, prepared for matching under many rotations."""

    def __init__(self, teacher: EllipsoidFeatures, student: EllipsoidFeatures):
        self._teacher = np.concatenate([teacher.minor, teacher.major], axis=1)
        self._order = _leaves(student)
        members = np.concatenate([student.minor, student.major], axis=1)[self._order]
        self._members = np.ascontiguousarray(members.transpose(0, 2, 1))
        gaps = [
            np.abs(a[:, None, None] - b[self._order])
            for a, b in ((teacher.condition, student.condition), (teacher.volume, student.volume))
        ]
        self._likeness = np.exp(-gaps[0]) + np.exp(-gaps[1])  # (teacher ellipsoids, leaves, LEAF)
        promise = self._likeness.max(axis=2) + (2.0 + SLACK)
        self._turn = np.argsort(-promise, axis=1, kind="stable")
        self._promise = np.take_along_axis(promise, self._turn, axis=1)

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
    leaves = -(-count // LEAF)
    order = np.argsort(student.condition, kind="stable")
    size = LEAF * -(-leaves // round(np.sqrt(leaves)))
    for first in range(0, count, size):
        part = order[first : first + size]
        part[:] = part[np.argsort(student.volume[part], kind="stable")]
    return np.pad(order, (0, leaves * LEAF - count), mode="edge").reshape(leaves, LEAF)


@kernel
def _search(directions, seeking, order, members, likeness, turn, promise, index, score):  # type: ignore[no-untyped-def]
    """Fill `index` and `score`: the largest score and, of equal ones, the first."""
    values, products = np.empty(order.shape[1]), np.empty(order.shape[1])
    for i in range(len(seeking)):
        here, best, best_index = seeking[i], -1.0, 0
        for place in range(turn.shape[1]):
            if promise[here, place] < best:
                break
            leaf = turn[here, place]
            for j in range(len(values)):
                values[j] = likeness[here, leaf, j]
            add_alignment(directions, i, members, leaf, products, values)
            best, best_index = improved(best, best_index, values, order, leaf)
        index[i], score[i] = best_index, best
