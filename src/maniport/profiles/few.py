"""What a covariance is worth that was learned from a handful of demonstrations.

The points of one demonstration are no independent observations: a person who holds the elbow high at one time holds it
high at the next. At any time there are as many observations as demonstrations, k, for the m (m + 1) / 2 entries of a
covariance, and with k ≤ m the maximum-likelihood estimate has directions that are certain by accident.
"""

import numpy as np

from maniport.validation import Array


def posterior_covariance(covariance: Array, demonstrations: int) -> Array:
    """Predictive covariance (n, m, m), given the maximum-likelihood one of k demonstrations.

    Posterior mean under an inverse-Wishart prior that says "alike in all directions" with the weight of m
    demonstrations, plus the uncertainty of the mean (Gelman et al., Bayesian Data Analysis, 3rd ed., § 3.6):
    (1 + 1/k) (k S + m τ I) / (k + m), S = k / (k − 1) C the unbiased covariance and τ = tr(S) / m. It approaches C as
    k grows. The prior is isotropic in whitened coordinates, hence unchanged by a congruence of the data.
    """
    k, m = demonstrations, covariance.shape[-1]
    unbiased = k / (k - 1) * covariance
    variance = np.trace(unbiased, axis1=-2, axis2=-1)[:, None, None] / m
    return np.asarray((1 + 1 / k) * (k * unbiased + m * variance * np.eye(m)) / (k + m))
