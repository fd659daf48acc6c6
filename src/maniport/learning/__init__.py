"""Profiles learned from several demonstrations: alignment, Gaussian mixture on the manifold, tracking weights.

The functions take arrays of any SPD matrices.
"""

from maniport.learning.alignment import Alignment, align
from maniport.learning.gmm import ProfileGMM
from maniport.learning.tangent import covariance_tensor, tracking_weights, weights_at

__all__ = ["Alignment", "ProfileGMM", "align", "covariance_tensor", "tracking_weights", "weights_at"]
