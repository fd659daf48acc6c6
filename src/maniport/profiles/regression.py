"""The ellipsoid and its covariance that a mixture expects at an input: Gaussian mixture regression on SPD(d)."""

import warnings

import numpy as np
from scipy.special import softmax

from maniport.errors import ConvergenceWarning
from maniport.profiles.mixture import Mixture, log_density
from maniport.profiles.tangent import on_vectors, turns
from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply, bounded, compose, congruence, from_vector, roots, to_vector
from maniport.validation import Array

TOLERANCE, MAX_STEPS = 1e-9, 100
"""Length of the last step of the mean, and how many there may be."""

MAX_ROUNDING = 1e-3
"""Largest last step that is put down to rounding, which grows with the condition number of the ellipsoid."""


def regress(mixture: Mixture, inputs: Array) -> tuple[Array, Array]:
    """Conditional mean (n, d, d) and covariance (n, m, m) of the ellipsoid, given inputs (n, p).

    Jaquier & Calinon, Gaussian Mixture Regression on Symmetric Positive Definite Matrices Manifolds, IROS 2017: the
    covariances of the components are transported to the mean X, where X is the fixed point of
    X ← exp_X(Σ h_k (log_X(M_k) + Σ_yx Σ_xx⁻¹ (x − μ_k))), Σ transported to X. The covariance at X is
    Σ h_k (Σ_yy − Σ_yx Σ_xx⁻¹ Σ_xy + e_k e_kᵀ), e_k what stands in the brackets above, which sums to zero at the fixed
    point. It is in whitened Mandel coordinates at X.

    Since log_X(M_k) is the transport of −log_{M_k}(X), both parts are added at M_k and transported at once.
    """
    p = mixture.inputs.shape[1]
    spread, cross = mixture.covariances[:, :p, :p], mixture.covariances[:, :p, p:]
    slopes = np.linalg.solve(spread, cross)  # Σ_xx⁻¹ Σ_xy, (K, p, m)
    away = inputs - mixture.inputs[:, None]  # (K, n, p)
    shares = softmax(np.log(mixture.weights) + log_density(away, spread), axis=1)  # h, (n, K)
    ahead = np.swapaxes(away @ slopes, 0, 1)  # at M_k, (n, K, m)
    centers = _fixed_points(mixture, shares, from_vector(ahead))
    own = mixture.covariances[:, p:, p:] - np.swapaxes(cross, -1, -2) @ slopes
    rotations = turns(mixture.ellipsoids[None], centers[:, None])
    errors = to_vector(_errors(mixture, centers, from_vector(ahead)))
    basis = on_vectors(rotations)
    within = basis @ own @ np.swapaxes(basis, -1, -2)
    mean = np.einsum("nk,nkm->nm", shares, errors)
    covariance = np.einsum("nk,nkab->nab", shares, within) + np.einsum("nk,nka,nkb->nab", shares, errors, errors)
    covariance -= mean[:, :, None] * mean[:, None, :]
    return centers, 0.5 * (covariance + np.swapaxes(covariance, -1, -2))


def _errors(mixture: Mixture, centers: Array, ahead: Array) -> Array:
    """Whitened tangents e_k at centers (n, d, d), shape (n, K, d, d); `ahead` are the offsets at M_k."""
    root, inverse_root = roots(mixture.ellipsoids)
    values, vectors = whitened_eigh(inverse_root, centers[:, None])
    rotations = roots(centers)[1][:, None] @ root @ compose(np.sqrt(values), vectors)
    return congruence(rotations, ahead - compose(np.log(values), vectors))


def _fixed_points(mixture: Mixture, shares: Array, ahead: Array) -> Array:
    """Conditional means (n, d, d), each started from what its most likely component says."""
    rows, best = np.arange(len(shares)), shares.argmax(axis=1)
    centers = congruence(
        roots(mixture.ellipsoids)[0][best], apply(ahead[rows, best], bounded(np.exp, "the prediction at these inputs"))
    )
    values = eigh(centers)[0]
    rounding = 10 * np.finfo(np.float64).eps * values[:, -1] / values[:, 0]
    tolerances = np.clip(rounding, TOLERANCE, MAX_ROUNDING)
    lengths, last = np.ones(len(shares)), np.full(len(shares), np.inf)
    moving = rows
    for _ in range(MAX_STEPS):
        steps = np.einsum("nk,nkij->nij", shares[moving], _errors(mixture, centers[moving], ahead[moving]))
        norms = np.linalg.norm(steps, axis=(-2, -1))
        lengths[moving] = np.where(norms > last[moving], 0.5 * lengths[moving], lengths[moving])  # it overshoots
        last[moving] = norms
        steps *= lengths[moving][:, None, None]
        centers[moving] = congruence(roots(centers[moving])[0], apply(steps, np.exp))
        moving = moving[norms > tolerances[moving]]
        if not len(moving):
            return centers
    warnings.warn(
        f"the conditional mean of {len(moving)} of {len(shares)} inputs stopped after {MAX_STEPS} steps, "
        f"the last of length up to {last[moving].max():.3g}; wanted {TOLERANCE:g}",
        ConvergenceWarning,
        stacklevel=4,
    )
    return centers


def posterior_covariance(covariance: Array, demonstrations: int) -> Array:
    """Predictive covariance (n, m, m), given the maximum-likelihood one of k demonstrations.

    The points of one demonstration are no independent observations: a person who holds the elbow high at one time holds
    it high at the next. At any time there are as many observations as demonstrations, k, for the m (m + 1) / 2 entries
    of a covariance, and with k ≤ m the maximum-likelihood estimate has directions that are certain by accident.

    Posterior mean under an inverse-Wishart prior that says "alike in all directions" with the weight of m
    demonstrations, plus the uncertainty of the mean (Gelman et al., Bayesian Data Analysis, 3rd ed., § 3.6):
    (1 + 1/k) (k S + m τ I) / (k + m), S = k / (k − 1) C the unbiased covariance and τ = tr(S) / m. It approaches C as
    k grows. The prior is isotropic in whitened coordinates, hence unchanged by a congruence of the data.
    """
    k, m = demonstrations, covariance.shape[-1]
    unbiased = k / (k - 1) * covariance
    variance = np.trace(unbiased, axis1=-2, axis2=-1)[:, None, None] / m
    return np.asarray((1 + 1 / k) * (k * unbiased + m * variance * np.eye(m)) / (k + m))
