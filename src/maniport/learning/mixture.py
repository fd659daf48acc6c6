"""Gaussian mixtures on R^p × SPD(d): tangent spaces, input checks, EM iteration, regression.

The whitened Mandel coordinates of X at P are vec(log(P^-½ X P^-½)), a vector of m = d (d + 1) / 2 whose length is the
affine-invariant distance. Parallel transport from P₁ to P₂ along their geodesic, E L Eᵀ with E = (P₂ P₁⁻¹)^½, becomes a
rotation of them: V → Q V Qᵀ with Q = P₂^-½ E P₁^½ = P₂^-½ P₁^½ (P₁^-½ P₂ P₁^-½)^½, which is orthogonal.
"""

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.cluster.vq import ClusterError, kmeans2
from scipy.special import logsumexp, softmax

from maniport.errors import ConvergenceWarning, InvalidInputError
from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import compose, congruence, eigh, roots
from maniport.spd.matrix_functions import apply, bounded, from_vector, mandel_basis, to_vector
from maniport.spd.mean import mean
from maniport.util.validation import Array, as_count, as_finite, require_shape

MIN_WEIGHT = 1e-8  # A component that explains fewer points keeps its mean and covariance


def coordinates(centers: Array, points: Array) -> Array:
    """Return whitened Mandel coordinates (..., m) of points at centers, shapes (..., d, d) that broadcast."""
    values, vectors = whitened_eigh(roots(centers)[1], points)
    return to_vector(compose(np.log(values), vectors))


def turns(starts: Array, ends: Array) -> Array:
    """Return the rotations Q (..., d, d) of parallel transport in whitened coordinates."""
    root, inverse_root = roots(starts)
    values, vectors = whitened_eigh(inverse_root, ends)
    return np.asarray(roots(ends)[1] @ root @ compose(np.sqrt(values), vectors))


def on_vectors(rotations: Array) -> Array:
    """Return the orthogonal matrices (..., m, m) of V → Q V Qᵀ on Mandel vectors; Q has shape (..., d, d)."""
    images = congruence(rotations[..., None, :, :], mandel_basis(rotations.shape[-1]))
    return np.swapaxes(to_vector(images), -1, -2)


def as_inputs(value: ArrayLike, count: int | None, columns: int | None = None) -> Array:
    """Convert to inputs, shape (n, p)."""
    array = as_finite(value, "inputs")
    if array.ndim not in (1, 2) or not array.size:
        raise InvalidInputError(f"inputs must have shape (n,) or (n, p), n and p at least 1; found {array.shape}")
    array = array[:, None] if array.ndim == 1 else array
    if count is not None and len(array) != count:
        raise InvalidInputError(f"inputs and ellipsoids must be equally many; found {len(array)} and {count}")
    if columns is not None and array.shape[1] != columns:
        raise InvalidInputError(f"inputs must have {columns} columns, as in fit; found {array.shape[1]}")
    if columns is None and np.all(array == array[0]):
        raise InvalidInputError(f"inputs must not all be equal; found {array[0].tolist()} {len(array)} times")
    return array


def count_demonstrations(groups: ArrayLike | None, points: int) -> int | None:
    """Return the number of different labels; None without labels."""
    if groups is None:
        return None
    labels = np.asarray(groups)
    require_shape(labels, "groups", (points,), ", a label for each point")
    try:
        count = len(np.unique(labels))
    except TypeError as error:
        raise InvalidInputError(f"groups must be labels of one kind, such as whole numbers: {error}") from None
    if count < 2:
        raise InvalidInputError(f"groups must hold at least 2 different labels; found {count}")
    return count


def points_each(d: int, inputs: int = 1) -> int:
    """Return the least number of ellipsoids d × d for a component."""
    return inputs + d * (d + 1) // 2 + 1


def component_counts(count: Any, most: Any, x: Array, points: Array) -> list[int]:
    """Return the numbers of components to try: `count`, or 1, 2, 4, … up to `most` that the points allow."""
    d, p = points.shape[-1], x.shape[1]
    least = points_each(d, p)
    most, allowed = as_count(most, "max_components"), len(x) // least
    counts = [2**i for i in range(64) if 2**i <= min(most, max(allowed, 1))]
    if count is not None:
        counts = [as_count(count, "n_components")]
    if counts[-1] > allowed:
        raise InvalidInputError(
            f"{counts[-1]} components need {counts[-1] * least} ellipsoids, {least} each for {p} inputs and {d}×{d} "
            f"matrices, found {len(x)}"
        )
    return counts


@dataclass(frozen=True)
class Mixture:
    """K Gaussians on R^p × SPD(d)."""

    weights: Array  # (K,)
    inputs: Array  # means of the inputs, (K, p)
    ellipsoids: Array  # Fréchet means, (K, d, d)
    covariances: Array  # of [x − mean; whitened Mandel coordinates at the Fréchet mean], (K, p + m, p + m)

    def deviations(self, inputs: Array, points: Array) -> Array:
        """Return tangent vectors (K, n, p + m) of inputs (n, p) and points (n, d, d) at each component."""
        return np.concatenate(
            [inputs - self.inputs[:, None], coordinates(self.ellipsoids[:, None], points[None])], axis=-1
        )

    def log_joint(self, deviations: Array) -> Array:
        """Return logarithms of weight times density, shape (n, K), in the tangent space of each component."""
        return np.log(self.weights) + log_density(deviations, self.covariances)

    def bic(self, log_likelihood: float, n: int) -> float:
        """Return the Bayesian information criterion of n points."""
        count, s = self.covariances.shape[:2]
        free = count - 1 + count * s + count * s * (s + 1) // 2
        return float(-2.0 * log_likelihood + free * np.log(n))


def log_density(deviations: Array, covariances: Array) -> Array:
    """Return the log-density (n, K) of centered Gaussians (K, s, s) at deviations (K, n, s)."""
    factors = np.linalg.cholesky(covariances)
    whitened = np.linalg.solve(factors, np.swapaxes(deviations, -1, -2))
    log_root = np.sum(np.log(np.diagonal(factors, axis1=-2, axis2=-1)), axis=-1)
    s = deviations.shape[-1]
    return np.asarray((-0.5 * np.sum(whitened**2, axis=-2) - (log_root + 0.5 * s * np.log(2 * np.pi))[:, None]).T)


@dataclass(frozen=True)
class Fit:
    """Result of EM: the best mixture, its mean log-likelihood, and the log-likelihood after each step."""

    mixture: Mixture
    log_likelihood: float
    history: Array
    converged: bool


def expectation_maximization(
    inputs: Array, points: Array, shares: Array, regularization: float, tol: float, max_iter: int
) -> Fit:
    """Fit a mixture by EM from initial shares (n, K)."""
    d, p = points.shape[-1], inputs.shape[1]
    ridge = regularization * np.r_[np.full(p, np.var(inputs, axis=0).mean()), np.ones(d * (d + 1) // 2)]
    mixture: Mixture | None = None
    best: tuple[Mixture, float] | None = None
    history: list[float] = []
    converged = False
    while len(history) < max_iter and not converged:
        counts = shares.sum(axis=0)
        total, few = np.maximum(counts, MIN_WEIGHT), counts < MIN_WEIGHT
        means = (shares.T @ inputs) / total[:, None]
        ellipsoids = np.empty((len(counts), *points.shape[1:]))
        for k in range(len(counts)):
            if mixture is not None and few[k]:
                means[k], ellipsoids[k] = mixture.inputs[k], mixture.ellipsoids[k]
            else:
                ellipsoids[k] = mean(points, shares[:, k])
        bare = Mixture(total / total.sum(), means, ellipsoids, np.empty(0))
        deviations = bare.deviations(inputs, points)
        weighted = deviations * (shares.T / total[:, None])[..., None]
        covariances = np.swapaxes(weighted, -1, -2) @ deviations
        covariances = 0.5 * (covariances + np.swapaxes(covariances, -1, -2)) + np.diag(ridge)
        if mixture is not None:
            covariances = np.where(few[:, None, None], mixture.covariances, covariances)
        mixture = replace(bare, covariances=covariances)
        joint = mixture.log_joint(deviations)
        likelihood = logsumexp(joint, axis=1, keepdims=True)
        shares = np.exp(joint - likelihood)
        history.append(float(likelihood.mean()))
        if best is None or history[-1] > best[1]:
            best = mixture, history[-1]
        converged = len(history) > 1 and history[-1] - history[-2] <= tol
    assert best is not None
    return Fit(*best, np.array(history), converged)


def k_means_shares(inputs: Array, points: Array, count: int, generator: np.random.Generator, runs: int = 4) -> Array:
    """Return shares (n, K) of zeros and ones: the tightest of several k-means++ runs; no cluster is empty.

    The features are the inputs and the whitened coordinates at the Fréchet mean.
    """
    if count == 1:
        return np.ones((len(points), 1))
    parts = inputs - inputs.mean(axis=0), coordinates(mean(points), points)
    sizes = [np.sqrt(np.mean(np.sum(part**2, axis=1))) for part in parts]
    features = np.concatenate(
        [part / (size if size > 1e-12 else 1.0) for part, size in zip(parts, sizes, strict=True)], 1
    )
    distinct = len(np.unique(features, axis=0))
    if distinct < count:
        raise InvalidInputError(f"{count} components need as many different points; found {distinct}")
    clusterings = []
    for _ in range(runs):
        seed = int(generator.integers(2**31))
        try:
            _, labels = kmeans2(features, count, iter=50, minit="++", missing="raise", seed=seed)
        except ClusterError:  # Lloyd's steps emptied a cluster: assign to the starts, which are points
            _, labels = kmeans2(features, count, iter=1, minit="++", seed=seed)
        centers = np.stack([features[labels == k].mean(axis=0) for k in range(count)])
        clusterings.append((float(np.sum((features - centers[labels]) ** 2)), labels))
    return np.asarray(np.eye(count)[min(clusterings, key=lambda run: run[0])[1]])


def regress(mixture: Mixture, inputs: Array) -> tuple[Array, Array]:
    """Return the conditional mean (n, d, d) and covariance (n, m, m) of the ellipsoid, given inputs (n, p)."""
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
    """Return whitened tangents e_k at centers (n, d, d), shape (n, K, d, d); `ahead` are the offsets at M_k."""
    root, inverse_root = roots(mixture.ellipsoids)
    values, vectors = whitened_eigh(inverse_root, centers[:, None])
    rotations = roots(centers)[1][:, None] @ root @ compose(np.sqrt(values), vectors)
    return congruence(rotations, ahead - compose(np.log(values), vectors))


def _fixed_points(mixture: Mixture, shares: Array, ahead: Array) -> Array:
    """Return conditional means (n, d, d), started at the prediction of the most likely component."""
    rows, best = np.arange(len(shares)), shares.argmax(axis=1)
    centers = congruence(
        roots(mixture.ellipsoids)[0][best], apply(ahead[rows, best], bounded(np.exp, "the prediction at these inputs"))
    )
    values = eigh(centers)[0]
    tolerance, max_steps = 1e-9, 100
    rounding = 10 * np.finfo(np.float64).eps * values[:, -1] / values[:, 0]  # grows with the condition number
    tolerances = np.clip(rounding, tolerance, 1e-3)
    lengths, last = np.ones(len(shares)), np.full(len(shares), np.inf)
    moving = rows
    for _ in range(max_steps):
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
        f"the conditional mean of {len(moving)} of {len(shares)} inputs stopped after {max_steps} steps, "
        f"the last of length up to {last[moving].max():.3g}; the tolerance is {tolerance:g}",
        ConvergenceWarning,
        stacklevel=4,
    )
    return centers
