"""Doing nothing: what every other method has to beat."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.kernels import congruence
from maniport.spd.mean import dispersion, mean
from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.validation import Array, as_rotation


class RawCopy(DomainAdapter):
    """Do nothing: the student shall make the teacher's ellipsoids, S = R_b T R_bᵀ.

    Parameters
    ----------
    damping, floor, mounting
        As in `ParallelTransport`. Damping is only exchanged for the student's, which `transform` takes off again.
    """

    def __init__(self, damping: float | None = None, floor: float | None = None, mounting: ArrayLike | None = None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit(self, teacher: Array, student: Array) -> None:
        d = teacher.shape[-1]
        self.rotation_ = np.eye(d) if self.mounting is None else as_rotation(self.mounting, "mounting", d)
        self.teacher_mean_, self.student_mean_ = mean(teacher), mean(student)
        self.teacher_dispersion_ = dispersion(teacher, self.teacher_mean_)
        self.student_dispersion_ = dispersion(student, self.student_mean_)
        self.dispersion_ratio_, self.released_damping_ = 1.0, RELEASED * self.student_damping_
        self._found_at_once("nothing to fit")

    def _map(self, points: Array) -> tuple[Array, float]:
        exchange = self.student_damping_ - self.teacher_damping_
        return congruence(self.rotation_, points) + exchange * np.eye(points.shape[-1]), self.released_damping_

    def _map_back(self, points: Array) -> Array:
        exchange = self.teacher_damping_ - self.student_damping_
        return congruence(self.rotation_.T, points) + exchange * np.eye(points.shape[-1])
