"""Cost of the orientation of an end effector."""

import math
from dataclasses import dataclass

import numpy as np

from maniport.motion.configurations import Configurations
from maniport.util.validation import Array, Rows, as_choice

ORIENTATION_WEIGHT = 10.0  # 6° have the same cost as a distance of 1 between ellipsoids [1/rad]


def axis_weights(axes: str) -> tuple[float, float, float]:
    """Weights of the angles between the axes of the end effector and their targets [1/rad]."""
    if as_choice(axes, "orientation_axes", ("pointing", "whole")) == "pointing":
        return 0.0, 0.0, ORIENTATION_WEIGHT
    return (ORIENTATION_WEIGHT / math.sqrt(2.0),) * 3


@dataclass(frozen=True, eq=False)
class OrientationCost:
    """Cost c_k (R(q) e_k − A_R e_k) of the axes k of an end effector.

    With one axis the square is that of the angle between the two, to second order, with all three and c_k = c/√2 that
    of the rotation between them.
    """

    rotations: Array  # A_R, (n, 3, 3), in the base frame, or one for all
    weights: tuple[float, float, float]  # c [1/rad], not all 0

    def __getitem__(self, rows: Rows) -> "OrientationCost":
        return OrientationCost(self.rotations[rows], self.weights)

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, r), with r = 3 for each axis with a weight."""
        offsets = []
        for axis in np.flatnonzero(self.weights):
            offset = at.poses[:, :3, axis] - self.rotations[:, :, axis]
            offsets.append(self.weights[axis] * offset)
        return np.hstack(offsets)

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, r, dof)."""
        turns = at.jacobians[:, 3:]
        rows = []
        for axis in np.flatnonzero(self.weights):
            change = np.cross(at.poses[:, :3, axis, None], turns, axis=1)
            rows.append(-self.weights[axis] * change)
        return np.hstack(rows)

    def error(self, at: Configurations) -> Array:
        """Largest angle between an axis with a weight and its target, shape (n,) [rad]."""
        offsets = at.poses[:, :3, :3] - self.rotations
        chords = np.linalg.norm(offsets[:, :, np.flatnonzero(self.weights)], axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chords.max(axis=1), 1.0)))
