"""Cost of the distance from a reference configuration."""

from dataclasses import dataclass

import numpy as np

from maniport.util.validation import Array


@dataclass(frozen=True, eq=False)
class PostureCost:
    """Cost w (q − q_ref), the same at all times."""

    reference: Array  # q_ref, (dof,)
    weight: float  # w [1/rad or 1/m]

    def residual(self, q: Array, time: Array | None = None) -> Array:
        """Return residuals, shape (n, dof)."""
        return np.asarray(self.weight * (q - self.reference))

    def jacobian(self, q: Array, time: Array | None = None) -> Array:
        """Return their derivatives, shape (n, dof, dof)."""
        return np.broadcast_to(self.weight * np.eye(q.shape[1]), (*q.shape, q.shape[1]))
