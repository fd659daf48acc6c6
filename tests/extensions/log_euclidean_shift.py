"""Transfer method that aligns the log-Euclidean means of both domains."""

from maniport import spd
from maniport.transfer import DomainAdapter


class LogEuclideanShift(DomainAdapter):
    """f(T) = exp(log T + D), where D is the difference of the mean logarithms."""

    def __init__(self, damping=None, base_rotation=None):
        self.damping = damping
        self.base_rotation = base_rotation

    def _fit(self, teacher, student):
        self.shift_ = spd.logm(student).mean(axis=0) - spd.logm(teacher).mean(axis=0)
        self._describe(teacher, student)
        self._set_closed_form("closed form")

    def _map(self, points):
        return spd.expm(spd.logm(points) + self.shift_)

    def _map_back(self, points):
        return spd.expm(spd.logm(points) - self.shift_)
