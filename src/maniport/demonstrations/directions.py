"""What a recording says about the arm: directions of segments and of joint axes, seen from the trunk.

Only directions are compared, never positions: the place of the shoulder in the trunk is not measured, and the
recorded segment lengths wobble with the skin. The residual of a segment is ``u(q) - u``, a difference of unit vectors;
its length is the angle between them [rad] as long as that is small.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.bodies import Arm
from maniport.bodies.attached import Attached, axis_of
from maniport.bodies.human import JOINTS
from maniport.demonstrations.long_paths import BLOCK, parts_of
from maniport.errors import InvalidInputError
from maniport.validation import Array

SEGMENTS = {"upper arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "hand": ("wrist", "hand")}
"""The frames of the arm between which each segment runs; the roles of the recording have the same names."""

ELBOW, TURN, DEVIATION, FLEXION = map(JOINTS.index, ("elbow_flexion", "pro_sup", "deviation", "flexion"))
"""Places of four joints among the seven of a human arm."""

AXES = {"elbow_axis": ELBOW, "wrist_axis": FLEXION}
"""The joint whose axis each pair of markers shows."""

AROUND = {"elbow_axis": "upper arm", "wrist_axis": "forearm"}
"""The segment about whose own axis each pair of markers tells the turn."""

MARKED = {"right": 1.0, "left": -1.0}
"""Whether the axes of elbow and wrist point from medial to lateral and from ulnar to radial, as a right arm's do, or
the other way, as in its mirror image; see `maniport.bodies.restriction`."""

WEIGHTS = {"upper arm": 1.0, "forearm": 1.0, "hand": 0.2, "elbow_axis": 0.1, "wrist_axis": 0.1}
"""Weights of the residuals, inverse to the error that each direction is expected to have.

A hand is measured over a fifth of a forearm's length. The markers beside a joint are near its axis, not on it. Both
decide what upper arm and forearm leave open, and do not pull those two off their course when the hand is beyond the
model's limits.
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
    """Directions in the trunk frame, and the arm that is to take them.

    Attributes
    ----------
    arm : Arm
        The arm.
    names : tuple of str
        Keys of `SEGMENTS`, then of `AXES`.
    targets : ndarray, shape (n, len(names), 3)
        Unit vectors; nan where not seen.
    """

    arm: Arm
    names: tuple[str, ...]
    targets: Array

    def take(self, frames: NDArray[np.intp] | slice) -> "Directions":
        """Keep some frames, in any order and as often as wanted."""
        return Directions(self.arm, self.names, self.targets[frames])

    def model(self, q: Array) -> tuple[Array, Array]:
        """Directions of the arm, shape (n, k, 3), and their derivatives, shape (n, k, 3, dof)."""
        followed, slopes = self._attached(q)
        ends = [SEGMENTS[name] for name in self.names if name in SEGMENTS]
        start, end = ([self._points.index(pair[k]) for pair in ends] for k in (0, 1))
        value, slope = _normalised(followed[:, end] - followed[:, start], slopes[:, end] - slopes[:, start])
        axes = len(self._points)
        return np.concatenate([value, followed[:, axes:]], axis=1), np.concatenate([slope, slopes[:, axes:]], axis=1)

    @cached_property
    def _points(self) -> list[str]:
        """Frames between which the segments run."""
        return list(dict.fromkeys(frame for name in self.names if name in SEGMENTS for frame in SEGMENTS[name]))

    @cached_property
    def _attached(self) -> Attached:
        """Those frames, and joint axes as fixed to the segment above them."""
        joints = [AXES[name] for name in self.names if name in AXES]
        axes = [axis_of(self.arm.chain, joint, TURN + 1 if joint == FLEXION else joint) for joint in joints]
        return Attached(self.arm.chain, self._points, axes)

    def arrays(self) -> tuple[tuple[Any, ...], Array]:
        """What `maniport.demonstrations.frame_kernel` takes of the arm, from `coupling` to `ends`, and the weights."""
        segments = [SEGMENTS[name] for name in self.names if name in SEGMENTS]
        ends = np.array([[self._points.index(end) for end in pair] for pair in segments], dtype=np.int64)
        return (*self._attached.arrays(), ends), np.array([WEIGHTS[name] for name in self.names])

    def residual(self, q: Array) -> tuple[Array, Array]:
        """Weighted residuals, shape (n, 3k), and their derivatives, shape (n, 3k, dof); zero for what is not seen."""
        values, slopes = self.model(q)
        weight = np.array([WEIGHTS[name] for name in self.names])
        weight = weight * ~np.isnan(self.targets[..., 0])
        difference = (values - np.nan_to_num(self.targets)) * weight[..., None]
        slopes = slopes * weight[..., None, None]
        return difference.reshape(len(q), -1), slopes.reshape(len(q), -1, self.arm.dof)

    def values(self, q: Array) -> Array:
        """Directions of the arm alone, shape (n, k, 3)."""
        return np.concatenate([self.model(q[part])[0] for part in parts_of(len(q), BLOCK)])

    def angles(self, q: Array) -> dict[str, Array]:
        """Angles between the arm's segments and the recorded ones [rad], shape (n,) by segment."""
        values = self.values(q)
        half = np.linalg.norm(values - self.targets, axis=-1) / 2  # arccos of a scalar product is blind below 1e-8
        angles = 2 * np.arcsin(np.minimum(half, 1.0))
        return {name: angles[:, i] for i, name in enumerate(self.names) if name in SEGMENTS}

    def twists(self, q: Array) -> dict[str, Array]:
        """By how much each segment would have to turn about its own axis to bring the joint axis to its markers."""
        values, found = self.values(q), {}
        for axis, segment in AROUND.items():
            if axis in self.names:
                i, along = self.names.index(axis), values[:, self.names.index(segment)]
                own, seen = (
                    one - np.sum(one * along, axis=1)[:, None] * along for one in (values[:, i], self.targets[:, i])
                )
                sine, cosine = np.sum(np.cross(own, seen) * along, axis=1), np.sum(own * seen, axis=1)
                found[segment] = np.arctan2(sine, cosine)
        return found


def _normalised(vector: Array, slope: Array) -> tuple[Array, Array]:
    """Unit vectors (n, k, 3) and the derivative (I - u uᵀ) v' / |v|, shape (n, k, 3, dof)."""
    length = np.linalg.norm(vector, axis=-1)[..., None]
    unit = vector / length
    along = unit[..., None, :] @ slope
    return unit, (slope - unit[..., None] * along) / length[..., None]
