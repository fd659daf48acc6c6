"""Pose parameters of the SMPL family without the body model: bones of a T-pose, rotated as the parameters say.

The body model, which may not be passed on, would give each person's own joints. The directions of upper arm, forearm
and hand, which is all that `fit_arm` compares, follow from the rotations and the T-pose alone: arms along x, y up, z
forward, in which the joints of the model's mean body lie within a few degrees of straight lines. Lengths of the arm
are those of `maniport.arms.human`; those of the trunk are the fractions of height of Drillis and Contini
(1966), as in D. A. Winter, "Biomechanics and Motor Control of Human Movement", 4th edition, 2009, figure 4.1. Layout of
the files: https://amass.is.tue.mpg.de.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms.human import FRACTIONS
from maniport.errors import FileFormatError
from maniport.mocap.import_options import LARGEST_ANGLE, ImportOptions
from maniport.mocap.recording import Recording
from maniport.util.input_limits import FRAMES, require_at_most
from maniport.util.validation import Array

HEIGHT = 1.75  # Body height whose lengths are taken [m]

INDEX = {
    "pelvis": 0,
    "spine1": 3,
    "spine2": 6,
    "spine3": 9,
    "neck": 12,
    "left_collar": 13,
    "right_collar": 14,
    "left_shoulder": 16,
    "right_shoulder": 17,
    "left_elbow": 18,
    "right_elbow": 19,
    "left_wrist": 20,
    "right_wrist": 21,
}
"""Indices of joints among the parameters."""


def _bones() -> dict[str, tuple[str, Array]]:
    """Return the parent of each joint and its place there [m], x to the left, y up, z forward."""
    spine = {"spine1": 0.06, "spine2": 0.07, "spine3": 0.03, "neck": 0.14, "head": 0.05}
    parents = ("pelvis", *spine)
    bones = {
        joint: (parent, HEIGHT * np.array([0.0, share, 0.0]))
        for parent, (joint, share) in zip(parents, spine.items(), strict=False)
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        bones[f"{side}_collar"] = "spine3", HEIGHT * np.array([sign * 0.03, 0.128, 0.0])
        parent = "collar"
        for joint, share in (
            ("shoulder", 0.099),
            ("elbow", FRACTIONS["upper arm"]),
            ("wrist", FRACTIONS["forearm"]),
            ("hand", FRACTIONS["hand"]),
        ):
            bones[f"{side}_{joint}"] = f"{side}_{parent}", HEIGHT * np.array([sign * share, 0.0, 0.0])
            parent = joint
    return bones


def posed(file: Path, options: ImportOptions, poses: Any, trans: Any, time: Any, up: str = "z") -> Recording:
    """Return the joints of a body in its poses (n, 66 or more) or (n, k, 3), the root at `trans` (n, 3) [m]."""
    angles = np.asarray(poses)
    if angles.ndim == 3 and angles.shape[-1] == 3:
        angles = angles.reshape(len(angles), -1)
    if angles.ndim != 2 or angles.shape[1] < 66 or angles.dtype.kind not in "fiu" or not len(angles):
        raise FileFormatError(
            f"{file}: poses must be numbers of shape (n, 66 or more); found {angles.shape} of {angles.dtype}"
        )
    count = len(angles)
    require_at_most(count, FRAMES, "frames", file)
    root = np.zeros((count, 3)) if trans is None else np.asarray(trans)
    if root.shape != (count, 3) or root.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: trans must be numbers of shape ({count}, 3); found {root.shape} of {root.dtype}"
        )
    bones = _bones()
    parts = [slice(first, first + 20_000) for first in range(0, count, 20_000)]  # in little memory
    positions = np.concatenate([_joints(bones, angles[part, :66], root[part]) for part in parts])
    note = (
        "pose parameters without the body model: directions of bones from a T-pose, lengths of a person of "
        f"{HEIGHT} m, unless the arm is fitted with the person's height"
    )
    names, by = ["pelvis", *bones], "of the lengths that are taken"
    recording = options.recording(
        file, names, positions, time, "m", up, "as AMASS has it", usual="y", notes=[note], unit_by=by
    )
    return replace(recording, measured=False)


def _joints(bones: dict[str, tuple[str, Array]], angles: Array, root: Array) -> Array:
    """Return the places of the joints [m], shape (n, joints, 3); nan where angles are too large."""
    with np.errstate(over="ignore"):  # of numbers with more digits
        vectors, places = angles.astype(np.float64), {"pelvis": root.astype(np.float64)}
    lost = np.asarray(~(np.abs(vectors) < LARGEST_ANGLE).all(axis=1))
    vectors[lost] = 0.0
    vectors = vectors.reshape(len(vectors), -1, 3)
    rotations: dict[str, Array] = {"pelvis": Rotation.from_rotvec(vectors[:, 0]).as_matrix()}
    for joint, (parent, place) in bones.items():
        places[joint] = places[parent] + rotations[parent] @ place
        if joint in INDEX:
            rotations[joint] = rotations[parent] @ Rotation.from_rotvec(vectors[:, INDEX[joint]]).as_matrix()
    positions = np.stack(list(places.values()), axis=1)
    positions[lost] = np.nan
    return positions
