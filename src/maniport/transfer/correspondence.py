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
    _best_matches(*_as_rows(teacher), *_as_rows(student), index, score)
    return index, score


def match_numpy(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """Same as `match` in plain NumPy, with memory of the size n × m."""
    score = np.abs(teacher.minor @ student.minor.T) + np.abs(teacher.major @ student.major.T)
    score += np.exp(-np.abs(teacher.condition[:, None] - student.condition))
    score += np.exp(-np.abs(teacher.volume[:, None] - student.volume))
    index = np.argmax(score, axis=1)
    return index, score[np.arange(len(index)), index]


def nearest(queries: Array, points: Array) -> tuple[Indices, Array]:
    """Exact nearest neighbours under the affine-invariant distance.

    A KD-tree on matrix logarithms proposes candidates. The log-Euclidean distance never exceeds the affine-invariant
    one (Bhatia 2007, eq. 6.13), so that the search may stop as soon as the next candidate is farther in log space
    than the best one found is on the manifold.

    Parameters
    ----------
    queries : ndarray, shape (n, d, d)
        SPD.
    points : ndarray, shape (m, d, d)
        SPD.

    Returns
    -------
    index : ndarray, shape (n,)
    distance : ndarray, shape (n,)
    """
    # A congruence changes no affine-invariant distance, and about the identity the two metrics agree best.
    _, whitening = roots(apply(apply(points, np.log).mean(axis=0), np.exp))
    cloud, asked = congruence(whitening, points), congruence(whitening, queries)
    tree = cKDTree(to_vector(apply(cloud, np.log)))
    vectors = to_vector(apply(asked, np.log))
    best = np.zeros(len(queries), np.intp)
    best_distance = np.full(len(queries), np.inf)
    open_queries = np.arange(len(queries))
    count = min(8, len(points))
    while len(open_queries):
        lower, candidates = tree.query(vectors[open_queries], k=count)
        lower, candidates = lower.reshape(-1, count), candidates.reshape(-1, count)
        found = distance_unchecked(asked[open_queries][:, None], cloud[candidates])
        choice = np.argmin(found, axis=1)
        rows = np.arange(len(open_queries))
        best[open_queries], best_distance[open_queries] = candidates[rows, choice], found[rows, choice]
        if count == len(points):
            break
        open_queries = open_queries[lower[:, -1] < found[rows, choice]]
        count = min(4 * count, len(points))
    return best, best_distance


def _as_rows(features: EllipsoidFeatures) -> tuple[Array, Array, Array, Array]:
    return (
        np.ascontiguousarray(features.minor),
        np.ascontiguousarray(features.major),
        features.condition,
        features.volume,
    )


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _best_matches(minor_t, major_t, condition_t, volume_t, minor_s, major_s, condition_s, volume_s, index, score):  # type: ignore[no-untyped-def]
    """Fill `index` and `score` by trying every pair; nothing of the size n × m is stored."""
    d = minor_t.shape[1]
    for i in range(len(volume_t)):
        best, best_j = -1.0, 0
        for j in range(len(volume_s)):
            low, high = 0.0, 0.0
            for k in range(d):
                low += minor_t[i, k] * minor_s[j, k]
                high += major_t[i, k] * major_s[j, k]
            value = abs(low) + abs(high)
            if value + 2.0 <= best:
                continue
            gap = abs(condition_t[i] - condition_s[j])
            if gap < NEGLIGIBLE:
                value += np.exp(-gap)
            gap = abs(volume_t[i] - volume_s[j])
            if gap < NEGLIGIBLE:
                value += np.exp(-gap)
            if value > best:
                best, best_j = value, j
        index[i], score[i] = best_j, best
