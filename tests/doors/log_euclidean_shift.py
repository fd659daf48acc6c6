"""A method of transfer of one's own: the means of the logarithms are made to agree."""

import numpy as np

from maniport import spd
from maniport.transfer import DomainAdapter


class LogEuclideanShift(DomainAdapter):
    """f(T) = exp(log T + D), with D the difference of the two domains' mean logarithms."""

    def __init__(self, damping=None, floor=None, mounting=None):
        self.damping = damping
        self.floor = floor
        self.mounting = mounting

    def _fit(self, teacher, student):
        self.shift_ = spd.logm(student).mean(axis=0) - spd.logm(teacher).mean(axis=0)
        self.teacher_mean_, self.student_mean_ = spd.mean(teacher), spd.mean(student)
        self.teacher_dispersion_, self.student_dispersion_ = spd.dispersion(teacher), spd.dispersion(student)
        self.rotation_, self.dispersion_ratio_ = np.eye(len(self.shift_)), 1.0
        self.released_damping_ = 0.0  # images keep the damping
        self._found_at_once("closed form")

    def _map(self, points):
        return spd.expm(spd.logm(points) + self.shift_), self.released_damping_

    def _map_back(self, points):
        return spd.expm(spd.logm(points) - self.shift_)
