"""Parallel transport without what it tells of the clouds: the same map in a small part of the time."""

import maniport as mp


class Transport(mp.ParallelTransport):
    """Finds the same rotation and says nothing of it."""

    def _fit_rotation(self, teacher, student):
        self._set_closed_form("closed form")
