"""The step on SO(d): turn the teacher's ellipsoids onto their partners.

Minimises F(R) = Σ w_i d²(S_i, R T_i Rᵀ) (Reithmeir et al. 2022, eq. 14) by saddle-free Newton with the exact Hessian.
With the generalised eigenbasis VᵀSV = I, VᵀXV = Λ of X = R T Rᵀ, the perturbation exp(Ω) R moves VᵀXV by
K Λ + Λ Kᵀ, K = VᵀΩV⁻ᵀ, so that derivatives of d² = Σ log² λ need only first divided differences.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import congruence
from maniport.transfer import so3
from maniport.transfer.icp.rotation_prior import RotationPrior
from maniport.transfer.icp.rotation_starts import signed_permutations, starts
from maniport.transfer.rotation_group import orthonormal, rotation_angle, rotation_basis, rotation_from_vector
from maniport.validation import Array

__all__ = [
    "RotationProblem",
    "RotationStep",
    "Whitening",
    "orthonormal",
    "rotation_angle",
    "rotation_basis",
    "rotation_from_vector",
    "signed_permutations",
    "starts",
]

ARMIJO = so3.ARMIJO
"""Share of the gain that the slope promises which a step must bring."""

MAX_STEP = so3.MAX_STEP
"""Longest step [rad]."""

BLOCK_BYTES = 64_000_000


@dataclass(frozen=True)
class RotationStep:
    """Where the optimisation of a rotation ended.

    Attributes
    ----------
    rotation : ndarray, shape (d, d)
    start_cost, cost : float
        F(R), the weighted mean of squared distances (and the prior, where there is one), where it started and at
        `rotation`.
    gradient_norm : float
    n_iter : int
    converged : bool
        Whether the gradient norm fell below the tolerance.
    """

    rotation: Array
    start_cost: float
    cost: float
    gradient_norm: float
    n_iter: int
    converged: bool


class Whitening:
    """Cholesky factors L of SPD matrices and their inverses, computed once and picked from.

    Attributes
    ----------
    points, factor, inverse : ndarray, shape (n, d, d)
        S = L Lᵀ, L and L⁻¹.
    """

    def __init__(self, points: Array):
        self.points = points
        self.factor = np.asarray(np.linalg.cholesky(points))
        self.inverse = np.asarray(np.linalg.inv(self.factor))

    def pick(self, index: Any) -> "Whitening":
        """Take some of the matrices, in the order of `index`."""
        return self._of(self.points[index], self.factor[index], self.inverse[index])

    def followed_by(self, other: "Whitening") -> "Whitening":
        """Put the matrices of another one behind these."""
        names = ("points", "factor", "inverse")
        return self._of(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    @staticmethod
    def _of(points: Array, factor: Array, inverse: Array) -> "Whitening":
        made = Whitening.__new__(Whitening)
        made.points, made.factor, made.inverse = points, factor, inverse
        return made


class RotationProblem:
    """Pairs of SPD matrices with weights, whose second members are to be turned onto the first.

    Parameters
    ----------
    student : ndarray, shape (n, d, d), or Whitening
        The first members S_i.
    teacher : ndarray, shape (n, d, d)
        The second members T_i.
    weights : ndarray, shape (n,)
        Non-negative, summing to one.
    prior : RotationPrior, optional
        Penalty that is added to the cost and to its derivatives.
    """

    def __init__(self, student: Array | Whitening, teacher: Array, weights: Array, prior: RotationPrior | None = None):
        self._white = student if isinstance(student, Whitening) else Whitening(student)
        self.teacher, self.weights = np.ascontiguousarray(teacher), weights
        self.student, self.prior = self._white.points, prior
        self._compiled = teacher.shape[-1] == 3

    def cost(self, rotation: Array) -> float:
        """F(R), the weighted mean of squared distances, and the prior."""
        if not self._compiled:
            return self.cost_numpy(rotation)
        pairs = float(so3.derivatives(*self._for_kernel(rotation), np.empty(3), np.empty((3, 3)), False))
        return pairs if self.prior is None else pairs + self.prior.cost(rotation)

    def cost_numpy(self, rotation: Array) -> float:
        """Same as `cost`, without the kernels for d = 3."""
        values, _ = eigh(congruence(self._white.inverse, congruence(rotation, self.teacher)))
        pairs = float(self.weights @ np.sum(np.log(values) ** 2, axis=-1))
        return pairs if self.prior is None else pairs + self.prior.cost(rotation)

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R, m = d (d − 1) / 2, at δ = 0."""
        if not self._compiled:
            return self.derivatives_numpy(rotation)
        gradient, hessian = np.empty(3), np.empty((3, 3))
        cost = float(so3.derivatives(*self._for_kernel(rotation), gradient, hessian, True))
        return self._with_prior(rotation, cost, gradient, hessian)

    def derivatives_numpy(self, rotation: Array) -> tuple[float, Array, Array]:
        """Same as `derivatives`, without the kernels for d = 3."""
        basis, white = rotation_basis(len(rotation)), self._white
        cost, gradient, hessian = 0.0, np.zeros(len(basis)), np.zeros((len(basis), len(basis)))
        block = max(1, BLOCK_BYTES // (8 * basis.size))
        for first in range(0, len(self.weights), block):
            part = slice(first, first + block)
            terms = _block_derivatives(
                white.points[part], white.inverse[part], self.teacher[part], self.weights[part], rotation, basis
            )
            cost, gradient, hessian = cost + terms[0], gradient + terms[1], hessian + terms[2]
        return self._with_prior(rotation, cost, gradient, hessian)

    def _with_prior(self, rotation: Array, cost: float, gradient: Array, hessian: Array) -> tuple[float, Array, Array]:
        if self.prior is None:
            return cost, gradient, hessian
        terms = self.prior.derivatives(rotation)
        return cost + terms[0], gradient + terms[1], hessian + terms[2]

    def _for_kernel(self, rotation: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Arrays in the memory layout that the kernels were compiled for, with a rotation that they may change."""
        own = np.array(rotation, dtype=np.float64, order="C")
        return self._white.factor, self._white.inverse, self.teacher, self.weights, own

    def minimize(self, start: Array, tol: float = 1e-9, max_iter: int = 100) -> RotationStep:
        """Descend from `start` until the gradient norm is at most `tol`, or rounding hides any gain.

        Every step solves |H| δ = −g, with the absolute value taken on the eigenvalues of H so that saddles repel
        (Dauphin et al. 2014), is at most one radian long, and is shortened until it meets Armijo's rule.
        """
        if self._compiled and self.prior is None:
            arrays = self._for_kernel(start)
            first, cost, norm, steps = so3.minimize(*arrays, tol, max_iter)
            return RotationStep(arrays[-1], float(first), float(cost), float(norm), int(steps), bool(norm <= tol))
        now, steps = _Iterate(start, *self.derivatives(start)), 0
        first = now.cost
        while now.norm > tol and steps < max_iter:
            following = self._descend(now)
            if following is None:
                break
            now, steps = following, steps + 1
        return RotationStep(now.rotation, first, now.cost, now.norm, steps, now.norm <= tol)

    def _descend(self, now: "_Iterate") -> "_Iterate | None":
        """Take the first of the halved steps that lowers the cost enough; None when none does."""
        direction = _saddle_free_direction(now.gradient, now.hessian)
        slope = float(now.gradient @ direction)
        moved = orthonormal(rotation_from_vector(direction) @ now.rotation)
        full = _Iterate(moved, *self.derivatives(moved))
        if full.cost < now.cost + ARMIJO * slope:
            return full
        # near the solution the cost no longer resolves the step, but the gradient does
        if full.cost <= now.cost * (1.0 + 1e-6) + 1e-14 and full.norm < 0.5 * now.norm:
            return full
        length = 0.5
        while length * -slope > np.finfo(np.float64).eps * now.cost and length > 1e-9:
            moved = orthonormal(rotation_from_vector(length * direction) @ now.rotation)
            if self.cost(moved) < now.cost + ARMIJO * length * slope:
                return _Iterate(moved, *self.derivatives(moved))
            length /= 2
        return None


@dataclass(frozen=True)
class _Iterate:
    rotation: Array
    cost: float
    gradient: Array
    hessian: Array

    @property
    def norm(self) -> float:
        return float(np.linalg.norm(self.gradient))


def _saddle_free_direction(gradient: Array, hessian: Array) -> Array:
    curvature, axes = np.linalg.eigh(hessian)
    size = np.abs(curvature)
    size = np.maximum(size, 1e-8 * max(size.max(), np.finfo(float).tiny))
    direction = -axes @ ((axes.T @ gradient) / size)
    length = float(np.linalg.norm(direction))
    return np.asarray(direction * min(1.0, MAX_STEP / length)) if length > 0 else direction


def _block_derivatives(
    student: Array, whitening: Array, teacher: Array, weights: Array, rotation: Array, basis: Array
) -> tuple[float, Array, Array]:
    values, vectors = eigh(congruence(whitening, congruence(rotation, teacher)))
    logs = np.log(values)
    generalized = np.swapaxes(whitening, -1, -2) @ vectors  # V, with V⁻ᵀ = S V
    # K, shape (n, m, d, d); stacks of small products keep BLAS from starting threads that cost more than they bring
    moves = np.swapaxes(generalized, -1, -2)[:, None] @ basis @ (student @ generalized)[:, None]
    cost = float(weights @ np.sum(logs**2, axis=-1))
    gradient = 4.0 * np.einsum("nj,najj->a", weights[:, None] * logs, moves)
    scaled = moves * values[:, None, None, :]
    first_order = scaled + np.swapaxes(scaled, -1, -2)
    slopes = weights[:, None, None] * _divided_differences(values, logs)
    hessian = _contract(slopes[:, None] * first_order, first_order)
    weighted = (weights[:, None] * logs)[:, None, :, None]
    products = _contract(weighted * moves, np.swapaxes(moves, -1, -2))
    stretches = _contract(weighted / values[:, None, :, None] * scaled, moves)
    hessian = hessian + 2.0 * (products + products.T) + 2.0 * (stretches + stretches.T)
    return cost, gradient, hessian


def _contract(left: Array, right: Array) -> Array:
    """Sum left[n, a, j, k] right[n, b, j, k] over n, j, k; shape (m, m)."""
    n, m = left.shape[:2]
    rows, columns = left.reshape(n, m, -1), right.reshape(n, m, -1)
    return np.asarray((rows @ np.swapaxes(columns, -1, -2)).sum(axis=0))


def _divided_differences(values: Array, logs: Array) -> Array:
    """Divided differences (f'(λ_j) − f'(λ_k)) / (λ_j − λ_k) of f' = 2 log λ / λ, shape (n, d, d)."""
    slope: Callable[[Array], Array] = lambda x: 2.0 * (1.0 - np.log(x)) / x**2  # noqa: E731
    derivative = 2.0 * logs / values
    gap = values[:, :, None] - values[:, None, :]
    middle = 0.5 * (values[:, :, None] + values[:, None, :])
    near = np.abs(gap) < 1e-5 * middle
    quotient = (derivative[:, :, None] - derivative[:, None, :]) / np.where(near, 1.0, gap)
    return np.where(near, slope(middle), quotient)
