"""The line about which many arms turn as a whole."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.validation import Array


@dataclass(frozen=True)
class Axis:
    """A line that stays where it is, about which the first joint turns the whole arm.

    Attributes
    ----------
    frame : ndarray, shape (3, 3)
        Rows: two directions across the line and the one along it.
    origin : ndarray, shape (3,)
        The line's point next to the base [m].
    """

    frame: Array
    origin: Array

    @classmethod
    def of(cls, jacobian: Array, tips: Array) -> "Axis | None":
        """Read it off the first columns of Jacobians (n, 6, dof) and the tips there (n, 3)."""
        direction = jacobian[:, 3:, 0]
        moment = jacobian[:, :3, 0] - np.cross(direction, tips)
        turns = abs(np.linalg.norm(direction[0]) - 1.0) < 1e-9
        if not turns or np.ptp(direction, axis=0).max() > 1e-9 or np.ptp(moment, axis=0).max() > 1e-9:
            return None
        across = np.linalg.svd(direction[:1])[2][1:]
        across[1] = np.cross(direction[0], across[0])
        return cls(np.vstack([across, direction[0]]), np.cross(direction[0], moment[0]))

    def cylindrical(self, points: Array) -> tuple[Array, Array]:
        """Distance from the line and position along it (..., 2) [m], and angle about it (...) [rad]."""
        local = (points - self.origin) @ self.frame.T
        radius = np.hypot(local[..., 0], local[..., 1])
        return np.stack([radius, local[..., 2]], axis=-1), np.arctan2(local[..., 1], local[..., 0])

    def turns(self, angles: Array) -> Array:
        """Rotations about the line, shape (..., 3, 3)."""
        vectors = angles[..., None] * self.frame[2]
        return np.asarray(Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*angles.shape, 3, 3))
