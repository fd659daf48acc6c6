"""Synthetic recordings of the motion of an arm model."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm
from maniport.arms.chain import RIGHT
from maniport.arms.human import middle_of
from maniport.mocap.directions import ELBOW, FLEXION, MARKED, TURN, require_human
from maniport.mocap.recording import Recording
from maniport.mocap.roles import POINTS
from maniport.util.validation import Array, as_finite, as_times, require_shape

HALF_WIDTH = 0.03  # Distance of the markers of elbow and wrist from the center of the joint [m]

TRUNK = {
    "trunk_low": (0.0, 0.0, -0.3), "trunk_high": (0.0, 0.0, 0.1),
    "trunk_back": (-0.1, 0.0, 0.0), "trunk_front": (0.1, 0.0, 0.0),
}  # fmt: skip
"""Points of a trunk at rest [m], from the middle of the neck."""


def synthetic_recording(arm: Arm, joint_angles: ArrayLike, time: ArrayLike, source: str = "synthetic") -> Recording:
    """Record the motion of a human arm; `fit_arm` returns its joint angles.

    Parameters
    ----------
    arm : Arm
        A human arm, right or left.
    joint_angles : array_like, shape (n, 7)
        [rad].
    time : array_like, shape (n,)
        Increasing [s].
    source : str
        Name of the recording.

    Returns
    -------
    Recording
        Points named after their roles, in the trunk frame with z up [m].

    Raises
    ------
    InvalidInputError
        When the arm is not a human one, or shapes do not agree.
    """
    require_human(arm)
    times, q = as_times(time), as_finite(joint_angles, "joint_angles")
    require_shape(q, "joint_angles", (len(times), arm.dof), ", as many as times")
    points: dict[str, Array] = dict(zip(POINTS, np.moveaxis(arm.point_positions(q, POINTS), 1, 0), strict=True))
    straight = q.copy()
    straight[:, TURN + 1 : FLEXION] = 0.0  # markers of the wrist are on the forearm: deviation does not move them
    for joints, index, middle, low, high in (
        (q, ELBOW, "elbow", "elbow_medial", "elbow_lateral"),
        (straight, FLEXION, "wrist", "wrist_ulnar", "wrist_radial"),
    ):
        axis = MARKED[arm.side or RIGHT] * HALF_WIDTH * arm.axis_direction(joints, arm.joint_names[index])
        points[low], points[high] = points[middle] - axis, points[middle] + axis
    neck = np.array([0.0, middle_of(arm), 0.0])
    points |= {name: np.tile(neck + point, (len(q), 1)) for name, point in TRUNK.items()}
    return Recording(tuple(points), np.stack(list(points.values()), axis=1), times, source)
