"""Profiles learned from several demonstrations: alignment, Gaussian mixture on the manifold, tracking weights.

The functions take arrays of any SPD matrices.
"""

from maniport.learning.alignment import Alignment, align
from maniport.learning.gmm import ProfileGMM
from maniport.learning.mixture import tracking_weights

__all__ = ["Alignment", "ProfileGMM", "align", "tracking_weights"]
