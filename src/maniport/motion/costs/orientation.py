"""Cost of the orientation of an end effector."""

import math
from dataclasses import dataclass

import numpy as np

from maniport.motion.costs.position import PoseCost
from maniport.util.validation import Array, as_choice

POINTING, WHOLE = "pointing", "whole"
"""Which axes of the end effector's orientation count: z, mostly along a gripper's fingers, or all."""
ORIENTATION_WEIGHT = 10.0  # 6° have the same cost as a distance of 1 between ellipsoids [1/rad]


def axis_weights(keep: str) -> tuple[float, float, float]:
    """Weights of the angles between the axes of the end effector and their targets [1/rad]."""
    if as_choice(keep, "orientation_axes", (POINTING, WHOLE)) == POINTING:
        return 0.0, 0.0, ORIENTATION_WEIGHT
    return (ORIENTATION_WEIGHT / math.sqrt(2.0),) * 3


@dataclass(frozen=True, eq=False)
class OrientationCost(PoseCost):
    """Cost c_k (R(q) e_k − A e_k) of the axes k of an end effector, with target rotations A.

    With one axis the square is that of the angle between the two, to second order, with all three and c_k = c/√2 that
    of the rotation between them.
    """

    rotations: Array  # A, (n, 3, 3), in the base frame
    weights: tuple[float, float, float]  # c [1/rad]

    def at(self, poses: Array) -> Array:
        """As in `PoseCost`; r = 3 for each axis with a weight."""
        parts = [self.weights[k] * (poses[:, :3, k] - self.rotations[:, :, k]) for k in np.flatnonzero(self.weights)]
        return np.concatenate(parts, axis=1)

    def slopes(self, poses: Array, jacobian: Array) -> Array:
        """As in `PoseCost`."""
        parts = [
            -self.weights[k] * np.cross(poses[:, :3, k, None], jacobian[:, 3:], axis=1)
            for k in np.flatnonzero(self.weights)
        ]
        return np.concatenate(parts, axis=1)

    def angles(self, q: Array) -> Array:
        """Largest angle between an axis with a weight and its target, shape (n,) [rad]."""
        axes = np.flatnonzero(self.weights)
        chords = np.linalg.norm(self.arm.forward(q)[:, :3, axes] - self.rotations[:, :, axes], axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chords.max(axis=1), 1.0)))
