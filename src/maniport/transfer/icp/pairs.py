"""Least squares of a rigid map over pairs: both means, dispersion and rotation together.

Means and dispersions of whole clouds are wrong where the clouds have only a part in common. Here all of the map is
fitted to pairs T_i, S_i: the weighted sum of squared distances d²(S_i, f(T_i)) is minimized by Levenberg-Marquardt.
`docs/method/icp.md` has the residuals.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from maniport.spd.kernels import compose, congruence, eigh, roots
from maniport.spd.matrix_functions import apply, from_vector, mandel_basis
from maniport.transfer.rigid_adapter import RigidMap
from maniport.transfer.rotation_group import orthonormal
from maniport.util.validation import Array

EQUAL = 1e-5  # relative gap of two eigenvalues up to which a divided difference is the derivative

LARGEST_STEP = 1.0  # of a parameter: logarithms of lengths [1], angles [rad]

MOST_DAMPING = 1e6  # relative; above, no step lowers the cost

Weighting = Callable[[Array], Array]  # weights of pairs from their distances, shapes (n,)


class Factors(NamedTuple):
    """A rigid map f(T) = B (W T Wᵀ)^s Bᵀ with any invertible W and B, shapes (d, d)."""

    left: Array
    ratio: float
    right: Array

    def rigid(self) -> RigidMap:
        """Return the same map with means and a rotation: T̄ = (Wᵀ W)⁻¹, S̄ = B Bᵀ."""
        teacher_mean = np.linalg.inv(self.left.T @ self.left)
        teacher_mean = 0.5 * (teacher_mean + teacher_mean.T)
        student_mean = self.right @ self.right.T
        student_mean = 0.5 * (student_mean + student_mean.T)

        # W = Q T̄^-½ and B Q = S̄^½ R
        turn = self.left @ roots(teacher_mean)[0]
        rotation = orthonormal(roots(student_mean)[1] @ self.right @ turn)
        return RigidMap(teacher_mean, student_mean, rotation, self.ratio)


class Residuals(NamedTuple):
    """Mandel vectors (n, D) of log(S^-½ f(T) S^-½), whose lengths are distances; derivatives (n, D, p)."""

    vectors: Array
    derivatives: Array

    @property
    def distances(self) -> Array:
        """Distances of the pairs, shape (n,)."""
        return np.asarray(np.linalg.norm(self.vectors, axis=1))


def fit_pairs(
    factors: Factors,
    teacher: Array,
    student: Array,
    weighting: Weighting,
    max_steps: int,
    tol: float = 1e-12,
) -> tuple[Factors, Array]:
    """Descend from `factors`; return the map and the distances of the pairs, shape (n,).

    Parameters
    ----------
    factors : Factors
    teacher, student : ndarray, shapes (n, d, d)
        Pairs T_i, S_i.
    weighting : callable
        Weights by distances, computed again before each step.
    max_steps : int
    tol : float
        Stop where no parameter changes by more.
    """
    whitening = roots(student)[1]
    residuals = residuals_of(factors, teacher, whitening)
    if residuals is None:
        return factors, np.full(len(teacher), np.inf)

    damping = 1e-3
    for _ in range(max_steps):
        weights = weighting(residuals.distances)
        hessian, gradient = _normal_equations(residuals, weights)
        cost = float(weights @ residuals.distances**2)
        found = None
        while damping < MOST_DAMPING:
            step = _damped_step(hessian, gradient, damping)
            following = _moved(factors, step)
            trial = residuals_of(following, teacher, whitening)
            if trial is not None and float(weights @ trial.distances**2) < cost:
                found = trial
                break
            damping *= 10.0
        if found is None:
            break
        factors = following
        residuals = found
        damping = max(0.1 * damping, 1e-12)
        if np.abs(step).max() < tol:
            break
    return factors, residuals.distances


def residuals_of(factors: Factors, teacher: Array, whitening: Array) -> Residuals | None:
    """Return residuals of pairs given S_i^-½, (n, d, d); None where rounding or overflow spoils them.

    The parameters are a symmetric A, W ← exp(−A/2) W, in Mandel coordinates; a matrix E, B ← B exp(E); and s.
    """
    d = teacher.shape[-1]
    centered, frames = eigh(congruence(factors.left, teacher))
    if not np.all(centered > 0.0):
        return None
    with np.errstate(over="ignore", under="ignore"):
        powers = centered**factors.ratio
    dilated = compose(powers, frames)
    outer = whitening @ factors.right
    if not np.all(np.isfinite(dilated)):
        return None
    values, axes = eigh(congruence(outer, dilated))
    if not np.all(values > 0.0):
        return None
    vectors = _mandel(compose(np.log(values), axes))

    # Changes of W: of the dilated ellipsoids by divided differences of x^s, in their eigenbasis
    frames_t = np.swapaxes(frames, 1, 2)
    symmetric = frames_t[:, None] @ mandel_basis(d) @ frames[:, None]
    sums = centered[:, :, None] + centered[:, None]
    power_slopes = _divided_differences(
        centered, powers, lambda x: factors.ratio * x ** (factors.ratio - 1.0)
    )
    of_left = -0.5 * (sums * power_slopes)[:, None] * symmetric

    # all changes in the eigenbasis of the residual
    to_axes = np.swapaxes(axes, 1, 2) @ outer
    from_frames = to_axes @ frames
    by_left = from_frames[:, None] @ of_left @ np.swapaxes(from_frames, 1, 2)[:, None]
    half = np.einsum("nai,njb->nijab", to_axes, dilated @ np.swapaxes(to_axes, 1, 2))
    half = half.reshape(len(teacher), d * d, d, d)
    by_right = half + np.swapaxes(half, 2, 3)
    by_ratio = compose(powers * np.log(centered), from_frames)[:, None]

    changes = np.concatenate([by_left, by_right, by_ratio], axis=1)
    slopes = _divided_differences(values, np.log(values), lambda x: 1.0 / x)
    turned = axes[:, None] @ (slopes[:, None] * changes) @ np.swapaxes(axes, 1, 2)[:, None]
    return Residuals(vectors, np.swapaxes(_mandel(turned), 1, 2))


def _divided_differences(
    values: Array, images: Array, derivative: Callable[[Array], Array]
) -> Array:
    """Return (g(λ_i) − g(λ_j)) / (λ_i − λ_j), and its limit for equal eigenvalues; shape (n, d, d)."""
    gaps = values[:, :, None] - values[:, None]
    middle = 0.5 * (values[:, :, None] + values[:, None])
    equal = np.abs(gaps) < EQUAL * middle
    quotients = (images[:, :, None] - images[:, None]) / np.where(equal, 1.0, gaps)
    return np.where(equal, derivative(middle), quotients)


def _mandel(matrices: Array) -> Array:
    """Mandel vectors of symmetric matrices, unchecked."""
    d = matrices.shape[-1]
    diagonal = np.arange(d)
    rows: NDArray[np.intp]
    rows, columns = np.triu_indices(d, 1)
    above = np.sqrt(2.0) * matrices[..., rows, columns]
    return np.concatenate([matrices[..., diagonal, diagonal], above], axis=-1)


def _normal_equations(residuals: Residuals, weights: Array) -> tuple[Array, Array]:
    """Weighted JᵀJ (p, p) and Jᵀr (p,)."""
    size = residuals.derivatives.shape[-1]
    jacobian = residuals.derivatives.reshape(-1, size)
    weighted = (residuals.derivatives * weights[:, None, None]).reshape(-1, size)
    return weighted.T @ jacobian, weighted.T @ residuals.vectors.ravel()


def _damped_step(hessian: Array, gradient: Array, damping: float) -> Array:
    """Return −(H + μ diag H)⁻¹ g, shortened to `LARGEST_STEP`."""
    # for s = 1 the teacher's mean is free: its part of the diagonal may vanish
    diagonal = hessian.diagonal() + 1e-9 * np.trace(hessian) + np.finfo(float).tiny
    step = -np.linalg.solve(hessian + damping * np.diag(diagonal), gradient)
    largest = float(np.abs(step).max())
    return np.asarray(step * (LARGEST_STEP / max(largest, LARGEST_STEP)))


def _moved(factors: Factors, step: Array) -> Factors:
    """Apply the step of all parameters; the dispersion stays positive."""
    d = len(factors.left)
    size = d * (d + 1) // 2
    inner = apply(-0.5 * from_vector(step[:size]), np.exp)
    outer = expm(step[size:-1].reshape(d, d))  # keeps the sign of the determinant
    ratio = factors.ratio * float(np.exp(step[-1] / factors.ratio))
    return Factors(inner @ factors.left, ratio, factors.right @ outer)
