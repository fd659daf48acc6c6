"""Fréchet mean of SPD matrices under the affine-invariant metric, and dispersion about it."""

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import ConvergenceWarning, InvalidInputError, NotSPDError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import compose, congruence, eigh
from maniport.spd.matrix_functions import apply, from_vector, to_vector
from maniport.util.jit import kernel
from maniport.util.validation import Array, as_finite, as_number, as_points, as_spd, require_shape


def mean(points: ArrayLike, weights: ArrayLike | None = None, tol: float = 1e-10) -> Array:
    """Fréchet (Karcher, geometric) mean: the point with the least weighted sum of squared distances.

    Riemannian Newton with line search, started from the log-Euclidean mean. The cost is geodesically convex and
    its Hessian at least the identity, so that the mean is unique and the step always well defined; equation (6).

    Parameters
    ----------
    points : array_like, shape (n, d, d)
        SPD matrices, n ≥ 1.
    weights : array_like, shape (n,), optional
        Non-negative; they are scaled to sum to one. Default: all equal.
    tol : float
        Stopping rule: the norm of the Riemannian gradient, ‖Σ w_i log(P^-½ X_i P^-½)‖_F, is at most `tol`, or as
        small as rounding allows: about machine precision times the condition number of the points.

    Returns
    -------
    ndarray, shape (d, d)

    Warns
    -----
    ConvergenceWarning
        When the gradient norm is still above that after 50 steps; the warning states the norm reached.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, there is none, or the weights do not fit.

    References
    ----------
    Moakher, A differential geometric approach to the geometric mean of symmetric positive-definite matrices, SIMAX 26,
    2005.
    """
    data = as_points(points, "points", minimum=1, copy=False)
    w = as_weights(weights, len(data))
    tol = as_number(tol, "tol", above=0.0)
    mean_logarithm = np.einsum("n,nij->ij", w, apply(data, np.log))
    log_euclidean_mean = apply(mean_logarithm, np.exp)
    state = _State.at(log_euclidean_mean, data, w)
    if state is None:
        raise NotSPDError(
            "points are too ill-conditioned for their mean: rounding makes them indefinite about it"
        )
    for _ in range(50):
        if state.norm > tol:
            following = _line_search(state, data, w)
        else:
            following = None
        if following is None:
            break
        state = following
    if state.norm > max(tol, state.rounding):
        warnings.warn(
            f"the mean of {len(data)} matrices stopped at gradient norm {state.norm:.3g}; wanted {tol:.3g}",
            ConvergenceWarning,
            stacklevel=2,
        )
    return state.center


def dispersion(points: ArrayLike, center: ArrayLike | None = None) -> float:
    """Mean distance of the points from their mean (Reithmeir et al. 2022, eqs. 13 and 14).

    It grows by the factor s when the points are dilated to P^s about the identity.

    Parameters
    ----------
    points : array_like, shape (n, d, d)
        SPD matrices.
    center : array_like, shape (d, d), optional
        Where to measure from. Default: the Fréchet mean.

    Returns
    -------
    float
    """
    data = as_points(points, "points", minimum=1, copy=False)
    middle = mean(data) if center is None else as_spd(center, "center", data.shape[-1])
    if middle.ndim != 2:
        raise InvalidInputError(
            f"center must be one matrix, shape (d, d); found shape {middle.shape}"
        )
    return float(np.mean(distance_unchecked(middle, data)))


class _State(NamedTuple):
    """A candidate P for the mean."""

    center: Array
    root: Array  # P^½
    values: Array  # eigenvalues (n, d) and -vectors (n, d, d) of Y_i = P^-½ X_i P^-½
    vectors: Array
    cost: float  # ½ Σ w d²(Y, I)
    gradient: Array  # Σ w log Y, the negative Riemannian gradient of the cost
    norm: float  # of the gradient
    rounding: float  # size of the gradient that rounding may leave

    @classmethod
    def at(cls, center: Array, data: Array, weights: Array) -> "_State | None":
        """Compute it; None where rounding makes a matrix indefinite."""
        spectrum, frame = eigh(center)
        if not spectrum[0] > 0.0:
            return None
        root = np.sqrt(spectrum)
        values, vectors = eigh(congruence(compose(1.0 / root, frame), data))
        if not np.all(values > 0.0):
            return None
        logs = np.log(values)
        gradient = compose(weights[:, None] * logs, vectors).sum(axis=0)
        # Whitening rounds by eps |X| |P⁻¹|; the logarithm divides that by the smallest eigenvalue. A larger gradient
        # than 1e-3 is not put down to rounding.
        size = float(weights @ (np.linalg.norm(data, axis=(-2, -1)) / values[:, 0]))
        rounding = min(float(np.finfo(np.float64).eps) / spectrum[0] * size, 1e-3)
        cost = 0.5 * float(weights @ np.sum(logs**2, axis=-1))
        norm = float(np.linalg.norm(gradient))
        return cls(center, compose(root, frame), values, vectors, cost, gradient, norm, rounding)


def _line_search(now: _State, data: Array, weights: Array) -> _State | None:
    """Take the Newton step, or the largest half of a half … of it that makes progress; None when none does."""
    direction = _newton_direction(now, weights)
    descent = float(np.sum(now.gradient * direction))
    length = 1.0
    while length > 1e-8:
        following = _State.at(
            congruence(now.root, apply(length * direction, np.exp)), data, weights
        )
        # near the solution the cost no longer resolves the step, but the gradient does
        if following is not None and following.norm < 0.5 * now.norm:
            return following
        if now.norm <= now.rounding:
            return None
        if following is not None and following.cost <= now.cost - 1e-4 * length * descent:
            return following
        length /= 2
    return None


def _newton_direction(now: _State, weights: Array) -> Array:
    """Solve Hessian · H = gradient over symmetric matrices, in the Mandel basis."""
    gradient = to_vector(now.gradient)
    hessian = np.zeros((len(gradient), len(gradient)))
    _add_hessians(now.values, np.log(now.values), now.vectors, weights, hessian)
    return from_vector(np.linalg.solve(hessian, gradient))


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
    # a sum of the largest numbers there are would be infinite
    shares = weights / weights.max()
    return np.asarray(shares / shares.sum())


@kernel
def _add_hessians(
    values: Array, logs: Array, vectors: Array, weights: Array, hessian: Array
) -> None:
    """Sum the Hessians of half the squared distance to I, in the Mandel basis (m, m), over weighted Y = V diag Vᵀ."""
    count, n = values.shape
    tangent = np.empty(len(hessian))
    for row in range(count):
        v = vectors[row]
        for p in range(n):
            for q in range(p, n):
                x = 0.5 * (logs[row, p] - logs[row, q])
                stretch = 1.0  # x coth x
                if abs(x) < 1e-3:
                    stretch += x * x / 3.0
                else:
                    stretch = (
                        x * (values[row, p] + values[row, q]) / (values[row, p] - values[row, q])
                    )
                entry = n
                for i in range(n):
                    tangent[i] = v[i, p] * v[i, q]
                    for j in range(i + 1, n):
                        tangent[entry] = np.sqrt(0.5) * (v[i, p] * v[j, q] + v[j, p] * v[i, q])
                        entry += 1
                scale = weights[row] * stretch * (1.0 if p == q else 2.0)
                for i in range(len(tangent)):
                    for j in range(i + 1):
                        hessian[i, j] += scale * tangent[i] * tangent[j]
    for i in range(len(hessian)):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
