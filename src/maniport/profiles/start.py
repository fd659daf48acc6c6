"""Where EM starts: k-means, as often as wanted; the most likely mixture is kept."""

from dataclasses import dataclass

import numpy as np
from sklearn.cluster import KMeans

from maniport.errors import InvalidInputError
from maniport.profiles.mixture import Fit, expectation_maximization
from maniport.profiles.tangent import coordinates
from maniport.spd.mean import mean
from maniport.steps import Part, counted
from maniport.validation import Array

RUNS = 4
"""Number of k-means++ runs of which the tightest is taken."""


@dataclass(frozen=True)
class Settings:
    """Parameters of `maniport.profiles.ProfileGMM` by their names, checked."""

    regularization: float
    n_init: int
    max_iter: int
    tol: float


def most_likely(
    inputs: Array, points: Array, count: int, settings: Settings, generator: np.random.Generator, tell: Part
) -> Fit:
    """Fit `count` components from several starts and return the most likely; `tell` takes the fraction done."""
    d, p = points.shape[-1], inputs.shape[1]
    ridge = settings.regularization * np.r_[np.full(p, np.var(inputs, axis=0).mean()), np.ones(d * (d + 1) // 2)]
    starts = settings.n_init if count > 1 else 1
    fits = [
        expectation_maximization(
            inputs, points, k_means_shares(inputs, points, count, generator), ridge, settings.tol, settings.max_iter
        )
        for _ in counted(range(starts), starts, tell)
    ]
    return max(fits, key=lambda fit: fit.log_likelihood)


def k_means_shares(inputs: Array, points: Array, count: int, generator: np.random.Generator) -> Array:
    """Shares (n, K) of zeros and ones, from k-means on the inputs and on whitened coordinates at the Fréchet mean.

    Both are scaled to a summed variance of one, so that neither the unit of the inputs nor a congruence of the
    ellipsoids matters. k-means only starts EM: the flattening of one tangent space for all data does no harm.
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
    model = KMeans(count, n_init=RUNS, random_state=int(generator.integers(2**31)))
    return np.asarray(np.eye(count)[model.fit_predict(features)])
