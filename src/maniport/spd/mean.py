"""Fréchet mean of SPD matrices under the affine-invariant metric, dispersion about it, and whitening by it."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import ConvergenceWarning
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply, compose, congruence, roots
from maniport.validation import Array, as_choice, as_count, as_number, as_points, as_spd, as_weights

BLOCK_BYTES = 32_000_000


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
        Stopping rule: the norm of the Riemannian gradient, ‖Σ w_i log(P^-½ X_i P^-½)‖_F, is at most `tol`.
    max_iter : int
        Largest number of Newton steps.

    Returns
    -------
    ndarray, shape (d, d)

    Warns
    -----
    ConvergenceWarning
        When the gradient norm is still above `tol`, after `max_iter` steps or because rounding allows no further
        progress; the warning states the norm that was reached.

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
    center = apply(np.einsum("n,nij->ij", w, apply(data, np.log)), np.exp)
    whitened, root = _whiten(data, center)
    cost, gradient = _cost_and_gradient(whitened, w)
    steps, reason = 0, ""
    while np.linalg.norm(gradient) > tol:
        if steps == limit:
            reason = f"after {limit} steps"
            break
        steps += 1
        direction = _newton_direction(whitened, w, gradient)
        length = 1.0
        while length > 1e-8:
            candidate = congruence(root, apply(length * direction, np.exp))
            moved, moved_root = _whiten(data, candidate)
            moved_cost, moved_gradient = _cost_and_gradient(moved, w)
            # near the solution the cost no longer resolves the step, but the gradient does
            if moved_cost <= cost - 1e-4 * length * np.sum(gradient * direction) or (
                np.linalg.norm(moved_gradient) < 0.5 * np.linalg.norm(gradient)
            ):
                break
            length /= 2
        else:
            reason = "because rounding allows no further progress"
            break
        center, whitened, root, cost, gradient = candidate, moved, moved_root, moved_cost, moved_gradient
    if reason:
        warnings.warn(
            f"the mean of {len(data)} matrices stopped {reason} at gradient norm {np.linalg.norm(gradient):.3g}; "
            f"wanted {tol:.3g}",
            ConvergenceWarning,
            stacklevel=2,
        )
    return center


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
    distances = distance_unchecked(middle, data)
    return float(np.mean(distances) if kind == "mean" else np.sqrt(np.mean(distances**2)))


def whiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Recentre points at the identity: P^-½ X P^-½ (Reithmeir et al. 2022, eqs. 8 and 9); shape (..., d, d)."""
    middle = as_spd(center, "center")
    _, inverse_root = roots(middle)
    return congruence(inverse_root, as_spd(points, "points", middle.shape[-1]))


def unwhiten(points: ArrayLike, center: ArrayLike) -> Array:
    """Move points from the identity to `center`: P^½ X P^½; the inverse of `whiten`."""
    middle = as_spd(center, "center")
    root, _ = roots(middle)
    return congruence(root, as_spd(points, "points", middle.shape[-1]))


def _whiten(points: Array, center: Array) -> tuple[Array, Array]:
    root, inverse_root = roots(center)
    return congruence(inverse_root, points), root


def _cost_and_gradient(whitened: Array, weights: Array) -> tuple[float, Array]:
    """Return ½ Σ w d² and the negative gradient Σ w log Y in the whitened frame."""
    values, vectors = eigh(whitened)
    logs = np.log(values)
    cost = 0.5 * float(weights @ np.sum(logs**2, axis=-1))
    return cost, np.einsum("n,nij->ij", weights, compose(logs, vectors))


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
