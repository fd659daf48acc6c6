"""Joint torques of motions, by Pinocchio's recursive Newton-Euler algorithm."""

import numpy as np
import pinocchio as pin

from maniport.arms import Arm, ArmGroup
from maniport.motion.arm_model import robot_model
from maniport.util.validation import Array


class InverseDynamics:
    """Torques of an arm or a group of arms with masses."""

    def __init__(self, arm: Arm | ArmGroup):
        self.arm, self._model = arm, robot_model(arm)
        self._data = self._model.createData()

    def __reduce__(self) -> tuple[type["InverseDynamics"], tuple[Arm | ArmGroup]]:
        return type(self), (self.arm,)

    def torques(self, q: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques H q̈ + C q̇ + g at n states, each of shape (n, dof); the result is [N m] or [N]."""
        result = np.empty(q.shape)
        for row, state in enumerate(zip(q, velocities, accelerations, strict=True)):
            result[row] = pin.rnea(self._model, self._data, *state)
        return result

    def along(self, q: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
        """Return a, b and g (n, dof) of the torques a u + b x + g on a path with derivatives `first` and `second`.

        u is the acceleration and x the squared speed of the path's parameter.
        """
        still = np.zeros(q.shape)
        gravity = self.torques(q, still, still)
        return self.torques(q, still, first) - gravity, self.torques(q, first, second) - gravity, gravity
