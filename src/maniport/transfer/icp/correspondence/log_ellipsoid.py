"""The paper's score with shapes compared by ratio."""

import numpy as np

from maniport.transfer.icp.correspondence.ellipsoid import EllipsoidCorrespondence
from maniport.transfer.icp.correspondence.features import EllipsoidFeatures
from maniport.validation import Array


class LogEllipsoidCorrespondence(EllipsoidCorrespondence):
    """As `EllipsoidCorrespondence`, with exp(−|log p − log p'|) + exp(−|log vol − log vol'|) in the score.

    These exponentials are ratios, the smaller condition or volume over the larger one. Elongated ellipsoids, whose
    conditions differ by tens and more, so keep a shape; in the paper's score they all look equally unlike.
    """

    @staticmethod
    def _features(points: Array) -> EllipsoidFeatures:
        shape = EllipsoidFeatures.of(points)
        return EllipsoidFeatures(shape.minor, shape.major, np.log(shape.condition), np.log(shape.volume))
