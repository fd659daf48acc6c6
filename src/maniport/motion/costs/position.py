"""Costs of positions: of an end effector, and of two relative to one another."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class PositionCost:
    """Cost w (p(q) − p) of the position p(q) of an end effector; p has a row for each of q, or one for all."""

    arm: Arm
    positions: Array  # p, (n, 3) [m]
    weight: float  # w [1/m]

    def residual(self, q: Array, time: Array | None = None, poses: Array | None = None) -> Array:
        """Return weighted offsets, shape (n, 3)."""
        poses = self.arm.forward(q) if poses is None else poses
        return np.asarray(self.weight * (poses[:, :3, 3] - self.positions))

    def jacobian(
        self, q: Array, time: Array | None = None, motion: tuple[Array, Array] | None = None
    ) -> Array:
        """Return their derivatives, shape (n, 3, dof)."""
        return np.asarray(self.weight * (motion or self.arm.motion(q))[1][:, :3])


@dataclass(frozen=True, eq=False)
class RelativePositionCost:
    """Cost w (p_j − p_i − v(t)) of the vector between the end effectors of two arms of a group; a `ToleranceCost`."""

    group: ArmGroup
    pair: tuple[int, int]  # i and j
    time: Array  # (n,) [s]
    vectors: Array  # v at these times in the base frame, linear between them (n, 3) [m]
    position_weight: float = 1000.0  # w [1/m]

    def weighing(self, position_weight: float) -> "RelativePositionCost":
        """Return the cost with another weight [1/m]."""
        return replace(self, position_weight=position_weight)

    def error(self, q: Array, time: Array) -> Array:
        """Return the relative position error, shape (m,) [m]."""
        return np.asarray(np.linalg.norm(self.residual(q, time), axis=1) / self.position_weight)

    def residual(self, q: Array, time: Array) -> Array:
        """Return weighted offsets, shape (m, 3)."""
        i, j = self.pair
        origins = self.group.forward(q)[:, :, :3, 3]
        return np.asarray(self.position_weight * (origins[:, j] - origins[:, i] - self.at(time)))

    def jacobian(self, q: Array, time: Array) -> Array:
        """Return their derivatives, shape (m, 3, dof)."""
        i, j = self.pair
        jacobians = self.group.jacobian(q)[:, :, :3]
        return np.asarray(self.position_weight * (jacobians[:, j] - jacobians[:, i]))

    def at(self, time: Array) -> Array:
        """Return the target vectors at times (m,), shape (m, 3) [m]."""
        return np.stack([np.interp(time, self.time, column) for column in self.vectors.T], axis=1)
