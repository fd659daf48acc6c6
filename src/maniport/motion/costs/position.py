"""Costs of positions: of an end effector, and of two relative to one another."""

from dataclasses import dataclass, replace

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class PoseCost:
    """Cost of the pose of an end effector, with a target for each row of q."""

    arm: Arm

    def residual(self, q: Array, time: Array | None = None) -> Array:
        """Return residuals, shape (n, r)."""
        return self.at(self.arm.forward(q))

    def jacobian(self, q: Array, time: Array | None = None) -> Array:
        """Return their derivatives, shape (n, r, dof)."""
        return self.slopes(self.arm.forward(q), self.arm.jacobian(q))

    def at(self, poses: Array) -> Array:
        """Return residuals for poses (n, 4, 4) of the end effector."""
        raise NotImplementedError

    def slopes(self, poses: Array, jacobian: Array) -> Array:
        """Return the derivatives for poses and their Jacobians (n, 6, dof)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class PositionCost(PoseCost):
    """Cost w (p(q) − p) of the position p(q) of an end effector."""

    positions: Array  # p, (n, 3) [m]
    weight: float  # w [1/m]

    def at(self, poses: Array) -> Array:
        """As in `PoseCost`; r = 3."""
        return np.asarray(self.weight * (poses[:, :3, 3] - self.positions))

    def slopes(self, poses: Array, jacobian: Array) -> Array:
        """As in `PoseCost`."""
        return np.asarray(self.weight * jacobian[:, :3])


@dataclass(frozen=True, eq=False)
class RelativePositionCost:
    """Cost of the vector between the end effectors of two arms of a group: w (p_j − p_i − v(t)).

    Attributes
    ----------
    group : ArmGroup
    pair : tuple of two ints
        Indices i and j.
    time : ndarray, shape (n,)
        [s].
    vectors : ndarray, shape (n, 3)
        v at these times in the base frame, linear between them [m].
    position_weight : float
        Weight w [1/m].
    """

    group: ArmGroup
    pair: tuple[int, int]
    time: Array
    vectors: Array
    position_weight: float = 1000.0

    def weighing(self, position_weight: float) -> "RelativePositionCost":
        """Return the cost with another weight [1/m]."""
        return replace(self, position_weight=position_weight)

    def error(self, q: Array, time: Array) -> Array:
        """Return the relative position error, shape (m,) [m]."""
        return np.asarray(np.linalg.norm(self._offset(q, time), axis=1))

    def residual(self, q: Array, time: Array) -> Array:
        """Return weighted offsets, shape (m, 3)."""
        return self.position_weight * self._offset(q, time)

    def jacobian(self, q: Array, time: Array) -> Array:
        """Return their derivatives, shape (m, 3, dof)."""
        i, j = self.pair
        jacobians = self.group.jacobian(q)[:, :, :3]
        return np.asarray(self.position_weight * (jacobians[:, j] - jacobians[:, i]))

    def at(self, time: Array) -> Array:
        """Return the target vectors at times (m,), shape (m, 3) [m]."""
        return np.stack([np.interp(time, self.time, column) for column in self.vectors.T], axis=1)

    def _offset(self, q: Array, time: Array) -> Array:
        i, j = self.pair
        origins = self.group.forward(q)[:, :, :3, 3]
        return np.asarray(origins[:, j] - origins[:, i] - self.at(time))
