"""Rotation and dispersion between clouds without pairs: those of the least energy distance.

With log-vectors x of the student's ellipsoids and y of the teacher's, each about the mean of its cloud, the energy
distance of `maniport.transfer.identifiability`,

    D(R, s) = 2 E|x − s R·y| − E|x − x'| − s E|y − y'|    eq. 18,

is zero only where both clouds have the same distribution. It needs no matches, which are accidents of sampling between
separate samples of two arms. It is minimized by BFGS with its exact derivatives from many starts; of equally good
minima, as symmetric clouds have them, the one nearest to the first start is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from maniport.spd.kernels import congruence
from maniport.spd.matrix_functions import apply, from_vector, to_vector
from maniport.transfer.identifiability import subsample
from maniport.transfer.rotation_group import (
    orthonormal,
    random_rotation,
    rotation_angle,
    rotation_from_vector,
    rotation_planes,
)
from maniport.util.jit import kernel
from maniport.util.validation import Array

LARGEST = 1000  # ellipsoids of each cloud in the descent, a quarter for d > 3; a sixth of these ranks the starts

REFINED = 5  # starts that are followed, and the given ones

EQUAL_SHARE = (
    0.1  # of the gain over the first start: mirror images of a minimum differ by less, by sampling
)

STEPS = 40  # of BFGS from each start


@dataclass(frozen=True)
class EnergyMinimum:
    """A rotation (d, d), the factor of the teacher's dispersion, and the energy distance."""

    rotation: Array
    ratio: float
    distance: float


class EnergyDistance:
    """Energy distance between two clouds about the identity, (n, d, d) and (m, d, d), by rotation and dispersion."""

    def __init__(self, teacher: Array, student: Array, limit: int = LARGEST):
        teacher_vectors = subsample(to_vector(apply(teacher, np.log)), limit)
        student_vectors = subsample(to_vector(apply(student, np.log)), limit)
        self._teacher = from_vector(teacher_vectors)
        self._student = np.ascontiguousarray(student_vectors, np.float32)
        self._within_teacher = _mean_distance_within(teacher_vectors)
        self._within_student = _mean_distance_within(student_vectors)
        self._planes = np.array(rotation_planes(teacher.shape[-1]))

    def value(self, rotation: Array, ratio: float) -> float:
        """D(R, s)."""
        return self.derivatives(rotation, ratio)[0]

    def derivatives(self, rotation: Array, ratio: float) -> tuple[float, Array, float]:
        """D, its gradient (m,) for R ← exp(Σ δ_a Ω_a) R at δ = 0, and its derivative by s."""
        turned = congruence(rotation, self._teacher)
        vectors = to_vector(turned)
        columns = np.ascontiguousarray(ratio * vectors.T, np.float32)
        pulls = np.zeros(columns.shape, np.float32)
        count = len(self._student) * len(vectors)
        between = _add_distances(self._student, columns, pulls) / count

        # Σ_i (x_i − s R·y_j) / |…| as matrices U_j: dD/dδ_a = −2 s Σ_j tr(U_j (Ω_a Y_j − Y_j Ω_a)) / (n m)
        units = from_vector(pulls.T.astype(np.float64))
        commutator = (turned @ units - units @ turned).sum(axis=0)
        rows = self._planes[:, 0]
        cols = self._planes[:, 1]
        gradient = -2.0 * ratio * (commutator[cols, rows] - commutator[rows, cols]) / count
        slope = -2.0 * float(np.sum(vectors * pulls.T)) / count - self._within_teacher

        distance = 2.0 * between - self._within_student - ratio * self._within_teacher
        return distance, gradient, slope

    def descend(self, rotation: Array, ratio: float = 1.0) -> EnergyMinimum:
        """Minimize from a start."""
        size = len(self._planes)

        def objective(parameters: Array) -> tuple[float, Array]:
            step = rotation_from_vector(parameters[:-1])
            factor = ratio * float(np.exp(parameters[-1]))
            value, gradient, slope = self.derivatives(step @ rotation, factor)
            by_vector = _differential(parameters[:-1]).T @ gradient
            return value, np.append(by_vector, factor * slope)

        result = minimize(
            objective,
            np.zeros(size + 1),
            jac=True,
            method="BFGS",
            options={"maxiter": STEPS, "gtol": 1e-4},
        )
        end = orthonormal(rotation_from_vector(result.x[:-1]) @ rotation)
        factor = ratio * float(np.exp(result.x[-1]))
        return EnergyMinimum(end, factor, float(result.fun))


def least_energy(teacher: Array, student: Array, starts: Sequence[Array]) -> EnergyMinimum:
    """Minimize the energy distance of two clouds about the identity from `starts`, and from a grid of rotations."""
    first = starts[0]
    if len(first) <= 3:
        limit = LARGEST
    else:
        limit = LARGEST // 4
    coarse = EnergyDistance(teacher, student, limit // 6)
    candidates = [*starts, *_grid(first)]
    ranks = np.argsort([coarse.value(rotation, 1.0) for rotation in candidates], kind="stable")

    fine = EnergyDistance(teacher, student, limit)
    followed = [*starts]
    for place in ranks[:REFINED]:
        if place >= len(starts):
            followed.append(candidates[place])
    minima = [fine.descend(rotation) for rotation in followed]
    least = min(minimum.distance for minimum in minima)
    tolerance = EQUAL_SHARE * max(fine.value(first, 1.0) - least, 0.0)
    equal = [minimum for minimum in minima if minimum.distance <= least + tolerance]
    return min(equal, key=lambda minimum: rotation_angle(first, minimum.rotation))


def _grid(first: Array) -> list[Array]:
    """Rotations spread over SO(d): for d = 3 the cube's, at most 63° apart, from two orientations."""
    d = len(first)
    random = np.random.default_rng(0)
    if d != 3:
        return [random_rotation(d, random) for _ in range(24)]
    cube = Rotation.create_group("O").as_matrix()
    other = random_rotation(3, random)
    return [*(cube @ first), *(cube @ other)]


def _differential(vector: Array) -> Array:
    """Matrix (m, m) from changes of a rotation vector to rotations on the left, Σ_k ad^k / (k + 1)!."""
    planes = rotation_planes(round((1.0 + np.sqrt(1.0 + 8.0 * len(vector))) / 2.0))
    d = max(max(plane) for plane in planes) + 1
    basis = np.zeros((len(planes), d, d))
    for place, (row, column) in enumerate(planes):
        basis[place, row, column] = 1.0
        basis[place, column, row] = -1.0
    skew = np.tensordot(vector, basis, 1)

    term = basis
    total = basis.copy()
    for order in range(2, 20):
        term = (skew @ term - term @ skew) / order
        total += term
    rows = [row for row, _ in planes]
    columns = [column for _, column in planes]
    return np.asarray(total[:, rows, columns].T)


def _mean_distance_within(vectors: Array) -> float:
    """Mean distance between different vectors (n, k)."""
    single = np.ascontiguousarray(vectors, np.float32)
    pulls = np.zeros(single.T.shape, np.float32)
    total = float(_add_distances(single, np.ascontiguousarray(single.T), pulls))
    return total / (len(vectors) * (len(vectors) - 1))


@kernel(fastmath=True)
def _add_distances(
    vectors: NDArray[np.float32], others: NDArray[np.float32], pulls: NDArray[np.float32]
) -> float:
    """Return Σ |v_i − w_j|, and add Σ_i (v_i − w_j) / |v_i − w_j| to `pulls`; (n, k), (k, m), (k, m)."""
    size = len(others)
    squares = np.empty(others.shape[1], np.float32)
    total = 0.0
    for i in range(len(vectors)):
        squares[:] = np.float32(1e-20)
        for k in range(size):
            for j in range(len(squares)):
                squares[j] += (vectors[i, k] - others[k, j]) ** 2
        row = np.float32(0.0)
        for j in range(len(squares)):
            distance = np.sqrt(squares[j])
            row += distance
            squares[j] = np.float32(1.0) / distance
        total += float(row)
        for k in range(size):
            for j in range(len(squares)):
                pulls[k, j] += (vectors[i, k] - others[k, j]) * squares[j]
    return total
