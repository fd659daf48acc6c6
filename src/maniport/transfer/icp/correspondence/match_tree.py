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

from maniport.jit import kernel, part
from maniport.spd.kernels import eigh
from maniport.transfer.icp.correspondence.contract import Indices
from maniport.validation import Array

EQUAL_EIGENVALUES = 1e-6
"""Relative gap below which an eigenvector is undefined and must not decide a match."""

SIXTH = 1.0 / 6.0

SMALLEST_LEAF = 64
ONE_LEAF = 512

NARROW = 600.0
"""Half the range of condition or volume in a leaf up to which exponentials are taken once and for all.

There exp(−|a − b|) is the smaller of e^a e^-b and e^-a e^b, exact to 2e-13.
"""

MAX_POSITION = 700.0
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
        self._members = np.ascontiguousarray(directions)
        self._shape = np.concatenate([shape, up, 1.0 / up], axis=1)
        cones = [_cone(vectors[order]) for vectors in (student.minor, student.major)]
        axis = np.concatenate([axis for axis, _, _ in cones], axis=1).T
        opening = np.stack([part for _, cosine, sine in cones for part in (cosine, sine)])
        self._bounds = tuple(map(np.ascontiguousarray, (axis, opening, low.T, high.T)))

    def query(self, teacher: EllipsoidFeatures) -> tuple[Indices, Array]:
        """For every teacher ellipsoid the index of its best match and the score, shapes (n,)."""
        count = len(teacher.volume)
        index, score = np.zeros(count, np.intp), np.empty(count)
        directions = np.concatenate([teacher.minor, teacher.major], axis=1)
        shapes = np.stack([teacher.condition, teacher.volume], axis=1)
        # neighbours open the same leaves, which then are still in the processor's cache
        turn = np.asarray(cKDTree(_sorting_features(teacher)).indices)
        _search(
            directions, shapes, turn, self._order, self._members, self._shape, self._narrow, self._middle,
            *self._bounds, index, score,
        )  # fmt: skip
        return index, score


def _leaf_size(student: EllipsoidFeatures) -> int:
    """Choose the size of the leaves so that opening one takes about as long as going through all promises."""
    count = len(student.volume)
    if count <= ONE_LEAF and max(np.ptp(student.condition), np.ptp(student.volume)) <= 2.0 * NARROW:
        return count
    return max(SMALLEST_LEAF, 1 << int(np.ceil(np.log2(1.3 * np.sqrt(count)))))


def _sorting_features(student: EllipsoidFeatures) -> Array:
    """Coordinates to sort by, shape (m, d (d + 1) + 2): axes as outer products, which have no sign."""
    rows, columns = np.triu_indices(student.minor.shape[1])
    weight = np.where(rows == columns, 1.0, np.sqrt(2.0))
    outer = [v[:, rows] * v[:, columns] * weight for v in (student.minor, student.major)]
    return np.concatenate([*outer, student.condition[:, None], student.volume[:, None]], axis=1)


def _leaves(node: object, size: int) -> Iterator[tuple[int, int]]:
    """Go through the leaves of a SciPy tree; yields where they start and stop in its order."""
    waiting = [node]
    while waiting:
        here = waiting.pop()
        if here.split_dim < 0:  # type: ignore[attr-defined]
            start, stop = here.start_idx, here.end_idx  # type: ignore[attr-defined]
            yield from ((first, min(first + size, stop)) for first in range(start, stop, size))
        else:
            waiting += [here.greater, here.lesser]  # type: ignore[attr-defined]


def _cone(vectors: Array) -> tuple[Array, Array, Array]:
    """Narrow cones about the unit vectors of each leaf, shape (b, size, d), whatever their signs."""
    _, frames = eigh(np.swapaxes(vectors, 1, 2) @ vectors)
    axis = frames[:, :, -1]
    along = np.abs(np.einsum("bsd,bd->bs", vectors, axis))
    along = np.where(np.any(vectors != 0.0, axis=2), along, 1.0).min(axis=1)
    cosine = np.clip(along - SLACK, 0.0, 1.0)
    return axis, cosine, np.sqrt(1.0 - cosine**2)


@kernel
def _search(  # type: ignore[no-untyped-def]
    directions_t, shapes_t, turn, order, members, shape, narrow, middle, axis, opening, low, high, index, score
):
    """Fill `index` and `score` by branch and bound, query after query in the order of `turn`."""
    promises, values = np.empty(low.shape[1]), np.empty(order.shape[1])
    products = np.empty(max(len(promises), len(values)))
    for n in range(len(turn)):
        i = turn[n]
        _fill_promises(directions_t, shapes_t, i, axis, opening, low, high, products, promises)
        best, best_index = -1.0, 0
        while True:
            leaf = _place_of_largest(promises)
            if promises[leaf] < best or promises[leaf] < 0.0:
                break
            promises[leaf] = -1.0
            _fill_likeness(shapes_t, i, shape, leaf, narrow, middle, values)
            add_alignment(directions_t, i, members, leaf, products, values)
            best, best_index = improved(best, best_index, values, order, leaf)
        index[i], score[i] = best_index, best


@part
def improved(best, best_index, values, order, leaf):  # type: ignore[no-untyped-def]
    """Return the best score and its index once those of one leaf are known: of equal scores the lowest index."""
    found = _largest(values)
    if found < best - TIE:
        return best, best_index
    if found > best + TIE:
        best_index = order.size
    best = max(best, found)
    for j in range(len(values)):
        if values[j] >= best - TIE:
            best_index = min(best_index, order[leaf, j])
    return best, best_index


@part(fastmath=True)
def _largest(values):  # type: ignore[no-untyped-def]
    largest = values[0]
    for j in range(1, len(values)):
        largest = max(largest, values[j])
    return largest


@part
def _place_of_largest(values):  # type: ignore[no-untyped-def]
    """Return the first place of the largest number."""
    largest, place = _largest(values), 0
    while values[place] < largest:
        place += 1
    return place


@part
def add_alignment(directions, i, members, leaf, products, values):  # type: ignore[no-untyped-def]
    """Add |v·w| of both directions of query i and of the members of a leaf, members[leaf] (2 d, size), to values."""
    d = directions.shape[1] // 2
    for side in range(2):
        for j in range(len(values)):
            products[j] = members[leaf, side * d, j] * directions[i, side * d]
        for k in range(side * d + 1, side * d + d):
            for j in range(len(values)):
                products[j] += members[leaf, k, j] * directions[i, k]
        for j in range(len(values)):
            values[j] += abs(products[j])


@part
def _fill_promises(directions_t, shapes_t, i, axis, opening, low, high, products, promises):  # type: ignore[no-untyped-def]
    """Bound the score of the members of each leaf from above."""
    d = len(axis) // 2
    for leaf in range(len(promises)):
        promises[leaf] = SLACK
    for side in range(2):
        for leaf in range(len(promises)):
            products[leaf] = axis[side * d, leaf] * directions_t[i, side * d]
        for k in range(side * d + 1, side * d + d):
            for leaf in range(len(promises)):
                products[leaf] += axis[k, leaf] * directions_t[i, k]
        for leaf in range(len(promises)):
            # the axis nearest to the query within the cone: cos(max(0, angle − opening))
            x, cosine, sine = abs(products[leaf]), opening[2 * side, leaf], opening[2 * side + 1, leaf]
            turned = x * cosine + np.sqrt(max(1.0 - x * x, 0.0)) * sine
            # exp(−g) ≤ 1 / (1 + g + g²/2 + g³/6), which costs no exponential
            g = max(low[side, leaf] - shapes_t[i, side], shapes_t[i, side] - high[side, leaf], 0.0)
            bound = 1.0 / (1.0 + g * (1.0 + g * (0.5 + g * SIXTH)))
            promises[leaf] += bound + (turned if cosine > x else 1.0)


@part
def _fill_likeness(shapes_t, i, shape, leaf, narrow, middle, values):  # type: ignore[no-untyped-def]
    """Fill what condition and volume of the members of a leaf contribute to the scores."""
    for j in range(len(values)):
        values[j] = 0.0
    for k in range(2):
        if narrow[leaf]:
            # far from the leaf the exponentials would overflow; there they are below rounding anyway
            up = np.exp(min(max(shapes_t[i, k] - middle[leaf, k], -MAX_POSITION), MAX_POSITION))
            down = 1.0 / up
            for j in range(len(values)):
                values[j] += min(shape[leaf, 4 + k, j] * up, shape[leaf, 2 + k, j] * down)
        else:
            for j in range(len(values)):
                gap = abs(shapes_t[i, k] - shape[leaf, k, j])
                if gap < NEGLIGIBLE:
                    values[j] += np.exp(-gap)
