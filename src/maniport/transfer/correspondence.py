"""Who matches whom: the paper's score of two ellipsoids, and the exact nearest neighbour on the manifold."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply, congruence, roots, to_vector
from maniport.validation import Array

Indices = NDArray[np.intp]

EQUAL_EIGENVALUES = 1e-6
"""Relative gap below which an eigenvector is undefined and must not decide a match."""

NEGLIGIBLE = 40.0
"""exp(−40) is 4e-18: below the rounding of a score."""

EXPONENT_RANGE = 300.0
"""Features within ±300 of their middle can be exponentiated, and multiplied, without overflow."""

BLOCK = 512
"""Student ellipsoids that are scored at once: few enough to stay in the fastest cache."""

LANES = 8


CANDIDATE_BYTES = 16_000_000
"""Size of the largest array of candidates in a neighbour search, which takes a few times as much."""


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
    """For every teacher ellipsoid the student ellipsoid with the largest score, the first one on ties.

    The score is |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|), between 0 and 4
    (Reithmeir et al. 2022, eq. 16).

    Returns
    -------
    index : ndarray, shape (n,)
        Into the student's set.
    score : ndarray, shape (n,)
    """
    index, score = np.empty(len(teacher.volume), np.intp), np.empty(len(teacher.volume))
    narrow, shape_t, shape_s = _shapes(teacher, student)
    kernel = _best_matches if narrow else _best_matches_wide
    directions_t = np.ascontiguousarray(teacher.minor.T), np.ascontiguousarray(teacher.major.T)
    directions_s = np.ascontiguousarray(student.minor.T), np.ascontiguousarray(student.major.T)
    kernel(*directions_t, shape_t, *directions_s, shape_s, index, score)
    return index, score


def match_numpy(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """Same as `match` in plain NumPy, with memory of the size n × m."""
    score = np.abs(teacher.minor @ student.minor.T) + np.abs(teacher.major @ student.major.T)
    score += np.exp(-np.abs(teacher.condition[:, None] - student.condition))
    score += np.exp(-np.abs(teacher.volume[:, None] - student.volume))
    index = np.argmax(score, axis=1)
    return index, score[np.arange(len(index)), index]


class NeighborIndex:
    """Exact nearest neighbours among SPD matrices under the affine-invariant distance.

    A KD-tree on matrix logarithms proposes candidates. The log-Euclidean distance never exceeds the affine-invariant
    one (Bhatia 2007, eq. 6.13), so that the search may stop as soon as the next candidate is farther in log space
    than the best one found is on the manifold.

    Parameters
    ----------
    points : ndarray, shape (m, d, d)
        SPD, m ≥ 1.
    """

    def __init__(self, points: Array):
        self.points = points
        # A congruence changes no affine-invariant distance, and about the identity the two metrics agree best.
        _, self._whitening = roots(apply(apply(points, np.log).mean(axis=0), np.exp))
        self._cloud = congruence(self._whitening, points)
        self._tree = cKDTree(to_vector(apply(self._cloud, np.log)))

    def query(self, queries: Array) -> tuple[Indices, Array]:
        """For every query, shape (n, d, d), the index of the nearest point and the distance to it, shapes (n,)."""
        asked = congruence(self._whitening, queries)
        vectors = to_vector(apply(asked, np.log))
        best, distance = np.zeros(len(asked), np.intp), np.full(len(asked), np.inf)
        open_queries = np.arange(len(asked))
        count = min(8, len(self._cloud))
        while len(open_queries):
            block = max(1, CANDIDATE_BYTES // (count * asked[0].nbytes))
            still_open = []
            for part in np.split(open_queries, range(block, len(open_queries), block)):
                lower, candidates = self._tree.query(vectors[part], k=[*range(1, count + 1)])
                found = distance_unchecked(asked[part][:, None], self._cloud[candidates])
                choice, rows = np.argmin(found, axis=1), np.arange(len(part))
                best[part], distance[part] = candidates[rows, choice], found[rows, choice]
                still_open.append(part[lower[:, -1] < distance[part]])
            if count == len(self._cloud):
                break
            open_queries = np.concatenate(still_open)
            count = min(4 * count, len(self._cloud))
        return best, distance


def nearest(queries: Array, points: Array) -> tuple[Indices, Array]:
    """Index of the nearest of `points` (m, d, d) and the distance to it, for every query (n, d, d)."""
    return NeighborIndex(points).query(queries)


def _shapes(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[bool, Array, Array]:
    """Return whether p and vol could be exponentiated, and what the kernels want of them for both sets."""
    both = [np.stack([one.condition, one.volume]) for one in (teacher, student)]
    every = np.concatenate(both, axis=1)
    middle = 0.5 * (every.min(axis=1) + every.max(axis=1))[:, None]
    if np.abs(every - middle).max() > EXPONENT_RANGE:
        return False, both[0], both[1]
    up_t, up_s = np.exp(both[0] - middle), np.exp(both[1] - middle)
    return (
        True,
        np.stack([up_t, 1.0 / up_t], axis=1).reshape(4, -1),
        np.stack([up_s, 1.0 / up_s], axis=1).reshape(4, -1),
    )


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz", "reassoc"})
def _best_matches(minor_t, major_t, shape_t, minor_s, major_s, shape_s, index, score):  # type: ignore[no-untyped-def]
    """Fill `index` and `score` by trying every pair; nothing of the size n × m is stored.

    Directions are (d, n) and (d, m); shapes hold e^p, e^-p, e^vol, e^-vol, so that exp(−|a − b|) is the smaller of
    e^a e^-b and e^-a e^b and no exponential is left in the loop.
    """
    d, count = minor_s.shape
    # local copies: the compiler knows that they do not overlap and have unit stride, and so uses vector instructions
    low, high, value = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    minor, major, shape = np.zeros((d, BLOCK)), np.zeros((d, BLOCK)), np.zeros((4, BLOCK))
    lanes = np.empty(LANES)
    score[:] = -1.0
    for first in range(0, count, BLOCK):
        size = min(BLOCK, count - first)
        minor[:, :size], major[:, :size] = minor_s[:, first : first + size], major_s[:, first : first + size]
        shape[:, :size] = shape_s[:, first : first + size]
        for i in range(minor_t.shape[1]):
            up_p, down_p, up_v, down_v = shape_t[0, i], shape_t[1, i], shape_t[2, i], shape_t[3, i]
            low[:] = 0.0
            high[:] = 0.0
            for k in range(d - 2):
                a, b = minor_t[k, i], major_t[k, i]
                for j in range(BLOCK):
                    low[j] += a * minor[k, j]
                    high[j] += b * major[k, j]
            a0, a1, b0, b1 = minor_t[d - 2, i], minor_t[d - 1, i], major_t[d - 2, i], major_t[d - 1, i]
            for j in range(BLOCK):
                v1 = low[j] + a0 * minor[d - 2, j] + a1 * minor[d - 1, j]
                vn = high[j] + b0 * major[d - 2, j] + b1 * major[d - 1, j]
                p = min(up_p * shape[1, j], down_p * shape[0, j])
                vol = min(up_v * shape[3, j], down_v * shape[2, j])
                value[j] = abs(v1) + abs(vn) + (p + vol)
            lanes[:] = -1.0
            for j in range(0, BLOCK, LANES):
                for lane in range(LANES):
                    lanes[lane] = max(lanes[lane], value[j + lane])
            if lanes.max() > score[i]:
                for j in range(size):
                    if value[j] > score[i]:
                        score[i], index[i] = value[j], first + j


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _best_matches_wide(minor_t, major_t, shape_t, minor_s, major_s, shape_s, index, score):  # type: ignore[no-untyped-def]
    """Same as `_best_matches` for features too far apart to be exponentiated: shapes hold p and vol themselves."""
    d, count = minor_s.shape
    for i in range(minor_t.shape[1]):
        best, best_j = -1.0, 0
        for j in range(count):
            low, high = 0.0, 0.0
            for k in range(d):
                low += minor_t[k, i] * minor_s[k, j]
                high += major_t[k, i] * major_s[k, j]
            value = abs(low) + abs(high)
            if value + 2.0 <= best:
                continue
            for k in range(2):
                gap = abs(shape_t[k, i] - shape_s[k, j])
                if gap < NEGLIGIBLE:
                    value += np.exp(-gap)
            if value > best:
                best, best_j = value, j
        index[i], score[i] = best_j, best
