"""The step on SO(d): turn the teacher's ellipsoids onto their partners, and the penalty that may hold it.

Minimises F(R) = Σ w_i d²(S_i, R T_i Rᵀ) (Reithmeir et al. 2022, eq. 15) by saddle-free Newton with the exact Hessian;
`docs/method.md`, section 4, has the derivation, (13) to (15).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np

from maniport.spd.kernels import WIDEST, eigh
from maniport.spd.matrix_functions import congruence
from maniport.transfer import so3
from maniport.transfer.rotation_group import orthonormal, rotation_basis, rotation_from_vector, rotation_planes
from maniport.transfer.so3 import ARMIJO, MAX_STEP
from maniport.validation import Array

BLOCK_BYTES = 1_000_000
"""Size of the derivatives' largest arrays: of 8 MB, which leave the processor's cache, they take twice as long."""


@dataclass(frozen=True)
class RotationStep:
    """Where the optimisation of a rotation ended, and what F(R) was where it started and is there.

    It has `converged` where the gradient norm fell below the tolerance.
    """

    rotation: Array
    start_cost: float
    cost: float
    gradient_norm: float
    n_iter: int
    converged: bool


@dataclass(frozen=True)
class RotationPrior:
    """P(R) = ½ w ‖R − R₀‖², which is w (d − tr(R R₀ᵀ)): w θ² for a small turn by θ, and 2 w (1 − cos θ) for any.

    The `weight` w is in squared distance per squared radian, `rotation` is R₀.
    """

    rotation: Array
    weight: float

    def cost(self, rotation: Array) -> float:
        """P(R); the squared difference keeps digits that d − tr would lose near R₀."""
        return float(0.5 * self.weight * np.sum((rotation - self.rotation) ** 2))

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R at δ = 0.

        Since exp(Ω) = I + Ω + ½ Ω² + …, they are −w tr(Ω_a Q) and −½ w tr((Ω_a Ω_b + Ω_b Ω_a) Q) with Q = R R₀ᵀ.
        """
        basis, turned = rotation_basis(len(rotation)), rotation @ self.rotation.T
        gradient = -self.weight * np.einsum("aij,ji->a", basis, turned)
        products = np.einsum("aij,bjk,ki->ab", basis, basis, turned)
        return self.cost(rotation), gradient, -0.5 * self.weight * (products + products.T)


class Whitening(NamedTuple):
    """SPD matrices S = L Lᵀ, L and L⁻¹, shape (3, n, d, d), computed once and picked from."""

    parts: Array

    @property
    def points(self) -> Array:
        """S, shape (n, d, d)."""
        return np.asarray(self.parts[0])

    @property
    def factor(self) -> Array:
        """L, shape (n, d, d)."""
        return np.asarray(self.parts[1])

    @property
    def inverse(self) -> Array:
        """L⁻¹, shape (n, d, d)."""
        return np.asarray(self.parts[2])

    @classmethod
    def of(cls, points: Array) -> Self:
        """Factorise SPD matrices."""
        factor = np.linalg.cholesky(points)
        return cls(np.stack([points, factor, np.linalg.inv(factor)]))

    def pick(self, index: Any) -> "Whitening":
        """Take some of the matrices, in the order of `index`."""
        return Whitening(np.take(self.parts, index, axis=1))


class RotationProblem:
    """Pairs S_i, T_i of SPD matrices, (n, d, d), whose second members are to be turned onto the first.

    The weights (n,) are not negative and sum to one. A prior is added to the cost and to its derivatives.
    """

    def __init__(self, student: Array | Whitening, teacher: Array, weights: Array, prior: RotationPrior | None = None):
        self._white = student if isinstance(student, Whitening) else Whitening.of(student)
        self.teacher, self.weights = np.ascontiguousarray(teacher), weights
        self.student, self.prior = self._white.points, prior
        self._compiled = teacher.shape[-1] == 3

    def cost(self, rotation: Array) -> float:
        """F(R), the weighted mean of squared distances, and the prior."""
        if self._compiled:
            pairs = float(so3.derivatives(*self._for_kernel(rotation), np.empty(3), np.empty((3, 3)), False, WIDEST))
        else:
            values, _ = eigh(congruence(self._white.inverse, congruence(rotation, self.teacher)))
            pairs = float(self.weights @ np.sum(np.log(values) ** 2, axis=-1))
        return pairs if self.prior is None else pairs + self.prior.cost(rotation)

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R, m = d (d − 1) / 2, at δ = 0."""
        if self._compiled:
            gradient, hessian = np.empty(3), np.empty((3, 3))
            cost = float(so3.derivatives(*self._for_kernel(rotation), gradient, hessian, True, WIDEST))
        else:
            cost, gradient, hessian = self._derivatives_in_blocks(rotation)
        if self.prior is None:
            return cost, gradient, hessian
        terms = self.prior.derivatives(rotation)
        return cost + terms[0], gradient + terms[1], hessian + terms[2]

    def _derivatives_in_blocks(self, rotation: Array) -> tuple[float, Array, Array]:
        white, m, d = self._white, len(rotation_planes(len(rotation))), len(rotation)
        cost, gradient, hessian = 0.0, np.zeros(m), np.zeros((m, m))
        block = max(1, BLOCK_BYTES // (8 * m * d * d))
        for first in range(0, len(self.weights), block):
            part = slice(first, first + block)
            pairs = white.points[part], white.inverse[part], self.teacher[part], self.weights[part]
            terms = _block_derivatives(*pairs, rotation)
            cost, gradient, hessian = cost + terms[0], gradient + terms[1], hessian + terms[2]
        return cost, gradient, hessian

    def _for_kernel(self, rotation: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Arrays in the memory layout that the kernels were compiled for, with a rotation that they may change."""
        own = np.array(rotation, dtype=np.float64, order="C")
        return self._white.factor, self._white.inverse, self.teacher, self.weights, own

    def minimize(self, start: Array, tol: float = 1e-9, max_iter: int = 100) -> RotationStep:
        """Descend from `start` until the gradient norm is at most `tol`, or rounding hides any gain."""
        if self._compiled and self.prior is None:
            arrays = self._for_kernel(start)
            first, cost, norm, steps = so3.minimize(*arrays, tol, max_iter, WIDEST)
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
    student: Array, whitening: Array, teacher: Array, weights: Array, rotation: Array
) -> tuple[float, Array, Array]:
    """Cost, gradient and Hessian of some pairs, entries K_xy and K_yx of the moves K_a = Vᵀ Ω_a V⁻ᵀ taken together."""
    values, vectors = eigh(congruence(whitening, congruence(rotation, teacher)))
    logs, d = np.log(values), len(rotation)
    generalized = np.swapaxes(whitening, -1, -2) @ vectors  # V, with V⁻ᵀ = S V
    j, k = np.array(rotation_planes(d)).T  # Ω_a = e_j e_kᵀ − e_k e_jᵀ
    left, right = np.swapaxes(generalized, -1, -2), np.swapaxes(student @ generalized, -1, -2)
    left_j, left_k, right_j, right_k = left[:, :, j], left[:, :, k], right[:, :, j], right[:, :, k]  # (n, d, m)

    def moves(x: Any, y: Any) -> Array:
        return np.asarray(left_j[:, x] * right_k[:, y] - left_k[:, x] * right_j[:, y])

    x, y = np.triu_indices(d, 1)
    stretches, upper, lower = moves(slice(None), slice(None)), moves(x, y), moves(y, x)
    cost = float(weights @ np.sum(logs**2, axis=-1))
    gradient = 4.0 * np.einsum("nx,nxa->a", weights[:, None] * logs, stretches)
    low, high, log_low, log_high = values[:, x], values[:, y], logs[:, x], logs[:, y]
    slope = 2.0 * _divided_differences(low, high, log_low, log_high)
    own = slope * high**2 + 4.0 * log_low * high / low, slope * low**2 + 4.0 * log_high * low / high
    mixed = slope * low * high + 2.0 * (log_low + log_high)
    own_upper, own_lower, mixed = ((weights[:, None] * part)[:, :, None] for part in (*own, mixed))
    rows = np.concatenate([stretches, upper, lower], axis=1)
    weighted = np.concatenate(
        [
            8.0 * weights[:, None, None] * stretches,
            own_upper * upper + mixed * lower,
            own_lower * lower + mixed * upper,
        ],
        axis=1,
    )
    m = len(j)
    return cost, gradient, np.asarray(weighted.reshape(-1, m).T @ rows.reshape(-1, m))


def _divided_differences(low: Array, high: Array, log_low: Array, log_high: Array) -> Array:
    """Divided differences (f'(λ_x) − f'(λ_y)) / (λ_x − λ_y) of f' = 2 log λ / λ, shape as given."""
    gap, middle = low - high, 0.5 * (low + high)
    near = np.abs(gap) < 1e-5 * middle
    quotient = 2.0 * (log_low / low - log_high / high) / np.where(near, 1.0, gap)
    return np.where(near, 2.0 * (1.0 - np.log(middle)) / middle**2, quotient)
