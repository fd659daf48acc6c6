"""How far two clouds are apart under a rotation, without saying who matches whom.

Rotations are compared by the mean distance between all pairs, half of the energy distance (18) of `docs/method.md` up
to a constant, with its sampling error. Drawing the clouds anew from themselves tells how far a fit depends on the draw:
the bootstrap (Efron 1979).
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from joblib import Parallel, delayed
from scipy.spatial import cKDTree

from maniport.spd.kernels import mandel_basis
from maniport.spd.matrix_functions import apply, congruence, roots, to_vector
from maniport.spd.mean import means_nearby
from maniport.transfer.cloud_kernels import nearest_distances, sum_distances
from maniport.transfer.rigid_map import recentre
from maniport.validation import Array

Task = TypeVar("Task")
Result = TypeVar("Result")

LARGEST = 1024
"""Ellipsoids of each cloud that are compared at most; an eighth of it beyond d = 3, where there are more directions.
Larger clouds are thinned evenly."""

SEEKERS = 256
"""Ellipsoids of the smaller cloud whose nearest are looked for; none of the others may be left out for that."""


class Gain(NamedTuple):
    """By how much a mean falls from one rotation to another, and its standard error over draws of both clouds."""

    mean: float
    standard_error: float

    @property
    def certainty(self) -> float:
        """The gain in standard errors; zero where nothing changed."""
        return self.mean / self.standard_error if self.standard_error > 0.0 else 0.0


class CloudPair:
    """Two clouds of SPD matrices, (n, d, d) and (m, d, d), about the identity, the teacher dilated; as log-vectors."""

    def __init__(self, teacher: Array, student: Array):
        limit = LARGEST if teacher.shape[-1] <= 3 else LARGEST // 8
        self._whole = [to_vector(apply(cloud, np.log)) for cloud in (teacher, student)]
        self.teacher, self.student = (thinned(vectors, limit) for vectors in self._whole)
        self._known: dict[bytes, tuple[Array, Array]] = {}

    def distances(self, rotation: Array) -> tuple[Array, Array]:
        """Mean distances, shapes (m,) and (n,), from each student's to all turned teachers and from these to all."""
        key = rotation.tobytes()  # some are asked for more than once
        if key not in self._known:
            self._known[key] = self._distances(rotation)
        return self._known[key]

    def _distances(self, rotation: Array) -> tuple[Array, Array]:
        return _mean_distances(self.student, _turning(rotation) @ self.teacher.T)

    def mean_distance(self, rotation: Array) -> float:
        """Mean of all distances |s_i − R t_j| under a rotation of the teacher."""
        return float(self.distances(rotation)[0].mean())

    def energy_distance(self, rotation: Array) -> float:
        """Energy distance of the student's cloud and the turned teacher's about the identity."""
        return max(0.0, 2.0 * self.mean_distance(rotation) - self._within)

    @cached_property
    def _within(self) -> float:
        clouds = self.teacher, self.student
        return float(sum(_mean_distances(cloud, cloud.T)[0].mean() for cloud in clouds))

    def gain(self, start: Array, end: Array) -> Gain:
        """Compare two rotations of the teacher."""
        return self.combination([(1.0, self.distances(start)), (-1.0, self.distances(end))])

    def nearest(self, rotation: Array) -> Array:
        """Distances from some of the smaller cloud's to the nearest of the whole other one, shape (k,)."""
        seeking, others, teacher_seeks = self._seekers
        turning, found = _turning(rotation), np.empty(len(seeking))
        nearest_distances(seeking @ (turning.T if teacher_seeks else turning), others, found)
        return found

    @staticmethod
    def coincidence(before: Array, after: Array) -> Gain:
        """By how much more ellipsoids coincide than before, from `nearest` under two rotations."""
        change = (2.0 * after <= before).astype(float) - (2.0 * before <= after)
        return Gain(float(change.mean()), float(np.linalg.norm(change) / len(change)))

    @cached_property
    def _seekers(self) -> tuple[Array, Array, bool]:
        teacher, student = self._whole
        teacher_seeks = len(teacher) <= len(student)
        seeking, other = (teacher, student) if teacher_seeks else (student, teacher)
        return thinned(seeking, SEEKERS), np.ascontiguousarray(other.T), teacher_seeks

    @staticmethod
    def combination(terms: Sequence[tuple[float, tuple[Array, Array]]]) -> Gain:
        """Mean of a linear combination of distances, and its standard error over draws of both clouds."""
        rows, columns = (np.sum([factor * means[side] for factor, means in terms], axis=0) for side in (0, 1))
        variance = np.var(rows, ddof=1) / len(rows) + np.var(columns, ddof=1) / len(columns)
        return Gain(float(np.mean(rows)), float(np.sqrt(variance)))


def _mean_distances(vectors: Array, others: Array) -> tuple[Array, Array]:
    """Mean distances from each vector (n, k) to the others, (k, m), and from these to all vectors."""
    rows, columns = np.empty(len(vectors)), np.empty(others.shape[1])
    sum_distances(vectors, np.ascontiguousarray(others), rows, columns)
    return rows / len(columns), columns / len(rows)


def thinned(vectors: Array, limit: int) -> Array:
    """Take at most `limit` of many vectors (n, k), one from each of as many equal parts of the cloud."""
    if len(vectors) <= limit:
        return vectors
    order = np.asarray(cKDTree(vectors, leafsize=max(1, len(vectors) // limit)).indices)
    middles = ((np.arange(limit) + 0.5) * (len(vectors) / limit)).astype(int)
    return np.asarray(vectors[order[middles]])


def in_turn(work: Callable[[Task], Result], tasks: Iterable[Task], n_jobs: int | None = None) -> list[Result]:
    """Do one task after the other; through joblib where `n_jobs` is given."""
    if n_jobs is None:
        return [work(task) for task in tasks]
    return list(Parallel(n_jobs=n_jobs)(delayed(work)(task) for task in tasks))


def drawn_again(points: Array, random: np.random.Generator) -> Array:
    """Draw as many of the points with replacement; not the same one every time, which would have no dispersion."""
    while True:
        drawn = np.asarray(points[random.integers(len(points), size=len(points))])
        if np.any(drawn != drawn[0]):
            return drawn


def resampled_means(points: Array, center: Array, randoms: Sequence[np.random.Generator]) -> list[Array]:
    """Fréchet means of clouds drawn from `points` with replacement; `center` is the mean of all."""
    n = len(points)
    # about the identity, where the search for the others starts close to its end
    whitened, back = recentre(points, center), roots(center)[0]
    weights = (np.bincount(random.integers(n, size=n), minlength=n) / n for random in randoms)
    return [congruence(back, one) for one in means_nearby(whitened, weights)]


def _turning(rotation: Array) -> Array:
    """Matrix that turns Mandel vectors as R X Rᵀ turns the matrices."""
    basis = mandel_basis(len(rotation))
    turned = (rotation @ basis @ rotation.T).reshape(len(basis), -1)
    return np.asarray(basis.reshape(len(basis), -1) @ turned.T)
