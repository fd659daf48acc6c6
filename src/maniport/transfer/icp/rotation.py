"""The rotation step: turn the teacher's ellipsoids onto their partners.

Minimizes F(R) = Σ w_i d²(S_i, R T_i Rᵀ) over SO(d) (Reithmeir et al. 2022, eq. 15) by saddle-free Newton with the exact
Hessian; `docs/method/icp.md` has the equations, (13) to (15).
"""

from dataclasses import dataclass

import numpy as np

from maniport.spd.kernels.loops import WIDTH, diagonalize
from maniport.transfer.rotation_group import orthonormal, rotation_from_vector, rotation_planes
from maniport.util.jit import kernel, part
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


def cholesky_factors(points: Array) -> Array:
    """L and L⁻¹ of SPD matrices S = L Lᵀ (n, d, d), shape (2, n, d, d)."""
    factor = np.linalg.cholesky(points)
    return np.stack([factor, np.linalg.inv(factor)])


class RotationProblem:
    """Pairs S_i, T_i of SPD matrices, (n, d, d), whose second members are to be turned onto the first.

    `factors` are those of S_i, see `cholesky_factors`.
    """

    def __init__(self, factors: Array, teacher: Array, weights: Array):
        self._pairs = tuple(map(np.ascontiguousarray, (factors[0], factors[1], teacher, weights)))
        self._planes = np.array(rotation_planes(teacher.shape[-1]))

    def cost(self, rotation: Array) -> float:
        """F(R), the weighted mean of squared distances."""
        nothing = np.empty((0, 0))
        return float(_add_derivatives(rotation, *self._pairs, self._planes[:0], nothing[0:0].ravel(), nothing))

    def derivatives(self, rotation: Array) -> tuple[float, Array, Array]:
        """Cost, gradient (m,) and Hessian (m, m) for R ← exp(Σ δ_a Ω_a) R, m = d (d − 1) / 2, at δ = 0."""
        m = len(self._planes)
        gradient, hessian = np.zeros(m), np.zeros((m, m))
        cost = _add_derivatives(np.ascontiguousarray(rotation), *self._pairs, self._planes, gradient, hessian)
        return float(cost), gradient, hessian

    def minimize(self, start: Array, tol: float = 1e-9, max_iter: int = 100, armijo: float = 1e-4) -> RotationStep:
        """Descend from `start` until the gradient norm is at most `tol`, or rounding hides any gain."""
        rotation, steps = start, 0
        cost, gradient, hessian = self.derivatives(start)
        start_cost, norm = cost, float(np.linalg.norm(gradient))
        while norm > tol and steps < max_iter:
            direction, length = _saddle_free_direction(gradient, hessian), 1.0
            slope = float(gradient @ direction)
            moved = rotation_from_vector(direction) @ rotation
            following = self.derivatives(moved)
            # near the solution the cost no longer resolves the step, but the gradient does
            resolved = following[0] <= cost * (1.0 + 1e-6) + 1e-14 and np.linalg.norm(following[1]) < 0.5 * norm
            lower = resolved or following[0] < cost + armijo * slope
            while not lower and length * -slope > 2.0 * np.finfo(np.float64).eps * cost and length > 1e-9:
                length /= 2.0
                moved = rotation_from_vector(length * direction) @ rotation
                lower = self.cost(moved) < cost + armijo * length * slope
            if not lower:
                break
            rotation, steps = moved, steps + 1
            cost, gradient, hessian = following if length == 1.0 else self.derivatives(moved)
            norm = float(np.linalg.norm(gradient))
        return RotationStep(orthonormal(rotation), start_cost, cost, norm, steps, norm <= tol)


def _saddle_free_direction(gradient: Array, hessian: Array, max_step: float = 1.0) -> Array:
    """Return −|H|⁻¹ g, at most `max_step` [rad] long."""
    curvature, axes = np.linalg.eigh(hessian)
    size = np.abs(curvature)
    size = np.maximum(size, 1e-8 * max(size.max(), np.finfo(float).tiny))
    direction = -axes @ ((axes.T @ gradient) / size)
    length = float(np.linalg.norm(direction))
    return np.asarray(direction * min(1.0, max_step / length)) if length > 0 else direction


@kernel
def _add_derivatives(  # type: ignore[no-untyped-def]
    rotation, factor, inverse, teacher, weights, planes, gradient, hessian
):
    """Return the cost, and add to gradient and Hessian; the innermost loops run over the pairs of a block.

    With L⁻¹ R T Rᵀ L⁻ᵀ = V diag(λ) Vᵀ, the basis element Ω_a moves the pair by Vᵀ L⁻¹ Ω_a L V.
    """
    count, d = teacher.shape[:2]
    m, width, cost = len(planes), min(WIDTH, count), 0.0
    g, a, v = np.empty((d, d, width)), np.empty((d, d, width)), np.empty((d, d, width))
    left, right, logs = np.empty((d, d, width)), np.empty((d, d, width)), np.empty((d, width))
    weight, terms = np.empty(width), np.empty((3, width))
    moves, weighted = np.empty((m, width)), np.empty((m, width))
    reverse, reverse_weighted = np.empty((m, width)), np.empty((m, width))
    for start in range(0, count, width):
        for w in range(width):
            weight[w] = weights[start + w] if start + w < count else 0.0
        for i in range(d):
            for j in range(d):
                for w in range(width):
                    row, total = min(start + w, count - 1), 0.0
                    for k in range(d):
                        total += inverse[row, i, k] * rotation[k, j]
                    g[i, j, w] = total
        for i in range(d):
            for j in range(d):
                for w in range(width):
                    row, total = min(start + w, count - 1), 0.0
                    for k in range(d):
                        total += g[i, k, w] * teacher[row, k, j]
                    left[i, j, w] = total
        _multiply_transposed(left, g, a)
        diagonalize(a, v, terms[:2])
        for x in range(d):
            for w in range(width):
                logs[x, w] = np.log(a[x, x, w])
                cost += weight[w] * logs[x, w] * logs[x, w]
        if m == 0:
            continue
        for x in range(d):
            for y in range(d):
                for w in range(width):
                    row, first, second = min(start + w, count - 1), 0.0, 0.0
                    for k in range(d):
                        first += v[k, x, w] * inverse[row, k, y]
                        second += factor[row, x, k] * v[k, y, w]
                    left[x, y, w], right[x, y, w] = first, second
        for x in range(d):
            _fill_moves(left, right, planes, x, x, moves)
            for b in range(m):
                for w in range(width):
                    weighted[b, w] = 8.0 * weight[w] * moves[b, w]
                    gradient[b] += 4.0 * weight[w] * logs[x, w] * moves[b, w]
            _add_products(weighted, moves, hessian)
            for y in range(x + 1, d):
                for w in range(width):
                    low, high, log_low, log_high = a[x, x, w], a[y, y, w], logs[x, w], logs[y, w]
                    gap, middle = low - high, 0.5 * (low + high)
                    near = abs(gap) < NEAR * middle
                    slope = 4.0 * (log_low / low - log_high / high) / (1.0 if near else gap)
                    if near:  # there the logarithm of the middle is the middle of the logarithms
                        slope = 2.0 * (2.0 - (log_low + log_high)) / (middle * middle)
                    terms[0, w] = weight[w] * (slope * high * high + 4.0 * log_low * high / low)
                    terms[1, w] = weight[w] * (slope * low * low + 4.0 * log_high * low / high)
                    terms[2, w] = weight[w] * (slope * low * high + 2.0 * (log_low + log_high))
                _fill_moves(left, right, planes, x, y, moves)
                _fill_moves(left, right, planes, y, x, reverse)
                for b in range(m):
                    for w in range(width):
                        weighted[b, w] = terms[0, w] * moves[b, w] + terms[2, w] * reverse[b, w]
                        reverse_weighted[b, w] = terms[1, w] * reverse[b, w] + terms[2, w] * moves[b, w]
                _add_products(weighted, moves, hessian)
                _add_products(reverse_weighted, reverse, hessian)
    return cost


@part
def _multiply_transposed(left, right, result):  # type: ignore[no-untyped-def]
    """Fill the upper triangle of L Rᵀ, and its mirror image."""
    d, width = left.shape[1:]
    for i in range(d):
        for j in range(i, d):
            result[i, j] = 0.0
            for k in range(d):
                for w in range(width):
                    result[i, j, w] += left[i, k, w] * right[j, k, w]
            for w in range(width):
                result[j, i, w] = result[i, j, w]


@part
def _fill_moves(left, right, planes, x, y, moves):  # type: ignore[no-untyped-def]
    """Entry (x, y) of L⁻¹ Ω_a L in the eigenvectors, for every plane a."""
    for a in range(len(planes)):
        j, k = planes[a, 0], planes[a, 1]
        for w in range(moves.shape[1]):
            moves[a, w] = left[x, j, w] * right[k, y, w] - left[x, k, w] * right[j, y, w]


@part(fastmath=True)
def _add_products(weighted, moves, hessian):  # type: ignore[no-untyped-def]
    for a in range(len(hessian)):
        for b in range(len(hessian)):
            total = 0.0
            for w in range(moves.shape[1]):
                total += weighted[a, w] * moves[b, w]
            hessian[a, b] += total
