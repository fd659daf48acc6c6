"""Cost of the velocity and jerk of a trajectory, and of exceeding limits, which couples its waypoints."""

import numpy as np
from scipy.sparse import diags_array

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
        self._derivatives = [
            (Differences(time, k), *own) for k, own in enumerate(orders, 1) if len(time) > k
        ]

    def add(self, q: Array, cost: float, gradient: Array, band: Array) -> float:
        """Add to a cost, which is returned, half its gradient (n, dof) and lower diagonals (4, n, dof) of joints."""
        for difference, smoothness, limit in self._derivatives:
            value, spans = difference.matrix @ q, difference.spans
            share = value / limit
            excess = np.sign(share) * np.maximum(np.abs(share) - 1.0, 0.0)
            cost += float(np.sum(spans * (smoothness * value**2 + LIMIT_WEIGHT * excess**2)))
            gradient += difference.matrix.T @ (
                spans * (smoothness * value + LIMIT_WEIGHT * excess / limit)
            )
            difference.add_normal(
                spans * (smoothness + LIMIT_WEIGHT * (excess != 0.0) / limit**2), band
            )
        return cost


class Differences:
    """The k-th derivative at uneven times as a banded matrix D of n − k rows."""

    def __init__(self, time: Array, order: int):
        count = len(time) - order
        at = np.stack([time[k : count + k] for k in range(order + 1)], axis=1)
        rows = np.tile(np.eye(order + 1), (count, 1, 1))
        for level in range(1, order + 1):
            gap = at[:, level:] - at[:, : at.shape[1] - level]
            rows = level * (rows[:, 1:] - rows[:, :-1]) / gap[..., None]
        self.rows, self.spans = rows[:, 0], (at[:, -1:] - at[:, :1]) / order
        self.matrix = diags_array(
            list(self.rows.T), offsets=range(order + 1), shape=(count, len(time)), format="csr"
        )

    def add_normal(self, weights: Array, band: Array) -> None:
        """Add lower diagonals of Dᵀ W D of each joint to (k + 1, n, dof); W is diagonal, `weights` (n − k, dof)."""
        m, width = self.rows.shape
        for below in range(width):
            for k in range(width - below):
                band[below, k : m + k] += (
                    weights * (self.rows[:, k] * self.rows[:, k + below])[:, None]
                )
