"""Correspondence of ellipsoids with similar semi-axes, independent of their directions."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from maniport.transfer.icp.correspondence import Correspondence, Matches


@dataclass(frozen=True)
class SpectrumCorrespondence(Correspondence):
    """Match each teacher ellipsoid with the student ellipsoid of the nearest log eigenvalues."""

    def between(self, teacher, student):
        """Match once, since rotations do not change eigenvalues."""
        lengths = [np.log(np.linalg.eigvalsh(cloud)) for cloud in (teacher, student)]
        partners = cKDTree(lengths[1]).query(lengths[0])[1]
        count = len(teacher)
        matches = Matches(np.arange(count), partners, np.full(count, 1.0 / count))
        return lambda rotation: matches
