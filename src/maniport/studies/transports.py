"""Optimal transport between Gaussians, by POT, as a further row of the comparison of methods."""

from typing import Any

import numpy as np

from maniport.errors import NotInvertibleError
from maniport.optional import optimal_transport
from maniport.spd.cloud import log_vectors
from maniport.spd.kernels import compose, eigh
from maniport.spd.matrix_functions import apply, congruence, from_vector, roots
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.lengths.field import KAPPA
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array


class GaussianTransport(RigidAdapter):
    """The linear transport between Gaussians with the means and covariances of two clouds of log-vectors.

    The clouds are the images of parallel transport and the student's domain, about the student's mean. There is no
    inverse, and fitted adapters cannot be saved.
    """

    scale, dispersion, recenter = True, "mean", "training"

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        clouds = self._rigid_map().apply(teacher), student
        start, goal = (log_vectors(cloud, self.student_mean_) for cloud in clouds)
        self._solver = optimal_transport().da.LinearTransport().fit(Xs=start, Xt=goal)
        self._found_at_once("closed form")

    def _settle(self) -> None:
        self.released_damping_ = (1.0 - np.sqrt(KAPPA)) * self.student_damping_  # off an eigenvalue of ε

    def _map(self, points: Array) -> tuple[Array, float]:
        moved = self._solver.transform(Xs=log_vectors(self._rigid_map().apply(points), self.student_mean_))
        return congruence(roots(self.student_mean_)[0], apply(from_vector(moved), np.exp)), self.released_damping_

    def _images(self, points: Array) -> Array:
        return released(self._map(points)[0], float(self.student_damping_))

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(f"{type(self).__name__} has no inverse")

    def compiled(self) -> Any:
        """Return `transform`."""
        self._dimension()
        return self.transform


def released(points: Array, epsilon: float) -> Array:
    """Take the damping off: solve z = y (y + ε) / (y + κ ε) for each eigenvalue z of matrices (n, d, d)."""
    if epsilon == 0.0:
        return points
    values, vectors = eigh(points)
    gap = values - epsilon
    root = np.sqrt(gap * gap + 4.0 * KAPPA * epsilon * values)
    low = gap <= 0.0  # where the difference of the two would lose digits
    lengths = np.where(low, 2.0 * KAPPA * epsilon * values / np.where(low, root - gap, 1.0), 0.5 * (gap + root))
    return compose(lengths, vectors)


TRANSPORTS: dict[str, type[DomainAdapter]] = {"gaussian-transport": GaussianTransport}
"""By the names of their rows."""
