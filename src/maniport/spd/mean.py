"""Fréchet mean of SPD matrices under the affine-invariant metric, dispersion about it, and whitening by it."""

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import ConvergenceWarning, InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import distance_unchecked, recentered
from maniport.spd.kernels import Moments, compose, congruence, eigh, mandel_basis, moments
from maniport.spd.matrix_functions import apply, roots
from maniport.util.validation import (
    Array,
    as_choice,
    as_count,
    as_finite,
    as_number,
    as_points,
    as_spd,
    require_broadcast,
    require_shape,
)

ILL_CONDITIONED = "points are too ill-conditioned for their mean: rounding makes them indefinite about it"


def mean(points: ArrayLike, weights: ArrayLike | None = None, tol: float = 1e-10, max_iter: int = 50) -> Array:
    """Fréchet (Karcher, geometric) mean: the point with the least weighted sum of squared distances.

    Riemannian Newton with line search, started from the log-Euclidean mean. The cost is geodesically convex and
    its Hessian at least the identity, so that the mean is unique and the step always well defined.

    Parameters
    ----------
    points : array_like, shape (n, d, d)
        SPD matrices, n ≥ 1.
    weights : array_like, shape (n,), optional
        Non-negative; they are scaled to sum to one. Default: all equal.
    tol : float
        Stopping rule: the norm of the Riemannian gradient, ‖Σ w_i log(P^-½ X_i P^-½)‖_F, is at most `tol`, or as
        small as rounding allows: about machine precision times the condition number of the points.
    max_iter : int
        Largest number of Newton steps.

    Returns
    -------
    ndarray, shape (d, d)

    Warns
    -----
    ConvergenceWarning
        When the gradient norm is still above that after `max_iter` steps; the warning states the norm reached.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, there is none, or the weights do not fit.

    Notes
    -----
    The Hessian of ½ d²(P, X) has the eigenvalues x coth x, x = (log λ_j − log λ_k) / 2, in the eigenbasis of
    P^-½ X P^-½ (the Jacobi fields of the space, whose sectional curvature there is −(log λ_j − log λ_k)² / 4).

    References
    ----------
    Moakher, A differential geometric approach to the geometric mean of symmetric positive-definite matrices, SIMAX 26,
    2005.
    """
    data = as_points(points, "points", minimum=1, copy=False)
    w = as_weights(weights, len(data))
    tol = as_number(tol, "tol", above=0.0)
    limit = as_count(max_iter, "max_iter")
    sample = _Sample(data, w, np.linalg.norm(data, axis=(-2, -1)))
    start = moments(data, np.eye(data.shape[-1]), w, sample.sizes, curved=False)
    if start is None:
        raise NotSPDError(ILL_CONDITIONED)
    now = _Iterate(apply(start.gradient, np.exp), sample)  # from the log-Euclidean mean
    if not np.isfinite(now.cost):
        raise NotSPDError(ILL_CONDITIONED)
    steps, reason = 0, ""
    while now.norm > tol and not reason:
        following = _line_search(now) if steps < limit else None
        if following is not None:
            now, steps = following, steps + 1
        else:
            reason = f"after {limit} steps" if steps == limit else "because rounding allows no further progress"
    if now.norm > max(tol, now.rounding):
        warnings.warn(
            f"the mean of {len(data)} matrices stopped {reason} at gradient norm {now.norm:.3g}; wanted {tol:.3g}",
            ConvergenceWarning,
            stacklevel=2,
        )
    return now.center


def dispersion(points: ArrayLike, center: ArrayLike | None = None, kind: str = "mean") -> float:
    """How far the points lie from their mean.

    Parameters
    ----------
    points : array_like, shape (n, d, d)
        SPD matrices.
    center : array_like, shape (d, d), optional
        Where to measure from. Default: the Fréchet mean.
    kind : {"mean", "rms"}
        Mean distance (Reithmeir et al. 2022, eqs. 13 and 14) or root of the mean squared distance. Both grow by the
        factor s when the points are dilated to P^s about the identity.

    Returns
    -------
    float
    """
    data = as_points(points, "points", minimum=1, copy=False)
    as_choice(kind, "kind", ("mean", "rms"))
    middle = mean(data) if center is None else as_spd(center, "center", data.shape[-1])
    if middle.ndim != 2:
        raise InvalidInputError(f"center must be one matrix, shape (d, d); found shape {middle.shape}")
    distances = distance_unchecked(middle, data)
    return float(np.mean(distances) if kind == "mean" else np.sqrt(np.mean(distances**2)))


def whiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Recenter points at the identity: P^-½ X P^-½ (Reithmeir et al. 2022, eqs. 10 and 11); shape (..., d, d).

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        SPD.
    center : array_like, shape (d, d)
        SPD.

    Returns
    -------
    ndarray, shape (..., d, d)

    Raises
    ------
    NotSPDError
        When a matrix is not SPD, or so ill-conditioned that rounding moves a result by more than a distance of 0.01.
    """
    return _recentered(points, center, 1)


def unwhiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Move points from the identity to `center`: P^½ X P^½; the inverse of `whiten`, with its errors.

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        SPD.
    center : array_like, shape (d, d)
        SPD.

    Returns
    -------
    ndarray, shape (..., d, d)
    """
    return _recentered(points, center, 0)


def _recentered(points: ArrayLike, center: ArrayLike, root: int) -> Array:
    """Apply the congruence by P^½ (0) or P^-½ (1)."""
    middle = as_spd(center, "center")
    data = as_spd(points, "points", middle.shape[-1])
    require_broadcast(points=data, center=middle)
    return recentered(roots(middle)[root], data)


class _Sample(NamedTuple):
    """Points (n, d, d), weights that sum to one and the points' norms, both (n,)."""

    points: Array
    weights: Array
    sizes: Array


class _Iterate:
    """A candidate for the mean."""

    def __init__(self, center: Array, sample: _Sample, curved: bool = True) -> None:
        """Compute the cost, its gradient and, when `curved`, its Hessian."""
        self.center, self.sample = center, sample
        values, vectors = eigh(center)
        root = np.sqrt(np.abs(values))
        self.root = compose(root, vectors)
        terms = None
        if values[0] > 0:
            terms = moments(sample.points, compose(1.0 / root, vectors), sample.weights, sample.sizes, curved)
        if terms is None:  # rounding made a point indefinite
            terms = Moments(np.inf, np.inf, np.full(center.shape, np.inf), None)
        self.moments, self.cost = terms, terms.cost
        self.norm = float(np.linalg.norm(terms.gradient))
        # Whitening rounds by eps |X| |P⁻¹|; the logarithm divides that by the smallest eigenvalue. A larger gradient
        # than 1e-3 is not put down to rounding.
        with np.errstate(divide="ignore"):
            self.rounding = min(float(np.finfo(np.float64).eps / np.abs(values[0])) * terms.rounding, 1e-3)


def _line_search(now: _Iterate) -> _Iterate | None:
    """Take the Newton step, or the largest half of a half … of it that makes progress; None when none does."""
    if now.moments.hessian is None:  # shortened steps do without at first
        now = _Iterate(now.center, now.sample)
    direction = _newton_direction(now.moments.hessian, now.moments.gradient)
    descent = float(np.sum(now.moments.gradient * direction))
    length = 1.0
    while length > 1e-8:
        center = congruence(now.root, apply(length * direction, np.exp))
        following = _Iterate(center, now.sample, curved=length == 1.0)
        # near the solution the cost no longer resolves the step, but the gradient does
        if following.norm < 0.5 * now.norm:
            return following
        if now.norm <= now.rounding:
            return None
        if following.cost <= now.cost - 1e-4 * length * descent:
            return following
        length /= 2
    return None


def _newton_direction(hessian: Array | None, gradient: Array) -> Array:
    """Solve Hessian · H = gradient over symmetric matrices."""
    assert hessian is not None
    basis = mandel_basis(gradient.shape[-1])
    solution = np.linalg.solve(hessian, np.einsum("kij,ij->k", basis, gradient))
    return np.asarray(np.einsum("k,kij->ij", solution, basis))


def as_weights(value: ArrayLike | None, count: int, name: str = "weights") -> Array:
    """Convert to non-negative weights of shape (count,) that sum to one; None gives equal weights."""
    if value is None:
        return np.full(count, 1.0 / count)
    weights = as_finite(value, name)
    require_shape(weights, name, (count,), ", one for each point")
    if np.any(weights < 0) or not np.any(weights > 0):
        raise InvalidInputError(
            f"{name} must be non-negative with a positive sum; found minimum {weights.min():.3g}, "
            f"maximum {weights.max():.3g}"
        )
    shares = weights / weights.max()  # first: a sum of the largest numbers there are would be infinite
    return np.asarray(shares / shares.sum())
