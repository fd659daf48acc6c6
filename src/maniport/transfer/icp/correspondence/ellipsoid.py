"""The paper's correspondence: who resembles whom in direction and shape."""

from copy import copy

import numpy as np

from maniport.transfer.icp.correspondence.contract import Correspondence, Indices, Matches, evenly
from maniport.transfer.icp.correspondence.features import EllipsoidFeatures
from maniport.transfer.icp.correspondence.match_tree import MatchTree
from maniport.validation import Array


class EllipsoidCorrespondence(Correspondence):
    """Every teacher ellipsoid with the student ellipsoid of the largest score (Reithmeir et al. 2022, eq. 16).

    The score w = |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|), between 0 and 4, compares the directions
    of the shortest and the longest axis, the condition numbers and the volumes. Matches weigh w^k, k = `exponent`.
    """

    _features = staticmethod(EllipsoidFeatures.of)

    def __init__(self, teacher: Array, student: Array, trim: float = 0.0, exponent: float = 3.0):
        super().__init__(teacher, student, trim, exponent)
        self._seeking, self._asking = np.arange(len(teacher)), self._features(teacher)
        self._tree = MatchTree(self._features(student))

    def match(self, rotation: Array) -> Matches:
        """Match by score; a lower score is a worse match."""
        index, score = self._tree.query(self._asking.turned(rotation))
        best = score.max()
        weight = (score / best) ** self.exponent if best > 0 else np.ones_like(score)
        return Matches.best(self._seeking, index, weight, -score, self.trim)

    def scouts(self, limit: int) -> "EllipsoidCorrespondence":
        """Return the same for fewer teacher ellipsoids, and all of the student's."""
        part = copy(self)
        part._seeking = evenly(len(self.teacher), limit)
        part._asking = self._asking.pick(part._seeking)
        return part


def match(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """For every teacher ellipsoid the student ellipsoid with the largest score.

    The score is |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|), between 0 and 4
    (Reithmeir et al. 2022, eq. 16). Of scores that are equal to 1e-12 the first one wins.

    Returns
    -------
    index : ndarray, shape (n,)
        Into the student's set.
    score : ndarray, shape (n,)
    """
    return MatchTree(student).query(teacher)


def match_numpy(teacher: EllipsoidFeatures, student: EllipsoidFeatures) -> tuple[Indices, Array]:
    """Same as `match` in plain NumPy, with memory of the size n × m."""
    score = np.abs(teacher.minor @ student.minor.T) + np.abs(teacher.major @ student.major.T)
    score += np.exp(-np.abs(teacher.condition[:, None] - student.condition))
    score += np.exp(-np.abs(teacher.volume[:, None] - student.volume))
    index = np.argmax(score, axis=1)
    return index, score[np.arange(len(index)), index]
