"""Costs of positions: of an end effector, and of two relative to one another."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.motion.configurations import Configurations
from maniport.util.validation import Array, Rows


@dataclass(frozen=True, eq=False)
class PositionCost:
    """Cost w (p(q) − p) of the position p(q) of an end effector; p has a row for each of q, or one for all."""

    positions: Array  # p, (n, 3) [m]
    weight: float  # w [1/m]

    def __getitem__(self, rows: Rows) -> "PositionCost":
        return PositionCost(self.positions[rows], self.weight)

    def with_weight(self, weight: float) -> "PositionCost":
        """Return the cost with another weight [1/m]."""
        return replace(self, weight=weight)

    def error(self, at: Configurations) -> Array:
        """Return the position error, shape (n,) [m]."""
        return np.asarray(np.linalg.norm(at.poses[:, :3, 3] - self.positions, axis=1))

    def residual(self, at: Configurations) -> Array:
        """Return weighted offsets, shape (n, 3)."""
        return np.asarray(self.weight * (at.poses[:, :3, 3] - self.positions))

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, 3, dof)."""
        return np.asarray(self.weight * at.jacobians[:, :3])


@dataclass(frozen=True, eq=False)
class RelativePositionCost:
    """Cost w (p_j − p_i − v(t)) of the vector between the end effectors of two arms of a group."""

    pair: tuple[int, int]  # i and j
    time: Array  # (n,) [s]
    vectors: Array  # v at these times in the base frame, linear between them (n, 3) [m]
    weight: float = 1000.0  # w [1/m]

    def with_weight(self, weight: float) -> "RelativePositionCost":
        """Return the cost with another weight [1/m]."""
        return replace(self, weight=weight)

    def error(self, at: Configurations) -> Array:
        """Return the relative position error, shape (n,) [m]."""
        return np.asarray(np.linalg.norm(self.residual(at), axis=1) / self.weight)

    def residual(self, at: Configurations) -> Array:
        """Return weighted offsets, shape (n, 3)."""
        i, j = self.pair
        origins = at.poses[:, :, :3, 3]
        return np.asarray(self.weight * (origins[:, j] - origins[:, i] - self.vectors_at(at.time)))

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, 3, dof)."""
        i, j = self.pair
        jacobians = at.jacobians[:, :, :3]
        return np.asarray(self.weight * (jacobians[:, j] - jacobians[:, i]))

    def vectors_at(self, time: Array) -> Array:
        """Return the target vectors at times (m,), shape (m, 3) [m]."""
        return np.stack([np.interp(time, self.time, column) for column in self.vectors.T], axis=1)
