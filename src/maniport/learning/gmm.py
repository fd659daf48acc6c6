"""Gaussian mixture of a profile over time, from several demonstrations.

The covariance was measured by holding out one demonstration: the share of its ellipsoids, 3×3 at 40 times, inside the
95 % ellipsoid of the others; mean over 5 draws of 4, 6 and 10 synthetic demonstrations, 3 or 6 components. Where
demonstrations deviate smoothly, as people do: 0.01 to 0.82 without `groups`, 0.81 to 0.97 with. Where all points
deviate independently: 0.78 to 0.94 without, 0.97 to 1.00 with.
"""

import warnings
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from maniport.errors import ConvergenceWarning, InvalidInputError, NotFittedError
from maniport.estimator import Estimator
from maniport.learning.mixture import Mixture, expectation_maximization, log_likelihood, regressed
from maniport.util.notebook import NotebookDisplay
from maniport.util.progress import Progress, Step
from maniport.util.validation import (
    Array,
    as_count,
    as_number,
    as_numbers,
    as_points,
    require_shape,
)

COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32)  # numbers of Gaussians that are tried
PATIENCE = 2  # of these without a larger held-out likelihood end the search
PARTS = 5  # Most parts that are held out, one after another
HELD_OUT_TOL = 1e-2  # EM of these fits ends earlier: numbers of Gaussians differ by more
HELD_OUT_STEPS = 50


class ProfileGMM(NotebookDisplay, Estimator):
    """Gaussian mixture on time × SPD(d): mean and covariance of the ellipsoid at a time.

    Each component is a Gaussian of [t − mean; vec(log(M^-½ X M^-½))] in the tangent space at its Fréchet mean M;
    densities are those of the tangent spaces (the volume that curvature adds is 1 + δ²/24 for a log-ratio δ of two
    eigenvalues). EM starts from intervals of time with equal numbers of points.

    Parameters
    ----------
    n_components : int, optional
        Number of Gaussians. Default: that of the largest likelihood of held-out points, of 1 to 6, 8, 10, 12, 16, … up
        to 32, or as many as the points allow. With at least three `groups`, whole demonstrations are held out, in at
        most five parts; otherwise every fifth point in the order of time, which overrates demonstrations that deviate
        smoothly. The search ends after two numbers without a larger likelihood.
    regularization : float
        Added to the variances in log coordinates and, times the variance of the times, to theirs.
    max_iter : int
        Largest number of EM steps, beyond which a `ConvergenceWarning` is issued.
    tol : float
        EM stops when the mean log-likelihood rises by at most this; the most likely mixture is kept.

    Attributes
    ----------
    n_components_ : int
    weights_, input_means_ : ndarray, shape (K,)
        Weights and mean times.
    means_ : ndarray, shape (K, d, d)
    covariances_ : ndarray, shape (K, 1 + m, 1 + m)
        With m = d (d + 1) / 2, in the coordinates above.
    log_likelihood_ : float
        Mean over the training points.
    history_ : ndarray
        Mean log-likelihood after each EM step. As the Fréchet mean is not quite the most likely one in a curved space,
        it may fall: by up to 3e-5 at ellipsoids 0.3 apart, 1e-3 at 1, 1e-2 at 2.
    converged_ : bool
    n_demonstrations_ : int or None
        Number of different `groups`.
    held_out_ : dict of int to float
        Mean log-likelihood of held-out points by each number of components that was tried; empty where it was given.

    References
    ----------
    Jaquier, Rozo, Caldwell and Calinon, Geometry-aware manipulability learning, tracking, and transfer, IJRR 40, 2021.

    Examples
    --------
    >>> import numpy as np
    >>> from maniport.learning import ProfileGMM
    >>> time = np.tile(np.linspace(0.0, 1.0, 20), 3)
    >>> ellipsoids = np.exp(time)[:, None, None] * np.eye(2)
    >>> model = ProfileGMM(n_components=1).fit(time, ellipsoids)
    >>> bool(np.allclose(model.predict([0.5]), np.exp(0.5) * np.eye(2), rtol=1e-3))
    True
    """

    def __init__(
        self,
        n_components: int | None = None,
        regularization: float = 1e-5,
        max_iter: int = 200,
        tol: float = 1e-3,
    ):
        self.n_components = n_components
        self.regularization = regularization
        self.max_iter = max_iter
        self.tol = tol

    def fit(
        self,
        time: ArrayLike,
        ellipsoids: ArrayLike,
        groups: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit the mixture to all demonstrations together.

        Parameters
        ----------
        time : array_like, shape (n,)
            Of all demonstrations one after another.
        ellipsoids : array_like, shape (n, d, d)
            SPD.
        groups : array_like, shape (n,), optional
            Demonstration of each point, needed where demonstrations deviate smoothly: `predict` then returns the
            covariance that so few observations justify. Default: all points are independent.
        progress : callable, optional
            Called with the name of a step and the fraction done.

        Raises
        ------
        NotSPDError, InvalidInputError
            When an ellipsoid is not SPD, lengths differ, all times are equal, there are fewer than m + 2 points for
            each component, groups do not fit, or a parameter is wrong. The model then stays unchanged.
        """
        points = as_points(ellipsoids, "ellipsoids")
        times = as_numbers(time, "time", len(points))
        if np.ptp(times) == 0.0:
            raise InvalidInputError(
                f"time must not be the same everywhere; found {times[0]:g} {len(times)} times"
            )
        demonstrations = _number_of(groups, len(points))
        regularization = as_number(self.regularization, "regularization", above=0.0)
        tol = as_number(self.tol, "tol", above=0.0)
        max_iter = as_count(self.max_iter, "max_iter")
        ridge = regularization * np.r_[np.var(times), np.ones(points_each(points.shape[-1]) - 2)]
        step = Step(progress, "Fit Gaussian mixture")
        data = _Data(times, points, ridge)
        with threadpool_limits(
            1
        ):  # threads cost more than they bring on matrices this small, and far more when busy
            parts = _held_out_parts(times, groups, demonstrations)
            count, held_out = self._component_count(data, parts, step)
            mixture, history, self.converged_ = data.fit(count, tol, max_iter)
        if not self.converged_:
            warnings.warn(
                f"EM with {len(mixture.weights)} components stopped after {self.max_iter} steps; the mean "
                f"log-likelihood still rose by more than {self.tol:g}",
                ConvergenceWarning,
                stacklevel=2,
            )
        self.weights_ = mixture.weights
        self.input_means_ = mixture.times
        self.means_ = mixture.ellipsoids
        self.covariances_ = mixture.covariances
        self.history_ = np.array(history)
        self.log_likelihood_ = max(history)
        self.held_out_ = held_out
        self.n_components_ = len(mixture.weights)
        self.n_demonstrations_ = demonstrations
        step.end(f"{self.n_components_} Gaussians, mean log-likelihood {self.log_likelihood_:.3g}")
        return self

    def _component_count(
        self, data: "_Data", parts: NDArray[np.intp], step: Step
    ) -> tuple[int, dict[int, float]]:
        """Return `n_components`, or the number of the largest likelihood of held-out parts, and those likelihoods."""
        fewest = points_each(data.points.shape[-1])
        allowed = len(data.times) // fewest
        if self.n_components is not None:
            count = as_count(self.n_components, "n_components")
            _require_points(count, allowed, fewest, len(data.times))
            return count, {}

        _require_points(1, allowed, fewest, len(data.times))
        likelihoods: dict[int, float] = {}
        best = 1
        for place, count in enumerate(COUNTS):
            if count > allowed:
                break
            step(place / len(COUNTS))
            likelihood = data.held_out_likelihood(count, parts)
            if likelihood is None:  # too few points without a part
                break
            likelihoods[count] = likelihood
            if likelihood > likelihoods[best]:
                best = count
            tried = list(likelihoods)
            if len(tried) - 1 - tried.index(best) == PATIENCE:
                break
        return best, likelihoods

    def predict(
        self, time: ArrayLike, return_covariance: bool = False
    ) -> Array | tuple[Array, Array]:
        """Return the ellipsoids expected at times, by Gaussian mixture regression.

        Parameters
        ----------
        time : array_like, shape (n,)
            Outside the times of `fit` the nearest component's geodesic is extended, until the ellipsoid overflows.
        return_covariance : bool
            Also return the covariance.

        Returns
        -------
        ellipsoids : ndarray, shape (n, d, d)
        covariance : ndarray, shape (n, m, m)
            Covariance of vec(log(P^-½ X P^-½)) in Mandel form, P being the predicted ellipsoid and X one of a
            demonstration, m = d (d + 1) / 2; see `maniport.learning.tracking_weights`.
        """
        if not hasattr(self, "means_"):
            raise NotFittedError(
                "this ProfileGMM is not fitted yet; call fit(time, ellipsoids) first"
            )
        mixture = Mixture(self.weights_, self.input_means_, self.means_, self.covariances_)
        centers, covariance = regressed(mixture, as_numbers(time, "time"))
        k = self.n_demonstrations_
        if k is not None:  # predictive instead of maximum-likelihood
            unbiased = k / (k - 1) * covariance
            m = covariance.shape[-1]
            variance = np.trace(unbiased, axis1=-2, axis2=-1)[:, None, None] / m
            covariance = (1 + 1 / k) * (k * unbiased + m * variance * np.eye(m)) / (k + m)
        if return_covariance:
            return centers, covariance
        return centers


def _require_points(count: int, allowed: int, fewest: int, found: int) -> None:
    """Raise where there are too few points for a number of components."""
    if count > allowed:
        raise InvalidInputError(
            f"{count} components need {count * fewest} ellipsoids, {fewest} each; found {found}"
        )


@dataclass(frozen=True)
class _Data:
    """Points of all demonstrations."""

    times: Array  # (n,)
    points: Array  # (n, d, d)
    ridge: Array  # (1 + m,), added to the variances

    def fit(self, count: int, tol: float, max_iter: int) -> tuple[Mixture, list[float], bool]:
        """Fit a mixture by EM, from intervals of time with equal numbers of points."""
        bounds = np.quantile(self.times, np.arange(1, count) / count)
        interval = np.searchsorted(bounds, self.times, side="right")
        shares = np.eye(count)[interval]
        return expectation_maximization(self.times, self.points, shares, self.ridge, tol, max_iter)

    def held_out_likelihood(self, count: int, parts: NDArray[np.intp]) -> float | None:
        """Return the mean log-likelihood of points whose part (n,) is left out of the fit; None for too few points."""
        total = 0.0
        for part in np.unique(parts):
            outside = parts == part
            kept = _Data(self.times[~outside], self.points[~outside], self.ridge)
            is_enough = len(kept.times) >= count * points_each(self.points.shape[-1])
            if not is_enough or np.ptp(kept.times) == 0.0:
                return None
            mixture, _, _ = kept.fit(count, HELD_OUT_TOL, HELD_OUT_STEPS)
            likelihood = log_likelihood(mixture, self.times[outside], self.points[outside])
            total += likelihood * outside.sum()
        return float(total / len(parts))


def _held_out_parts(
    times: Array, groups: ArrayLike | None, demonstrations: int | None
) -> NDArray[np.intp]:
    """Return the number of the part (n,) with which each point is held out."""
    if groups is not None and demonstrations is not None and demonstrations >= 3:
        _, numbers = np.unique(np.asarray(groups), return_inverse=True)
        return np.asarray(numbers.reshape(-1) % PARTS, dtype=np.intp)
    parts = np.empty(len(times), dtype=np.intp)
    parts[np.argsort(times, kind="stable")] = np.arange(len(times)) % PARTS
    return parts


def points_each(d: int) -> int:
    """Return the least number of ellipsoids d × d for a component."""
    return d * (d + 1) // 2 + 2


def _number_of(groups: ArrayLike | None, points: int) -> int | None:
    """Return the number of different labels; None without labels."""
    if groups is None:
        return None
    labels = np.asarray(groups)
    require_shape(labels, "groups", (points,), ", a label for each point")
    count = len(set(labels.tolist()))
    if count < 2:
        raise InvalidInputError(f"groups must hold at least 2 different labels; found {count}")
    return count
