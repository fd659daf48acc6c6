"""Cost of the velocity and jerk of a trajectory, which couples its waypoints."""

import numpy as np

from maniport.util.validation import Array


class SmoothnessCost:
    """Cost ∫ λ_v |q̇|² + λ_j |q⃛|² dt of waypoints q (n, dof) at times (n,)."""

    def __init__(self, time: Array, dof: int, velocity_cost: float, jerk_cost: float):
        n = len(time)
        self.band = np.zeros((min(4, n), n, dof))  # lower diagonals of the Hessian of each joint
        for order, cost in ((1, velocity_cost), (3, jerk_cost)):
            if n > order:
                difference = Differences(time, order)
                weights = np.repeat(cost * difference.spans[:, None], dof, axis=1)
                self.band[: order + 1] += difference.normal(weights)

    def gradient(self, q: Array) -> Array:
        """Half the gradient, shape (n, dof); its product with q is the cost, which is quadratic."""
        smooth = self.band[0] * q
        for below in range(1, len(self.band)):
            line = self.band[below, : len(q) - below]
            smooth[below:] += line * q[:-below]
            smooth[:-below] += line * q[below:]
        return np.asarray(smooth)


class Differences:
    """The k-th derivative at uneven times as a banded matrix D of n − k rows."""

    def __init__(self, time: Array, order: int):
        count = len(time) - order
        at = np.stack([time[k : count + k] for k in range(order + 1)], axis=1)
        rows = np.tile(np.eye(order + 1), (count, 1, 1))
        for level in range(1, order + 1):
            gap = at[:, level:] - at[:, : at.shape[1] - level]
            rows = level * (rows[:, 1:] - rows[:, :-1]) / gap[..., None]
        self.order, self.rows, self.spans = order, rows[:, 0], (at[:, -1] - at[:, 0]) / order

    def __call__(self, values: Array) -> Array:
        """D applied to values (n, dof)."""
        m = len(self.rows)
        return np.asarray(sum(self.rows[:, k, None] * values[k : m + k] for k in range(self.order + 1)))

    def transposed(self, values: Array) -> Array:
        """Dᵀ applied to values (n − k, dof)."""
        m = len(self.rows)
        out = np.zeros((m + self.order, values.shape[1]))
        for k in range(self.order + 1):
            out[k : m + k] += self.rows[:, k, None] * values
        return out

    def normal(self, weights: Array) -> Array:
        """Lower diagonals of Dᵀ W D for each joint, shape (k + 1, n, dof); W is diagonal, `weights` (n − k, dof)."""
        m = len(self.rows)
        band = np.zeros((self.order + 1, m + self.order, weights.shape[1]))
        for below in range(self.order + 1):
            for k in range(self.order + 1 - below):
                band[below, k : m + k] += weights * (self.rows[:, k] * self.rows[:, k + below])[:, None]
        return band
