"""What methods share that move clouds of log-vectors: parallel transport, then a field about the student's mean."""

from abc import abstractmethod
from typing import Any

import numpy as np

from maniport.errors import NotInvertibleError
from maniport.spd.cloud import log_vectors
from maniport.spd.matrix_functions import apply, congruence, from_vector, roots
from maniport.transfer.lengths.field import KAPPA
from maniport.transfer.release import released
from maniport.transfer.rigid_adapter import RigidAdapter
from maniport.validation import Array


class LogVectorAdapter(RigidAdapter):
    """Base of adapters that move the images of parallel transport once more, as log-vectors about the student's mean.

    A method supplies `_fit_field` and `_moved`. Results are SPD wherever the vectors go; there is no inverse.
    """

    scale, dispersion, recenter = True, "mean", "training"

    @abstractmethod
    def _fit_field(self, start: Array, goal: Array) -> None:
        """Learn the field from the teacher's log-vectors (n, k) and the student's (m, k), and tell how the fit went."""

    @abstractmethod
    def _moved(self, vectors: Array) -> Array:
        """Move log-vectors (n, k) of parallel transport's images."""

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        clouds = self._rigid_map().apply(teacher), student
        self._fit_field(*(log_vectors(cloud, self.student_mean_) for cloud in clouds))

    def _settle(self) -> None:
        self.released_damping_ = (1.0 - np.sqrt(KAPPA)) * self.student_damping_  # off an eigenvalue of ε

    def _map(self, points: Array) -> tuple[Array, float]:
        moved = self._moved(log_vectors(self._rigid_map().apply(points), self.student_mean_))
        return congruence(roots(self.student_mean_)[0], apply(from_vector(moved), np.exp)), self.released_damping_

    def _images(self, points: Array) -> Array:
        return released(self._map(points)[0], float(self.student_damping_))

    def _map_back(self, points: Array) -> Array:
        raise NotInvertibleError(
            f"{type(self).__name__} may fold space and has no inverse; fit one with teacher and student exchanged"
        )

    def compiled(self) -> Any:
        """Return `transform`: a field has too many centres for a compiled map of its own."""
        self._dimension()
        return self.transform
