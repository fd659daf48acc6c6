"""The rotation step: turn the teacher's ellipsoids onto their partners.

Minimizes F(R) = Σ w_i d²(S_i, R T_i Rᵀ) over SO(d) (Reithmeir et al. 2022, eq. 15) by saddle-free Newton with the exact
Hessian; `docs/method/icp.md` has the equations, (13) to (15).
"""

from dataclasses import dataclass

import numpy as np

from maniport.spd.kernels import congruence, eigh
from maniport.transfer.rotation_group import orthonormal, rotation_from_vector, rotation_planes
from maniport.util.jit import kernel
from maniport.util.validation import Array

NEAR = 1e-5  # Relative gap of two eigenvalues up to which a divided difference is taken for the derivative between them


@dataclass(frozen=True)
class RotationStep:
    """Result of the optimization of a rotation; `converged` where the gradient norm fell below the tolerance."""

    rotation: Array
    start_cost: float  # F at the start
    cost: float  # F at `rotation`
    gradient_norm: float
    n_iter: int
    converged: bool


@dataclass(frozen=True)
class _Iterate:
    rotation: Array
    cost: float
    gradient: Array
    hessian: Array

    @property
    def norm(self) -> float:
        return float(np.linalg.norm(self.gradient))


def cholesky_factors(points: Array) -> Array:
    """L and L⁻¹ of SPD matrices S = L Lᵀ (n, d, d), shape (2, n, d, d)."""
    factor = np.linalg.cholesky(points)
    return np.stack([factor, np.linalg.inv(factor)])


class RotationProblem:
    """Pairs S_i, T_i of SPD matrices, (n, d, d), whose second members are to be turned onto the first."""

    def __init__(self, student: Array, teacher: Array, weights: Array, factors: Array | None = None):
        self.student, self.teacher, self.weights = student, np.ascontiguousarray(teacher), weights
        self._factor, self._inverse = cholesky_factors(student) if factors is None else factors

    def cost(self, rotation: Array) -> float:
        """F(R), the weighted mean of squared distances."""
        values, _ = self._eigh(rotation, slice(None))
        return float(self.weights @ np.sum(np.log(values) ** 2, axis=-1))

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R, m = d (d − 1) / 2, at δ = 0."""
        d, planes = len(rotation), np.array(rotation_planes(len(rotation)))
        m = len(planes)
        cost, gradient, hessian = 0.0, np.zeros(m), np.zeros((m, m))
        block = max(1, 125_000 // (m * d * d))  # 1 MB an array stays in the processor's cache: twice as fast as 8 MB
        for first in range(0, len(self.weights), block):
            part = slice(first, first + block)
            values, vectors = self._eigh(rotation, part)
            logs, weights = np.log(values), self.weights[part]
            moves, weighted = np.empty((2, len(weights) * d * d, m))
            pairs = self._inverse[part], self._factor[part], weights
            _fill_moves(values, logs, vectors, *pairs, planes, moves, weighted, gradient)
            cost += float(weights @ np.sum(logs**2, axis=-1))
            hessian += weighted.T @ moves
        return cost, gradient, hessian

    def _eigh(self, rotation: Array, part: slice) -> tuple[Array, Array]:
        """Eigenvalues and -vectors of L⁻¹ R T Rᵀ L⁻ᵀ."""
        return eigh(congruence(self._inverse[part], congruence(rotation, self.teacher[part])))

    def minimize(self, start: Array, tol: float = 1e-9, max_iter: int = 100) -> RotationStep:
        """Descend from `start` until the gradient norm is at most `tol`, or rounding hides any gain."""
        now, steps = _Iterate(start, *self.derivatives(start)), 0
        first = now.cost
        while now.norm > tol and steps < max_iter:
            following = self._descend(now)
            if following is None:
                break
            now, steps = following, steps + 1
        return RotationStep(now.rotation, first, now.cost, now.norm, steps, now.norm <= tol)

    def _descend(self, now: _Iterate, armijo: float = 1e-4) -> _Iterate | None:
        """Take the first of the halved steps that lowers the cost enough; None when none does."""
        direction = _saddle_free_direction(now.gradient, now.hessian)
        slope = float(now.gradient @ direction)
        moved = orthonormal(rotation_from_vector(direction) @ now.rotation)
        full = _Iterate(moved, *self.derivatives(moved))
        if full.cost < now.cost + armijo * slope:
            return full
        # near the solution the cost no longer resolves the step, but the gradient does
        if full.cost <= now.cost * (1.0 + 1e-6) + 1e-14 and full.norm < 0.5 * now.norm:
            return full
        length = 0.5
        while length * -slope > np.finfo(np.float64).eps * now.cost and length > 1e-9:
            moved = orthonormal(rotation_from_vector(length * direction) @ now.rotation)
            if self.cost(moved) < now.cost + armijo * length * slope:
                return _Iterate(moved, *self.derivatives(moved))
            length /= 2
        return None


def _saddle_free_direction(gradient: Array, hessian: Array, max_step: float = 1.0) -> Array:
    """Return −|H|⁻¹ g, at most `max_step` [rad] long."""
    curvature, axes = np.linalg.eigh(hessian)
    size = np.abs(curvature)
    size = np.maximum(size, 1e-8 * max(size.max(), np.finfo(float).tiny))
    direction = -axes @ ((axes.T @ gradient) / size)
    length = float(np.linalg.norm(direction))
    return np.asarray(direction * min(1.0, max_step / length)) if length > 0 else direction


@kernel
def _fill_moves(  # type: ignore[no-untyped-def]
    values, logs, vectors, inverse, factor, weights, planes, moves, weighted, gradient
):
    """Add to the gradient; fill moves and weighted moves (n d², m), whose product is the Hessian."""
    n, d = values.shape
    left, right, row = np.empty((d, d)), np.empty((d, d)), 0
    for i in range(n):
        for x in range(d):
            for y in range(d):
                left[x, y], right[x, y] = 0.0, 0.0
                for k in range(d):
                    left[x, y] += vectors[i, k, x] * inverse[i, k, y]
                    right[x, y] += factor[i, x, k] * vectors[i, k, y]
        for x in range(d):
            for a in range(len(planes)):
                j, k = planes[a, 0], planes[a, 1]
                move = left[x, j] * right[k, x] - left[x, k] * right[j, x]
                gradient[a] += 4.0 * weights[i] * logs[i, x] * move
                moves[row, a], weighted[row, a] = move, 8.0 * weights[i] * move
            row += 1
            for y in range(x + 1, d):
                low, high, log_low, log_high = values[i, x], values[i, y], logs[i, x], logs[i, y]
                gap, middle = low - high, 0.5 * (low + high)
                if abs(gap) < NEAR * middle:  # there the logarithm of the middle is the middle of the logarithms
                    slope = 2.0 * (2.0 - (log_low + log_high)) / (middle * middle)
                else:
                    slope = 4.0 * (log_low / low - log_high / high) / gap
                first = weights[i] * (slope * high * high + 4.0 * log_low * high / low)
                second = weights[i] * (slope * low * low + 4.0 * log_high * low / high)
                mixed = weights[i] * (slope * low * high + 2.0 * (log_low + log_high))
                for a in range(len(planes)):
                    j, k = planes[a, 0], planes[a, 1]
                    upper = left[x, j] * right[k, y] - left[x, k] * right[j, y]
                    lower = left[y, j] * right[k, x] - left[y, k] * right[j, x]
                    moves[row, a], weighted[row, a] = upper, first * upper + mixed * lower
                    moves[row + 1, a], weighted[row + 1, a] = lower, second * lower + mixed * upper
                row += 2
