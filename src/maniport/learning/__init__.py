"""Several demonstrations become one profile: aligned in time, averaged on the manifold, with how much they agree.

`align` brings demonstrations of unequal pace to common times; `ProfileGMM` learns the ellipsoid at every time or
position and its covariance; `tracking_weights` turns that covariance into what a tracking task needs: follow closely
where the demonstrations agree, loosely where not. Arrays only, of any SPD data.
"""

from maniport.learning.alignment import Alignment, align
from maniport.learning.gmm import ProfileGMM
from maniport.learning.tangent import covariance_tensor, tracking_weights, weights_at

__all__ = ["Alignment", "ProfileGMM", "align", "covariance_tensor", "tracking_weights", "weights_at"]
