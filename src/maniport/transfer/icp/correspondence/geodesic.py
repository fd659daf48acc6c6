"""The nearest ellipsoid on the manifold, as in the classical iterative closest point."""

from copy import copy

import numpy as np

from maniport.spd.matrix_functions import congruence
from maniport.spd.neighbors import NeighborIndex
from maniport.transfer.icp.correspondence.contract import Correspondence, Matches, evenly
from maniport.validation import Array


class GeodesicCorrespondence(Correspondence):
    """Every teacher ellipsoid with the student ellipsoid at the smallest affine-invariant distance, found exactly.

    All matches weigh the same. Equal matches lower the cost in every iteration: matching and rotation have one
    objective (Besl and McKay 1992).
    """

    def __init__(self, teacher: Array, student: Array, trim: float = 0.0, exponent: float = 3.0):
        super().__init__(teacher, student, trim, exponent)
        self._seeking = np.arange(len(teacher))
        self._neighbors = NeighborIndex(student)

    def match(self, rotation: Array) -> Matches:
        """Match with the nearest; a larger distance is a worse match."""
        index, distance = self._neighbors.query(congruence(rotation, self.teacher[self._seeking]))
        return Matches.best(self._seeking, index, np.ones(len(index)), distance, self.trim)

    def scouts(self, limit: int) -> "GeodesicCorrespondence":
        """Return the same for fewer teacher ellipsoids, and all of the student's."""
        part = copy(self)
        part._seeking = evenly(len(self.teacher), limit)
        return part
