"""Shapes in space as numbers: where the parts of a skeleton and the surface of an ellipsoid go."""

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.spd.ellipsoid import axes
from maniport.validation import Array

SIZE = 0.25
"""Length at which a semi-axis of 1 m/s per rad/s is drawn [m]."""
THINNEST = 1e-3
"""Semi-axes are drawn no shorter than this [m]: a flat ellipsoid is still to be seen."""

CLEAR = 1.004
"""Radius of rings about a unit ball: they shall not sink into it where a browser draws both with flat facets."""


def quaternion(rotation: Array) -> Array:
    """Rotation matrices (..., 3, 3) as unit quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def rotation_of(wxyz: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (w, x, y, z), shape (..., 4)."""
    return np.asarray(Rotation.from_quat(wxyz, scalar_first=True).as_matrix())


def roll_pitch_yaw(rotation: Array) -> Array:
    """Roll, pitch and yaw of a rotation about fixed axes, as in URDF, shape (3,) [degrees]."""
    # at a pitch of ±90° one of the other two is arbitrary, and SciPy warns; any will do here
    x, y, z = rotation[:, 0]
    pitch = np.arctan2(-z, np.hypot(x, y))
    if np.hypot(x, y) > 1e-9:
        roll, yaw = np.arctan2(rotation[2, 1], rotation[2, 2]), np.arctan2(y, x)
    else:
        roll, yaw = 0.0, np.arctan2(-rotation[0, 1], rotation[1, 1])
    return np.degrees([roll, pitch, yaw])


def from_roll_pitch_yaw(degrees: Array) -> Array:
    """Rotation matrix of roll, pitch and yaw about fixed axes [degrees]."""
    return np.asarray(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def shell(ellipsoid: Array) -> tuple[tuple[float, float, float], Array]:
    """Semi-axes [m] to scale a unit ball with, and the quaternion to turn it with, for an ellipsoid (3, 3)."""
    lengths, directions = axes(ellipsoid)
    right_handed = directions * np.array([1.0, 1.0, np.sign(np.linalg.det(directions))])
    a, b, c = np.maximum(SIZE * lengths, THINNEST).tolist()
    return (a, b, c), quaternion(right_handed)


def rings(corners: int = 64) -> Array:
    """Three great circles of a ball a trace larger than the unit ball, in its planes of symmetry, as lines.

    Returns
    -------
    ndarray, shape (3 · corners, 2, 3)
        Start and end of each line.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, corners + 1)
    circle = CLEAR * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    closed = np.stack([np.roll(circle, shift, axis=1) for shift in range(3)])
    return np.stack([closed[:, :-1], closed[:, 1:]], axis=2).reshape(-1, 2, 3)


def bones(skeleton: Array) -> tuple[Array, Array, Array]:
    """Quaternions (k − 1, 4) that turn z along the lines of a polyline (k, 3), their starts and their lengths."""
    ways = np.diff(skeleton, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    directions = np.where(lengths[:, None] > 1e-9, ways / np.maximum(lengths, 1e-9)[:, None], [0.0, 0.0, 1.0])
    # half-way between z and the direction lies the axis of half a turn that takes the one to the other
    half = directions + np.array([0.0, 0.0, 1.0])
    size = np.linalg.norm(half, axis=1, keepdims=True)
    half = np.where(size > 1e-6, half / np.maximum(size, 1e-6), [1.0, 0.0, 0.0])
    return np.concatenate([np.zeros((len(half), 1)), half], axis=1), skeleton[:-1], np.maximum(lengths, 1e-6)
