"""The rotation step: turn the teacher's ellipsoids onto their partners.

Minimizes F(R) = Σ w_i d²(S_i, R T_i Rᵀ) over SO(d) (Reithmeir et al. 2022, eq. 15) by saddle-free Newton with the exact
Hessian; `docs/method/icp.md` has the equations, (13) to (15).
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from maniport.spd.kernels import congruence, eigh
from maniport.spd.kernels.single import multiply
from maniport.transfer.rotation_group import orthonormal, rotation_from_vector, rotation_planes
from maniport.util.jit import kernel
from maniport.util.validation import Array

NEAR = 1e-5  # Relative gap of two eigenvalues up to which a divided difference is taken for the derivative between them


class RotationProblem:
    """Pairs S_i, T_i of SPD matrices, (n, d, d), whose second members are to be turned onto the first.

    `factors` are L and L⁻¹ of S_i = L Lᵀ, each (n, d, d).
    """

    def __init__(self, factors: Iterable[Array], teacher: Array, weights: Array):
        left, right = factors
        self._factor = np.ascontiguousarray(left)
        self._inverse = np.ascontiguousarray(right)
        self._teacher = np.ascontiguousarray(teacher)
        self._weights = np.ascontiguousarray(weights)
        self._planes = np.array(rotation_planes(teacher.shape[-1]))

    def cost(self, rotation: Array) -> float:
        """F(R), the weighted mean of squared distances."""
        nothing = np.empty(0)
        return self._add(rotation, self._planes[:0], nothing, nothing[None])

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R, m = d (d − 1) / 2, at δ = 0."""
        m = len(self._planes)
        gradient = np.zeros(m)
        hessian = np.zeros((m, m))
        cost = self._add(rotation, self._planes, gradient, hessian)
        return cost, gradient, hessian

    def _add(self, rotation: Array, planes: Array, gradient: Array, hessian: Array) -> float:
        """Return the cost, and add derivatives in planes of rotation to gradient and Hessian."""
        turned = congruence(rotation[None], self._teacher)
        values, vectors = eigh(congruence(self._inverse, turned))
        pairs = (self._factor, self._inverse, self._weights)
        cost = _add_derivatives(values, vectors, *pairs, planes, gradient, hessian)
        return float(cost)

    def minimize(
        self, start: Array, tol: float = 1e-9, max_iter: int = 100, armijo: float = 1e-4
    ) -> Array:
        """Descend from `start` until the gradient norm is at most `tol`, or rounding hides any gain."""
        rotation = start
        steps = 0
        cost, gradient, hessian = self.derivatives(start)
        norm = float(np.linalg.norm(gradient))
        while norm > tol and steps < max_iter:
            direction = _saddle_free_direction(gradient, hessian)
            length = 1.0
            slope = float(gradient @ direction)
            moved = rotation_from_vector(direction) @ rotation
            following = self.derivatives(moved)
            # near the solution the cost no longer resolves the step, but the gradient does
            resolved = (
                following[0] <= cost * (1.0 + 1e-6) + 1e-14
                and np.linalg.norm(following[1]) < 0.5 * norm
            )
            lower = resolved or following[0] < cost + armijo * slope
            while (
                not lower
                and length * -slope > 2.0 * np.finfo(np.float64).eps * cost
                and length > 1e-9
            ):
                length /= 2.0
                moved = rotation_from_vector(length * direction) @ rotation
                lower = self.cost(moved) < cost + armijo * length * slope
            if not lower:
                break
            rotation = moved
            steps = steps + 1
            if length == 1.0:
                cost, gradient, hessian = following
            else:
                cost, gradient, hessian = self.derivatives(moved)
            norm = float(np.linalg.norm(gradient))
        return orthonormal(rotation)


def _saddle_free_direction(gradient: Array, hessian: Array, max_step: float = 1.0) -> Array:
    """Return −|H|⁻¹ g, at most `max_step` [rad] long."""
    curvature, axes = np.linalg.eigh(hessian)
    size = np.abs(curvature)
    size = np.maximum(size, 1e-8 * max(size.max(), np.finfo(float).tiny))
    direction = -axes @ ((axes.T @ gradient) / size)
    length = float(np.linalg.norm(direction))
    if length > 0:
        direction = direction * min(1.0, max_step / length)
    return np.asarray(direction)


@kernel
def _add_derivatives(
    values: Array,
    vectors: Array,
    factor: Array,
    inverse: Array,
    weights: Array,
    planes: NDArray[np.intp],
    gradient: Array,
    hessian: Array,
) -> float:
    """Return the cost, and add to gradient and Hessian.

    With L⁻¹ R T Rᵀ L⁻ᵀ = V diag(λ) Vᵀ, the basis element Ω_a moves the pair by Vᵀ L⁻¹ Ω_a L V.
    """
    count, d = values.shape
    m = len(planes)
    cost = 0.0
    logs = np.log(values)
    rates = logs / values
    for pair in range(count):
        for x in range(d):
            cost += weights[pair] * logs[pair, x] ** 2
    if m == 0:
        return cost
    left = np.empty((d, d))
    right = np.empty((d, d))
    moves = np.empty((m, d, d))
    for pair in range(count):
        multiply(vectors[pair].T, inverse[pair], left)
        multiply(factor[pair], vectors[pair], right)
        for k in range(m):
            i, j = planes[k]
            for x in range(d):
                for y in range(d):
                    moves[k, x, y] = left[x, i] * right[j, y] - left[x, j] * right[i, y]
        for x in range(d):
            low = values[pair, x]
            log_low = logs[pair, x]
            weight = weights[pair]
            for k in range(m):
                gradient[k] += 4.0 * weight * log_low * moves[k, x, x]
            for y in range(d):
                high = values[pair, y]
                log_high = logs[pair, y]
                gap = low - high
                middle = 0.5 * (low + high)
                # near each other, the logarithm of the middle is the middle of the logarithms
                if abs(gap) < NEAR * middle:
                    slope = 2.0 * (2.0 - (log_low + log_high)) / (middle * middle)
                else:
                    slope = 4.0 * (rates[pair, x] - rates[pair, y]) / gap
                direct = weight * (slope * high * high + 4.0 * rates[pair, x] * high)
                mixed = weight * (slope * low * high + 2.0 * (log_low + log_high))
                for k in range(m):
                    change = direct * moves[k, x, y] + mixed * moves[k, y, x]
                    for j in range(m):
                        hessian[j, k] += moves[j, x, y] * change
    return cost
