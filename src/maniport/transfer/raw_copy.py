"""Doing nothing: what every other method has to beat."""

import numpy as np

from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.validation import Array


class RawCopy(DomainAdapter):
    """Do nothing: the student shall make the teacher's ellipsoids, S = R_b T R_bᵀ.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`. Damping is only exchanged for the student's, which `transform` takes off again.

    See Also
    --------
    Recentring, ParallelTransport
    """

    def _fit(self, teacher: Array, student: Array) -> None:
        self._describe(teacher, student)
        self.released_damping_ = RELEASED * self.student_damping_
        self._found_at_once("nothing to fit")

    def _map(self, points: Array) -> tuple[Array, float]:
        return self._exchanged(points, 1.0), self.released_damping_

    def _map_back(self, points: Array) -> Array:
        return self._exchanged(points, -1.0)

    def _exchanged(self, points: Array, sign: float) -> Array:
        """Exchange the teacher's damping for the student's, or back."""
        return points + sign * (self.student_damping_ - self.teacher_damping_) * np.eye(points.shape[-1])
