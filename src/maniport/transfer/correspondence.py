"""Who matches whom: the paper's score of two ellipsoids, and the best match among very many.

The best match is found without scoring all pairs, and never another one than the best. The student's ellipsoids are
sorted into leaves of similar direction, condition and volume. For a teacher ellipsoid, each leaf promises a score that
none of its members exceeds; the leaves are opened in the order of their promises until the next promise is below the
best score found (branch and bound).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.spd.kernels import eigh
from maniport.validation import Array

Indices = NDArray[np.intp]

EQUAL_EIGENVALUES = 1e-6
"""Relative gap below which an eigenvector is undefined and must not decide a match."""

SMALLEST_LEAF = 64
ONE_LEAF = 512

LANES = 8

NARROW = 300.0
"""Half the range of condition or volume in a leaf up to which exponentials are taken once and for all.

There exp(−|a − b|) is the smaller of e^a e^-b and e^-a e^b, exact to 1e-13.
"""

FARTHEST = 600.0
"""A query farther than this from the middle of such a leaf is taken to be this far: exp(−300) is nothing either way."""

NEGLIGIBLE = 40.0
"""exp(−40) is 4e-18: below the rounding of a score."""

TIE = 1e-12
"""Scores that differ by less are equal: rounding depends on the leaf."""

SLACK = 1e-9
"""What promises are raised by, against rounding."""


@dataclass(frozen=True)
class EllipsoidFeatures:
    """What the paper's score compares (Reithmeir et al. 2022, eq. 16).

    Attributes
    ----------
    minor, major : ndarray, shape (n, d)
        Eigenvectors of the smallest and the largest eigenvalue; zero where they are undefined.
    condition : ndarray, shape (n,)
        λ_max / λ_min, which the paper calls the inverse condition number.
    volume : ndarray, shape (n,)
        Product of the semi-axes.
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


def match(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """For every teacher ellipsoid the student ellipsoid with the largest score.

    The score is |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|), between 0 and 4
    (Reithmeir et al. 2022, eq. 16). Of scores that are equal to 1e-12 the first one wins.

    Returns
    -------
    index : ndarray, shape (n,)
        Into the student's set.
    score : ndarray, shape (n,)
    """
    return MatchTree(student).query(teacher)


def match_numpy(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """Same as `match` in plain NumPy, with memory of the size n × m."""
    score = np.abs(teacher.minor @ student.minor.T) + np.abs(teacher.major @ student.major.T)
    score += np.exp(-np.abs(teacher.condition[:, None] - student.condition))
    score += np.exp(-np.abs(teacher.volume[:, None] - student.volume))
    index = np.argmax(score, axis=1)
    return index, score[np.arange(len(index)), index]


class MatchTree:
    """The student's ellipsoids, sorted for matching; memory grows with their number only.

    Parameters
    ----------
    student : EllipsoidFeatures
    """

    def __init__(self, student: EllipsoidFeatures):
        size = _leaf_size(student)
        tree = cKDTree(_sorting_features(student), leafsize=size, compact_nodes=False)
        spans = np.array(list(_leaves(tree.tree, size)))
        slot = np.arange(size)
        filled = slot < np.diff(spans, axis=1)
        place = np.where(filled, spans[:, :1] + slot, spans[:, :1])  # places beyond a leaf's end repeat its first
        order = np.asarray(tree.indices, dtype=np.intp)[place]
        shape = np.stack([student.condition[order], student.volume[order]], axis=1)
        self._order = order
        self._directions = np.ascontiguousarray(
            np.concatenate([student.minor[order], student.major[order]], axis=2).transpose(0, 2, 1)
        )
        low, high = shape.min(axis=2), shape.max(axis=2)
        self._low, self._high = np.ascontiguousarray(low.T), np.ascontiguousarray(high.T)
        self._middle = 0.5 * (low + high)
        self._narrow = (high - low).max(axis=1) <= 2.0 * NARROW
        gap = shape - self._middle[:, :, None]
        up = np.exp(np.where(self._narrow[:, None, None], gap, 0.0))
        self._shape = np.ascontiguousarray(np.concatenate([shape, up, 1.0 / up], axis=1))
        cones = [_cone(vectors[order]) for vectors in (student.minor, student.major)]
        self._axis = np.ascontiguousarray(np.concatenate([axis for axis, _, _ in cones], axis=1).T)
        self._opening = np.stack([part for _, cosine, sine in cones for part in (cosine, sine)])

    def query(self, teacher: EllipsoidFeatures) -> tuple[Indices, Array]:
        """For every teacher ellipsoid the index of its best match and the score, shapes (n,)."""
        count = len(teacher.volume)
        index, score, leaf = np.zeros(count, np.intp), np.empty(count), np.zeros(count, np.intp)
        directions = np.concatenate([teacher.minor, teacher.major], axis=1)
        shapes = np.stack([teacher.condition, teacher.volume], axis=1)
        cones = self._axis, self._opening, self._low, self._high
        if self._order.shape[0] > 1:
            _most_promising(directions, shapes, *cones, leaf)
        # neighbours in this order open the same leaves, which then are still in the processor's cache
        turn = np.argsort(leaf, kind="stable")
        _search(
            directions, shapes, turn, self._order, self._directions, self._shape, self._narrow, self._middle, *cones,
            index, score,
        )  # fmt: skip
        return index, score


def _leaf_size(student: EllipsoidFeatures) -> int:
    """Choose the size of the leaves so that opening one takes about as long as going through all promises.

    A small set whose shapes allow it is one leaf: scoring all is then faster than any promise.
    """
    count = len(student.volume)
    if count <= ONE_LEAF and max(np.ptp(student.condition), np.ptp(student.volume)) <= 2.0 * NARROW:
        return max(count, 1)
    return max(SMALLEST_LEAF, 1 << int(np.ceil(np.log2(1.3 * np.sqrt(count)))))


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

    Returns
    -------
    axis : ndarray, shape (b, d)
    cosine, sine : ndarray, shape (b,)
        Of half the opening. Zero vectors (undefined directions) fit into any cone.
    """
    _, frames = eigh(np.swapaxes(vectors, 1, 2) @ vectors)
    axis = frames[:, :, -1]
    along = np.abs(np.einsum("bsd,bd->bs", vectors, axis))
    along = np.where(np.any(vectors != 0.0, axis=2), along, 1.0).min(axis=1)
    cosine = np.clip(along - SLACK, 0.0, 1.0)
    return axis, cosine, np.sqrt(1.0 - cosine**2)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _most_promising(directions_t, shape_t, axis, opening, low, high, leaf):  # type: ignore[no-untyped-def]
    """Fill `leaf` with the leaf that promises most to each query."""
    d, leaves = axis.shape[0] // 2, axis.shape[1]
    promise, dot = np.empty(leaves), np.empty((2, leaves))
    for i in range(len(leaf)):
        _promises(directions_t[i], shape_t[i], d, axis, opening, low, high, dot, promise)
        top = _largest(promise)
        while promise[leaf[i]] != top:
            leaf[i] += 1


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _search(  # type: ignore[no-untyped-def]
    directions_t, shape_t, turn, order, directions, shape, narrow, middle, axis, opening, low, high, index, score
):
    """Fill `index` and `score` by branch and bound, query after query in the order of `turn`."""
    d, leaves, size = axis.shape[0] // 2, order.shape[0], order.shape[1]
    promise, value, dot = np.empty(leaves), np.empty(size), np.empty((2, max(size, leaves)))
    for i in turn:
        _promises(directions_t[i], shape_t[i], d, axis, opening, low, high, dot, promise)
        best, best_index = -1.0, 0
        while True:
            top = _largest(promise)
            if top < best or top < 0.0:
                break
            leaf = 0
            while promise[leaf] != top:
                leaf += 1
            promise[leaf] = -1.0
            members, shapes = directions[leaf], shape[leaf]
            _scores(directions_t[i], shape_t[i], d, members, shapes, narrow[leaf], middle[leaf], dot, value)
            found = _largest(value)
            if found < best - TIE:
                continue
            if found > best + TIE:
                best_index = order.size
            best = max(best, found)
            for j in range(size):
                if value[j] >= best - TIE:
                    best_index = min(best_index, order[leaf, j])
        index[i], score[i] = best_index, best


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def _largest(values):  # type: ignore[no-untyped-def]
    """Return the largest value; eight at a time, which the compiler turns into vector instructions."""
    lanes = np.full(LANES, values[0])
    whole = len(values) - len(values) % LANES
    for j in range(0, whole, LANES):
        for lane in range(LANES):
            lanes[lane] = max(lanes[lane], values[j + lane])
    top = lanes[0]
    for lane in range(1, LANES):
        top = max(top, lanes[lane])
    for j in range(whole, len(values)):
        top = max(top, values[j])
    return top


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _promises(direction, shape, d, axis, opening, low, high, dot, promise):  # type: ignore[no-untyped-def]
    """Bound the score of the members of each leaf from above."""
    leaves = len(promise)
    for side in range(2):
        for b in range(leaves):
            dot[side, b] = 0.0
        for k in range(side * d, side * d + d):
            for b in range(leaves):
                dot[side, b] += direction[k] * axis[k, b]
    p, volume = shape[0], shape[1]
    for b in range(leaves):
        # the axis nearest to the query within the cone: cos(max(0, angle − opening))
        x, y = abs(dot[0, b]), abs(dot[1, b])
        turned = x * opening[0, b] + np.sqrt(max(0.0, 1.0 - x * x)) * opening[1, b]
        minor = 1.0 if x >= opening[0, b] else turned
        turned = y * opening[2, b] + np.sqrt(max(0.0, 1.0 - y * y)) * opening[3, b]
        major = 1.0 if y >= opening[2, b] else turned
        # exp(−g) ≤ 1 / (1 + g + g²/2 + g³/6), which costs no exponential
        g = max(0.0, max(low[0, b] - p, p - high[0, b]))
        h = max(0.0, max(low[1, b] - volume, volume - high[1, b]))
        shapes = 1.0 / (1.0 + g * (1.0 + g * (0.5 + g / 6.0))) + 1.0 / (1.0 + h * (1.0 + h * (0.5 + h / 6.0)))
        promise[b] = minor + major + shapes + SLACK


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _scores(direction, shape_t, d, directions, shape, narrow, middle, dot, value):  # type: ignore[no-untyped-def]
    """Score the members of one leaf."""
    size = len(value)
    low, high = dot[0], dot[1]
    first, second = directions[d - 2], directions[d - 1]
    third, fourth = directions[2 * d - 2], directions[2 * d - 1]
    for j in range(size):
        low[j] = direction[d - 2] * first[j] + direction[d - 1] * second[j]
        high[j] = direction[2 * d - 2] * third[j] + direction[2 * d - 1] * fourth[j]
    for k in range(d - 2):
        first, second = directions[k], directions[d + k]
        for j in range(size):
            low[j] += direction[k] * first[j]
            high[j] += direction[d + k] * second[j]
    if narrow:
        p, v = shape_t[0] - middle[0], shape_t[1] - middle[1]
        up_p, up_v = np.exp(min(max(p, -FARTHEST), FARTHEST)), np.exp(min(max(v, -FARTHEST), FARTHEST))
        down_p, down_v = 1.0 / up_p, 1.0 / up_v
        more_p, more_v, less_p, less_v = shape[2], shape[3], shape[4], shape[5]
        for j in range(size):
            near_p = min(up_p * less_p[j], down_p * more_p[j])
            near_v = min(up_v * less_v[j], down_v * more_v[j])
            value[j] = abs(low[j]) + abs(high[j]) + (near_p + near_v)
    else:
        for j in range(size):
            near = 0.0
            for k in range(2):
                gap = abs(shape_t[k] - shape[k, j])
                if gap < NEGLIGIBLE:
                    near += np.exp(-gap)
            value[j] = abs(low[j]) + abs(high[j]) + near
