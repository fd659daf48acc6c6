"""Gaussian mixtures on time × SPD(d): EM iteration, regression, and weights from the covariance.

The whitened Mandel coordinates of X at P are vec(log(P^-½ X P^-½)), a vector of m = d (d + 1) / 2 whose length is the
affine-invariant distance. Parallel transport from P₁ to P₂ along their geodesic, E L Eᵀ with E = (P₂ P₁⁻¹)^½, becomes a
rotation of them: V → Q V Qᵀ with Q = P₂^-½ E P₁^½ = P₂^-½ P₁^½ (P₁^-½ P₂ P₁^-½)^½, which is orthogonal.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp, softmax

from maniport.errors import ConvergenceWarning, InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import compose, congruence, roots
from maniport.spd.matrix_functions import apply, bounded, from_vector, mandel_basis, to_vector
from maniport.spd.mean import mean
from maniport.util.validation import SPD_TOLERANCE, Array, as_finite, as_number, require_shape

MIN_WEIGHT = 1e-8  # A component that explains fewer points is dropped


@dataclass(frozen=True)
class Mixture:
    """K Gaussians on time × SPD(d)."""

    weights: Array  # (K,)
    times: Array  # means, (K,)
    ellipsoids: Array  # Fréchet means, (K, d, d)
    covariances: (
        Array  # of [t − mean; whitened Mandel coordinates at the Fréchet mean], (K, 1 + m, 1 + m)
    )


def _log_density(deviations: Array, covariances: Array) -> Array:
    """Return the log-density (n, K) of centered Gaussians (K, s, s) at deviations (K, n, s)."""
    factors = np.linalg.cholesky(covariances)
    whitened = np.linalg.solve(factors, np.swapaxes(deviations, -1, -2))
    log_root = np.sum(np.log(np.diagonal(factors, axis1=-2, axis2=-1)), axis=-1)
    constant = log_root + 0.5 * deviations.shape[-1] * np.log(2 * np.pi)
    return np.asarray((-0.5 * np.sum(whitened**2, axis=-2) - constant[:, None]).T)


def _deviations(times: Array, points: Array, centers: tuple[Array, Array]) -> Array:
    """Return deviations (K, n, 1 + m) of times and points (n, d, d) from mean times (K,) and ellipsoids (K, d, d)."""
    mean_times, ellipsoids = centers
    values, vectors = whitened_eigh(roots(ellipsoids)[1][:, None], points[None])
    away = times - mean_times[:, None]
    logarithms = to_vector(compose(np.log(values), vectors))
    return np.concatenate([away[..., None], logarithms], axis=-1)


def log_likelihood(mixture: Mixture, times: Array, points: Array) -> float:
    """Return the mean log-density of times (n,) and points (n, d, d)."""
    deviations = _deviations(times, points, (mixture.times, mixture.ellipsoids))
    joint = np.log(mixture.weights) + _log_density(deviations, mixture.covariances)
    return float(logsumexp(joint, axis=1).mean())


def expectation_maximization(
    times: Array, points: Array, shares: Array, ridge: Array, tol: float, max_iter: int
) -> tuple[Mixture, list[float], bool]:
    """Fit a mixture by EM from shares (n, K); return the most likely, the log-likelihoods, and whether it converged."""
    history = list[float]()
    best = None
    converged = False
    while len(history) < max_iter and not converged:
        shares = shares[:, shares.sum(axis=0) > MIN_WEIGHT]
        counts = shares.sum(axis=0)
        own = (shares / counts).T  # (K, n)
        centers = np.stack([mean(points, weights) for weights in own])
        deviations = _deviations(times, points, (own @ times, centers))
        covariances = np.swapaxes(deviations * own[..., None], -1, -2) @ deviations
        covariances = 0.5 * (covariances + np.swapaxes(covariances, -1, -2)) + np.diag(ridge)
        mixture = Mixture(counts / counts.sum(), own @ times, centers, covariances)
        joint = np.log(mixture.weights) + _log_density(deviations, covariances)
        likelihood = logsumexp(joint, axis=1, keepdims=True)
        shares = np.exp(joint - likelihood)
        history.append(float(likelihood.mean()))
        if best is None or history[-1] == max(history):
            best = mixture
        converged = len(history) > 1 and history[-1] - history[-2] <= tol
    assert best is not None
    return best, history, converged


def regressed(mixture: Mixture, times: Array) -> tuple[Array, Array]:
    """Return the conditional mean (n, d, d) and covariance (n, m, m) of the ellipsoid at times (n,)."""
    spread = mixture.covariances[:, :1, :1]
    cross = mixture.covariances[:, :1, 1:]
    slopes = cross / spread  # (K, 1, m)
    away = (times - mixture.times[:, None])[..., None]  # (K, n, 1)
    shares = softmax(np.log(mixture.weights) + _log_density(away, spread), axis=1)  # (n, K)
    ahead = from_vector(
        np.swapaxes(away @ slopes, 0, 1)
    )  # at the means of the components, (n, K, d, d)
    centers = _conditional_means(mixture, shares, ahead)
    errors, rotations = _transported(mixture, centers, ahead)
    vectors = to_vector(errors)
    mean_error = to_vector(np.einsum("nk,nkij->nij", shares, errors))
    images = congruence(rotations[..., None, :, :], mandel_basis(centers.shape[-1]))
    basis = np.swapaxes(to_vector(images), -1, -2)  # of V → Q V Qᵀ on Mandel vectors
    within = (
        basis
        @ (mixture.covariances[:, 1:, 1:] - np.swapaxes(cross, -1, -2) @ slopes)
        @ np.swapaxes(basis, -1, -2)
    )
    covariance = np.einsum("nk,nkab->nab", shares, within) + np.einsum(
        "nk,nka,nkb->nab", shares, vectors, vectors
    )
    covariance -= mean_error[:, :, None] * mean_error[:, None, :]
    return centers, 0.5 * (covariance + np.swapaxes(covariance, -1, -2))


def _transported(mixture: Mixture, centers: Array, ahead: Array) -> tuple[Array, Array]:
    """Return whitened tangents at centers to the predictions of all components, and the rotations of the transport."""
    root, inverse_root = roots(mixture.ellipsoids)
    values, vectors = whitened_eigh(inverse_root, centers[:, None])
    rotations = roots(centers)[1][:, None] @ root @ compose(np.sqrt(values), vectors)
    return congruence(rotations, ahead - compose(np.log(values), vectors)), rotations


def _conditional_means(
    mixture: Mixture, shares: Array, ahead: Array, max_steps: int = 100
) -> Array:
    """Return conditional means (n, d, d) by fixed-point steps from the prediction of the most likely component."""
    rows = np.arange(len(shares))
    best = shares.argmax(axis=1)
    starts = apply(ahead[rows, best], bounded(np.exp, "the prediction at these times"))
    centers = congruence(roots(mixture.ellipsoids)[0][best], starts)
    tolerance = np.clip(10 * np.finfo(np.float64).eps * np.linalg.cond(centers), 1e-9, 1e-3)
    lengths = np.ones(len(shares))
    last = np.full(len(shares), np.inf)
    for _ in range(max_steps):
        steps = np.einsum("nk,nkij->nij", shares, _transported(mixture, centers, ahead)[0])
        norms = np.linalg.norm(steps, axis=(-2, -1))
        overshoots = norms > np.maximum(last, tolerance)
        lengths = np.where(overshoots, 0.5 * lengths, lengths)
        last = norms
        centers = congruence(roots(centers)[0], apply(lengths[:, None, None] * steps, np.exp))
        if np.all(norms <= tolerance):
            return centers
    warnings.warn(
        f"the conditional mean at {np.sum(norms > tolerance)} of {len(shares)} times stopped after {max_steps} "
        f"steps, the last of length up to {norms.max():.3g}",
        ConvergenceWarning,
        stacklevel=4,
    )
    return centers


def tracking_weights(covariance: ArrayLike, damping: float = 0.1) -> Array:
    """Return the weights of a tracking task: large where demonstrations agree.

    Parameters
    ----------
    covariance : array_like, shape (n, m, m)
        Of a profile, in whitened Mandel coordinates at its ellipsoids; see `ProfileGMM.predict`.
    damping : float
        ρ ≥ 0: the weights are (C + ρ c I)⁻¹, c the mean variance over all times and directions. A direction has at most
        1 + 1 / ρ times the weight of one of mean variance.

    Returns
    -------
    ndarray, shape (n, m, m)
        W, dimensionless, for the cost eᵀ W e of the error e = vec(log(M^-½ M_target M^-½)); its mean weight, tr(W) / m
        averaged over the n times, is one.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a covariance is not positive-semidefinite, all are zero, or one is singular without damping.
    """
    array = as_finite(covariance, "covariance")
    rho = as_number(damping, "damping", minimum=0.0)
    size = 0
    if array.ndim:
        size = array.shape[-1]
    require_shape(array, "covariance", ("n", size, "m"))
    values, vectors = np.linalg.eigh(0.5 * (array + np.swapaxes(array, -1, -2)))
    scale = max(float(np.abs(values).max()), np.finfo(np.float64).tiny)  # weights have no unit
    if values.min() < -1e-10 * scale:
        raise NotSPDError(f"covariance must have no negative eigenvalue; found {values.min():.3g}")
    variance = float(values.mean()) / scale
    values = np.maximum(values / scale, 0.0) + rho * variance
    if np.any(values <= SPD_TOLERANCE * variance):
        raise InvalidInputError(
            "covariance is zero, or singular at some time; use a damping above 0"
        )
    weights = compose(1.0 / values, vectors) / np.mean(1.0 / values)
    return np.asarray(0.5 * (weights + np.swapaxes(weights, -1, -2)))
