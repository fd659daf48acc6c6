"""Directions of segments and joint axes relative to the trunk, the measurements to which an arm is fitted.

Only directions are compared, never positions: the position of the shoulder in the trunk is not measured, and the
recorded segment lengths change with the skin. The residual of a segment is ``u(q) - u``, a difference of unit vectors;
its length is the angle between them [rad] as long as that is small.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm
from maniport.arms.human import JOINTS
from maniport.arms.kernels import place_points
from maniport.arms.kinematics import PointKinematics, axis_of
from maniport.errors import InvalidInputError
from maniport.mocap.path_solver import BLOCK, parts_of
from maniport.util.jit import kernel, part
from maniport.util.validation import Array

SEGMENTS = {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "hand": ("wrist", "hand")}
"""Frames of the arm between which each segment runs; the roles of the recording have the same names."""

ELBOW = JOINTS.index("elbow_flexion")
TURN = JOINTS.index("pro_sup")
DEVIATION = JOINTS.index("deviation")
FLEXION = JOINTS.index("flexion")

AXES = {"elbow_axis": ELBOW, "wrist_axis": FLEXION}  # The joint with the axis of each pair of markers

AROUND = {"elbow_axis": "upper arm", "wrist_axis": "forearm"}
"""The segment that rotates about its own axis with each pair of markers."""

MARKED = {"right": 1.0, "left": -1.0}
"""Sign of the axes of elbow (medial to lateral) and wrist (ulnar to radial); a left arm is a mirror image."""

WEIGHTS = {"upper arm": 1.0, "forearm": 1.0, "hand": 0.2, "elbow_axis": 0.1, "wrist_axis": 0.1}
"""Weights of the residuals, inverse to the expected error of each direction.

A hand is measured over a fifth of a forearm's length. Markers of a joint are near its axis, not on it. Both
decide what upper arm and forearm leave open, and do not pull those two aside when the hand exceeds the model's limits.
"""


def require_human(arm: Arm) -> None:
    """Raise `InvalidInputError` unless an arm has the joints of a human arm, in their order, and its frames."""
    if arm.joint_names != JOINTS:
        raise InvalidInputError(
            f"fit_arm needs a person with the joints {', '.join(JOINTS)}, in this order; found of {arm.name!r}: "
            f"{', '.join(arm.joint_names)}"
        )
    missing = {frame for ends in SEGMENTS.values() for frame in ends} - set(arm.frames)
    if missing:
        raise InvalidInputError(
            f"fit_arm needs a person with the frames shoulder, elbow, wrist and hand; {arm.name!r} has no "
            f"{', '.join(sorted(missing))}"
        )


@dataclass(frozen=True)
class Directions:
    """Directions in the trunk frame, and the arm that shall have them."""

    arm: Arm
    names: tuple[str, ...]  # keys of `SEGMENTS`, then of `AXES`
    targets: Array  # unit vectors, shape (n, len(names), 3); nan where missing

    def take(self, frames: NDArray[np.intp] | slice) -> "Directions":
        """Keep some frames, in any order and repeated or not."""
        return Directions(self.arm, self.names, self.targets[frames])

    def model(self, q: Array) -> tuple[Array, Array]:
        """Return the directions of the arm, shape (n, k, 3), and their derivatives, shape (n, k, 3, dof)."""
        kinematics, (start, end) = self._kinematics[0], self._kinematics[1].T
        points, slopes = kinematics(q)
        vector, slope = points[:, end] - points[:, start], slopes[:, end] - slopes[:, start]
        length = np.linalg.norm(vector, axis=-1)[..., None]
        value = vector / length
        slope = (slope - value[..., None] * (value[..., None, :] @ slope)) / length[..., None]
        axes = slice(len(self._kinematics[2]), None)
        return np.concatenate([value, points[:, axes]], axis=1), np.concatenate([slope, slopes[:, axes]], axis=1)

    @cached_property
    def _kinematics(self) -> tuple[PointKinematics, NDArray[np.int64], list[str]]:
        """Return frames at the ends of segments, then joint axes fixed to the segment above them.

        The indices (n_segments, 2) are those of both ends of each segment among the frames.
        """
        segments = [SEGMENTS[name] for name in self.names if name in SEGMENTS]
        frames = list(dict.fromkeys(frame for ends in segments for frame in ends))
        joints = [AXES[name] for name in self.names if name in AXES]
        axes = [axis_of(self.arm.chain, joint, TURN + 1 if joint == FLEXION else joint) for joint in joints]
        indices = np.array([[frames.index(end) for end in ends] for ends in segments], dtype=np.int64)
        return PointKinematics(self.arm.chain, frames, axes), indices, frames

    def arrays(self) -> tuple[tuple[Any, ...], Array]:
        """Return the arguments of `frame_terms` from `offset` to `ends`, and the weights."""
        kinematics, ends, _ = self._kinematics
        return (*kinematics.arrays(), ends), np.array([WEIGHTS[name] for name in self.names])

    def residual(self, q: Array) -> tuple[Array, Array]:
        """Return weighted residuals (n, 3k) and derivatives (n, 3k, dof); zero where targets are missing."""
        values, slopes = self.model(q)
        weight = np.array([WEIGHTS[name] for name in self.names]) * ~np.isnan(self.targets[..., 0])
        difference = (values - np.nan_to_num(self.targets)) * weight[..., None]
        slopes = slopes * weight[..., None, None]
        return difference.reshape(len(q), -1), slopes.reshape(len(q), -1, self.arm.dof)

    def errors(self, q: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the errors of the directions of joint angles (n, dof), by segment, each (n,) [rad].

        Angles between the arm's segments and the recorded ones, and rotations of segments about their own axis that
        bring joint axes to their markers.
        """
        values = np.concatenate([self.model(q[part])[0] for part in parts_of(len(q), BLOCK)])
        half = np.linalg.norm(values - self.targets, axis=-1) / 2  # arccos is inaccurate below 1e-8
        angles, twists = 2 * np.arcsin(np.minimum(half, 1.0)), {}
        for axis, segment in AROUND.items():
            if axis in self.names:
                i, along = self.names.index(axis), values[:, self.names.index(segment)]
                model, target = (
                    vectors - np.sum(vectors * along, axis=1)[:, None] * along
                    for vectors in (values[:, i], self.targets[:, i])
                )
                sine, cosine = np.sum(np.cross(model, target) * along, axis=1), np.sum(model * target, axis=1)
                twists[segment] = np.arctan2(sine, cosine)
        return {name: angles[:, i] for i, name in enumerate(self.names) if name in SEGMENTS}, twists


@kernel
def frame_terms(  # type: ignore[no-untyped-def]
    q, offset, placements, axes, slides, coupling, joints, vectors, points, ends, targets, weights, gradient, hessian
):
    """Add Jᵀr and JᵀJ of the residuals of one frame, for the live view, to gradient and hessian; return |r|²."""
    positions, values, slopes = offset.copy(), np.empty((len(joints), 3)), np.empty((len(joints), 3, len(q)))
    for j in range(len(offset)):
        for k in range(len(q)):
            positions[j] += coupling[j, k] * q[k]
    place_points(positions, placements, axes, slides, coupling, joints, vectors, points, values, slopes)
    return add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian)


@part
def add_residuals(values, slopes, points, ends, targets, weights, gradient, hessian):  # type: ignore[no-untyped-def]
    """Add the terms for points (the first of the values) and directions with their derivatives."""
    dof = len(gradient)
    cost, slope = 0.0, np.empty((3, dof))
    for n in range(len(targets)):
        if weights[n] == 0.0:
            continue
        if n < len(ends):
            a, b = ends[n]
            unit = values[b] - values[a]
            length = np.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
            unit /= length
            for k in range(dof):
                stretch = 0.0
                for i in range(3):
                    slope[i, k] = slopes[b, i, k] - slopes[a, i, k]
                    stretch += unit[i] * slope[i, k]
                for i in range(3):
                    slope[i, k] = (slope[i, k] - unit[i] * stretch) / length
        else:
            unit = values[points + n - len(ends)]
            slope[:] = slopes[points + n - len(ends)]
        square = weights[n] * weights[n]
        for i in range(3):
            off = unit[i] - targets[n, i]
            cost += square * off * off
            for k in range(dof):
                gradient[k] += square * off * slope[i, k]
                for m in range(dof):
                    hessian[k, m] += square * slope[i, k] * slope[i, m]
    return cost
