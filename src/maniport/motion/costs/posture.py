"""Cost of the distance from a reference configuration."""

from dataclasses import dataclass

import numpy as np

from maniport.motion.configurations import Configurations
from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class PostureCost:
    """Cost w (q − q_ref), the same at all times."""

    reference: Array  # q_ref, (dof,)
    weight: float  # w [1/rad or 1/m]

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, dof)."""
        return np.asarray(self.weight * (at.joint_positions - self.reference))

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, dof, dof)."""
        count, dof = at.joint_positions.shape
        return np.broadcast_to(self.weight * np.eye(dof), (count, dof, dof))
