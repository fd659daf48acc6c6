"""Cost of the velocity and jerk of a trajectory, and of exceeding limits, which couples its waypoints."""

import numpy as np
from scipy.sparse import csr_array, diags_array

from maniport.util.validation import Array

LIMIT_WEIGHT = 30.0  # w_l [1/s]


class SmoothnessCost:
    """Cost ∫ λ_v |q̇|² + λ_j |q⃛|² + w_l Σ (|q̇| / limit − 1)² + w_l Σ (|q̈| / limit − 1)² dt at times (n,).

    The sums are over what exceeds the limits (dof,).
    """

    def __init__(
        self, time: Array, factors: tuple[float, float], limits: tuple[Array | float, Array | float]
    ):
        """Take λ_v [s²/rad²] and λ_j [s⁶/rad²], and limits (dof,) of |q̇| and |q̈|."""
        orders = ((factors[0], limits[0]), (0.0, limits[1]), (factors[1], np.inf))
        self._derivatives = []
        for order, (factor, limit) in enumerate(orders, start=1):
            if len(time) > order:
                self._derivatives.append((Differences(time, order), factor, limit))

    def add(self, q: Array, cost: float | Array, gradient: Array, band: Array) -> float | Array:
        """Add to costs, which are returned, half the gradient (n, ..., dof) and lower diagonals (4, n, ..., dof).

        The joints q (n, ..., dof) are of one trajectory, or of several in the middle axis.
        """
        for difference, smoothness, limit in self._derivatives:
            spans = difference.spans.reshape(-1, *[1] * (q.ndim - 1))
            value = difference.apply(difference.matrix, q)
            share = value / limit
            excess = np.sign(share) * np.maximum(np.abs(share) - 1.0, 0.0)
            square = spans * (smoothness * value**2 + LIMIT_WEIGHT * excess**2)
            cost = cost + square.sum(axis=(0, -1))
            slope = spans * (smoothness * value + LIMIT_WEIGHT * excess / limit)
            gradient += difference.apply(difference.matrix.T, slope)
            weights = spans * (smoothness + LIMIT_WEIGHT * (excess != 0.0) / limit**2)
            difference.add_normal(weights, band)
        return cost


class Differences:
    """The k-th derivative at uneven times as a banded matrix D of n − k rows."""

    def __init__(self, time: Array, order: int):
        count = len(time) - order
        at = np.stack([time[k : count + k] for k in range(order + 1)], axis=1)
        rows = np.tile(np.eye(order + 1), (count, 1, 1))
        for level in range(1, order + 1):
            gaps = at[:, level:] - at[:, : at.shape[1] - level]
            differences = rows[:, 1:] - rows[:, :-1]
            rows = level * differences / gaps[..., None]
        self.rows = rows[:, 0]
        self.spans = (at[:, -1] - at[:, 0]) / order
        self.matrix = diags_array(
            list(self.rows.T),
            offsets=range(order + 1),
            shape=(count, len(time)),
            format="csr",
        )

    @staticmethod
    def apply(matrix: csr_array, values: Array) -> Array:
        """Multiply the first axis of values (n, ..., dof) by a matrix (m, n)."""
        product = matrix @ values.reshape(len(values), -1)
        return np.asarray(product.reshape(-1, *values.shape[1:]))

    def add_normal(self, weights: Array, band: Array) -> None:
        """Add lower diagonals of Dᵀ W D to (k + 1, n, ..., dof); W is diagonal, `weights` (n − k, ..., dof)."""
        m, width = self.rows.shape
        for below in range(width):
            for k in range(width - below):
                product = self.rows[:, k] * self.rows[:, k + below]
                product = product.reshape(-1, *[1] * (weights.ndim - 1))
                band[below, k : m + k] += weights * product
