"""Pose parameters of the SMPL family without the body model: bones of a T-pose, turned as the parameters say.

The body model, which may not be passed on, would give each person's own joints. The directions of upper arm, forearm
and hand, which is all that `fit_arm` looks at, follow from the rotations and the T-pose alone: arms along x, y up, z
forward, in which the joints of the model's mean body lie within a few degrees of straight lines. Lengths are those of a
person of 1.75 m: those of the arm as in `maniport.bodies.human`, those of the trunk by the fractions of height
of Drillis and Contini (1966), as in D. A. Winter, "Biomechanics and Motor Control of Human Movement", 4th edition,
2009, figure 4.1. Layout of the files: https://amass.is.tue.mpg.de.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.bodies.human import FRACTIONS
from maniport.demonstrations.given import LARGEST_ANGLE, Given
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import FRAMES, require_at_most
from maniport.validation import Array

HEIGHT = 1.75
"""Of the person whose lengths are taken [m]."""
_AT_ONCE = 20_000
"""Frames that are turned together, so that little is kept beside the places."""
FEWEST = 66
"""Numbers of a frame: an axis times an angle [rad] for each of 22 joints."""

_SIDE = (
    ("collar", "spine3", (0.03, 0.128, 0.0)), ("shoulder", "collar", (0.099, 0.0, 0.0)),
    ("elbow", "shoulder", (FRACTIONS["upper arm"], 0.0, 0.0)), ("wrist", "elbow", (FRACTIONS["forearm"], 0.0, 0.0)),
    ("hand", "wrist", (FRACTIONS["hand"], 0.0, 0.0)),
)  # fmt: skip
"""Joints of an arm, what they hang on, and their places there as shares of height, those of the left side."""

INDEX = {"pelvis": 0, "spine1": 3, "spine2": 6, "spine3": 9, "neck": 12, "head": 15,
         "left_collar": 13, "right_collar": 14, "left_shoulder": 16, "right_shoulder": 17, "left_elbow": 18,
         "right_elbow": 19, "left_wrist": 20, "right_wrist": 21}  # fmt: skip
"""Places of joints among the parameters."""

BONES: dict[str, tuple[str, tuple[float, float, float]]] = {
    "spine1": ("pelvis", (0.0, 0.06, 0.0)), "spine2": ("spine1", (0.0, 0.07, 0.0)),
    "spine3": ("spine2", (0.0, 0.03, 0.0)), "neck": ("spine3", (0.0, 0.14, 0.0)), "head": ("neck", (0.0, 0.05, 0.0)),
    **{f"left_{joint}": (on if on == "spine3" else f"left_{on}", place) for joint, on, place in _SIDE},
    **{f"right_{joint}": (on if on == "spine3" else f"right_{on}", (-x, y, z)) for joint, on, (x, y, z) in _SIDE},
}  # fmt: skip
"""For each joint what it hangs on and its place there as shares of height, x to the left, y up, z forward."""


def posed(file: Path, given: Given, poses: Any, trans: Any, time: Any, up: str = "z") -> Recording:
    """The joints of a body in its poses (n, 66 or more) or (n, k, 3), the root at `trans` (n, 3) [m]."""
    angles = np.asarray(poses)
    if angles.ndim == 3 and angles.shape[-1] == 3:
        angles = angles.reshape(len(angles), -1)
    if angles.ndim != 2 or angles.shape[1] < FEWEST or angles.dtype.kind not in "fiu" or not len(angles):
        raise FileFormatError(
            f"{file}: poses must be numbers of shape (n, {FEWEST} or more); found {angles.shape} of {angles.dtype}"
        )
    count = len(angles)
    require_at_most(count, FRAMES, "frames", file)
    root = np.zeros((count, 3)) if trans is None else np.asarray(trans)
    if root.shape != (count, 3) or root.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: trans must be numbers of shape ({count}, 3); found {root.shape} of {root.dtype}"
        )
    parts = [slice(first, first + _AT_ONCE) for first in range(0, count, _AT_ONCE)]
    positions = np.concatenate([_joints(angles[part, :FEWEST], root[part]) for part in parts])
    note = (
        "pose parameters without the body model: directions of bones from a T-pose, lengths of a person of "
        f"{HEIGHT} m, unless the arm is fitted with the person's height"
    )
    recording = given.recording(
        file,
        ["pelvis", *BONES],
        positions,
        time,
        "m",
        up,
        "as AMASS has it",
        usual="y",
        notes=[note],
        unit_by="of the lengths that are taken",
    )
    return replace(recording, measured=False)


def _joints(angles: Array, root: Array) -> Array:
    """Places of the pelvis and of what hangs on it [m], shape (n, joints, 3); nan where angles are beyond measure."""
    with np.errstate(over="ignore"):  # of numbers with more digits
        vectors, places = angles.astype(np.float64), {"pelvis": root.astype(np.float64)}
    lost = np.asarray(~(np.abs(vectors) < LARGEST_ANGLE).all(axis=1))
    vectors[lost] = 0.0
    vectors = vectors.reshape(len(vectors), -1, 3)
    turns: dict[str, Array] = {"pelvis": Rotation.from_rotvec(vectors[:, 0]).as_matrix()}
    for joint, (on, place) in BONES.items():
        places[joint] = places[on] + turns[on] @ (HEIGHT * np.array(place))
        if joint in INDEX:
            turns[joint] = turns[on] @ Rotation.from_rotvec(vectors[:, INDEX[joint]]).as_matrix()
    positions = np.stack(list(places.values()), axis=1)
    positions[lost] = np.nan
    return positions
