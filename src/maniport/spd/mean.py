"""Fréchet mean of SPD matrices under the affine-invariant metric, dispersion about it, and whitening by it."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import ConvergenceWarning, InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply, compose, congruence, roots
from maniport.validation import Array, as_choice, as_count, as_number, as_points, as_spd, as_weights, require_broadcast

BLOCK_BYTES = 32_000_000
MAX_ROUNDING = 1e-3
"""Largest gradient norm that is put down to rounding; a mean with a larger one has not converged."""


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
    """
    data = as_points(points, "points", minimum=1)
    w = as_weights(weights, len(data))
    tol = as_number(tol, "tol", above=0.0)
    limit = as_count(max_iter, "max_iter")
    now = _Iterate(apply(np.einsum("n,nij->ij", w, apply(data, np.log)), np.exp), data, w)
    if not np.isfinite(now.cost):
        raise NotSPDError("points are too ill-conditioned for their mean: rounding makes them indefinite about it")
    steps, reason = 0, ""
    while now.norm > tol and not reason:
        following = _line_search(now, data, w) if steps < limit else None
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
        Mean distance (Reithmeir et al. 2022, eq. 12) or root of the mean squared distance. Both grow by the
        factor s when the points are dilated to P^s about the identity.
    """
    data = as_points(points, "points", minimum=1)
    as_choice(kind, "kind", ("mean", "rms"))
    middle = mean(data) if center is None else as_spd(center, "center", data.shape[-1])
    if middle.ndim != 2:
        raise InvalidInputError(f"center must be one matrix, shape (d, d); found shape {middle.shape}")
    distances = distance_unchecked(middle, data)
    return float(np.mean(distances) if kind == "mean" else np.sqrt(np.mean(distances**2)))


def whiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Recentre points at the identity: P^-½ X P^-½ (Reithmeir et al. 2022, eqs. 8 and 9); shape (..., d, d)."""
    middle = as_spd(center, "center")
    data = as_spd(points, "points", middle.shape[-1])
    require_broadcast(points=data, center=middle)
    return congruence(roots(middle)[1], data)


def unwhiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Move points from the identity to `center`: P^½ X P^½; the inverse of `whiten`."""
    middle = as_spd(center, "center")
    data = as_spd(points, "points", middle.shape[-1])
    require_broadcast(points=data, center=middle)
    return congruence(roots(middle)[0], data)


class _Iterate:
    """A candidate for the mean and what follows from it."""

    def __init__(self, center: Array, data: Array, weights: Array) -> None:
        self.center = center
        self.root, inverse_root = roots(center)
        self.whitened = congruence(inverse_root, data)
        self.cost, self.gradient, smallest = _cost_and_gradient(self.whitened, weights)
        self.norm = float(np.linalg.norm(self.gradient))
        # Whitening rounds by eps |X| |P⁻¹|; the logarithm divides that by the smallest eigenvalue.
        sizes = np.linalg.norm(data, axis=(-2, -1)) * np.linalg.norm(inverse_root, 2) ** 2
        noise = float(np.finfo(np.float64).eps * (weights @ (sizes / smallest)))
        self.rounding = min(noise, MAX_ROUNDING)


def _line_search(now: _Iterate, data: Array, weights: Array) -> _Iterate | None:
    """Take the Newton step, or the largest half of a half … of it that makes progress; None when none does."""
    direction = _newton_direction(now.whitened, weights, now.gradient)
    descent = float(np.sum(now.gradient * direction))
    length = 1.0
    while length > 1e-8:
        following = _Iterate(congruence(now.root, apply(length * direction, np.exp)), data, weights)
        # near the solution the cost no longer resolves the step, but the gradient does
        if following.norm < 0.5 * now.norm:
            return following
        if now.norm <= now.rounding:
            return None
        if following.cost <= now.cost - 1e-4 * length * descent:
            return following
        length /= 2
    return None


def _cost_and_gradient(whitened: Array, weights: Array) -> tuple[float, Array, Array]:
    """Return ½ Σ w d², the negative gradient Σ w log Y in the whitened frame and each point's least eigenvalue.

    Where rounding made a point indefinite the cost is infinite, and so is the gradient.
    """
    values, vectors = eigh(whitened)
    smallest = values[:, 0]
    if smallest.min() <= 0:
        return np.inf, np.full(whitened.shape[1:], np.inf), np.ones_like(smallest)
    logs = np.log(values)
    cost = 0.5 * float(weights @ np.sum(logs**2, axis=-1))
    return cost, np.einsum("n,nij->ij", weights, compose(logs, vectors)), smallest


def _newton_direction(whitened: Array, weights: Array, gradient: Array) -> Array:
    """Solve Hessian · H = gradient over symmetric matrices, the Hessian summed over blocks of points."""
    d = gradient.shape[0]
    basis = _mandel_basis(d)
    hessian = np.zeros((len(basis), len(basis)))
    block = max(1, BLOCK_BYTES // (8 * basis.size))
    for first in range(0, len(whitened), block):
        values, vectors = eigh(whitened[first : first + block])
        half_gap = 0.5 * (np.log(values)[:, :, None] - np.log(values)[:, None, :])
        small = np.abs(half_gap) < 1e-3
        stretch = np.where(small, 1.0 + half_gap**2 / 3, half_gap / np.tanh(np.where(small, 1.0, half_gap)))
        stretch *= weights[first : first + block, None, None]
        turned = np.einsum("nji,kjl,nlm->nkim", vectors, basis, vectors, optimize=True)
        hessian += np.einsum("nkij,nlij->kl", turned * stretch[:, None], turned, optimize=True)
    solution = np.linalg.solve(hessian, np.einsum("kij,ij->k", basis, gradient))
    return np.asarray(np.einsum("k,kij->ij", solution, basis))


def _mandel_basis(d: int) -> Array:
    """Orthonormal basis of the symmetric matrices, shape (d (d + 1) / 2, d, d)."""
    basis = []
    for i in range(d):
        for j in range(i, d):
            element = np.zeros((d, d))
            element[i, j] = element[j, i] = 1.0 if i == j else np.sqrt(0.5)
            basis.append(element)
    return np.array(basis)
