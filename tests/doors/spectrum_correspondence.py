"""A correspondence of one's own: who has axes of the same lengths, whatever their directions."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from maniport.transfer.icp.correspondence import Correspondence, Matches


@dataclass(frozen=True)
class SpectrumCorrespondence(Correspondence):
    """Every teacher ellipsoid with the student ellipsoid whose eigenvalues are nearest, by ratio."""

    def between(self, teacher, student):
        """Match once: no rotation changes eigenvalues."""
        lengths = [np.log(np.linalg.eigvalsh(cloud)) for cloud in (teacher, student)]
        partners = cKDTree(lengths[1]).query(lengths[0])[1]
        count = len(teacher)
        matches = Matches(np.arange(count), partners, np.full(count, 1.0 / count))
        return lambda rotation: matches
