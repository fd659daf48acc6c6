"""Skeletons that are known by the number of their joints, when an array comes without names.

A number alone would be a guess: a skeleton is taken only when its arms, in these positions, are arms, that is when both
upper arms and both forearms keep their lengths and are as long as on the other side. The order of joints in the SMPL
family: https://github.com/vchoutas/smplx, ``joint_names.py``; those of holosoma: its ``config_types/data_type.py``.
"""

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError
from maniport.validation import Array

_BODY = [
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
]  # fmt: skip
_FINGERS = ("index", "middle", "pinky", "ring", "thumb")


def _hand(side: str) -> list[str]:
    return [f"{side}_{finger}{i}" for finger in _FINGERS for i in (1, 2, 3)]


def _arm(side: str, fingers: tuple[str, ...]) -> list[str]:
    joints = [f"{side}Shoulder", f"{side}Arm", f"{side}ForeArm", f"{side}Hand"]
    return joints + [f"{side}Hand{finger}{i}" for finger in fingers for i in (1, 2, 3)]


def _isaac_arm(letter: str) -> list[str]:
    joints = [f"{letter}_{name}" for name in ("Thorax", "Shoulder", "Elbow", "Wrist")]
    return joints + [f"{letter}_{finger.capitalize()}{i}" for finger in _FINGERS for i in (1, 2, 3)]


_LEGS = [f"{side}{part}" for side in ("Right", "Left") for part in ("UpLeg", "Leg", "Foot", "ToeBase")]

SKELETONS: dict[str, list[str]] = {
    "SMPL body": _BODY,
    "SMPL": [*_BODY, "left_hand", "right_hand"],
    "SMPL-H": [*_BODY, *_hand("left"), *_hand("right")],
    "SMPL-X": [*_BODY, "jaw", "left_eye", "right_eye", *_hand("left"), *_hand("right")],
    "SMPL-H in the order of Isaac Gym (PHC, holosoma)": [
        "Pelvis", "L_Hip", "L_Knee", "L_Ankle", "L_Toe", "R_Hip", "R_Knee", "R_Ankle", "R_Toe", "Torso", "Spine",
        "Chest", "Neck", "Head", *_isaac_arm("L"), *_isaac_arm("R"),
    ],
    "LAFAN1 in the order of holosoma": [
        "Hips", *_LEGS, "Spine", "Spine1", "Spine2", "Neck", "Head", *_arm("Right", ()), *_arm("Left", ()),
    ],
    "holosoma's mocap": [
        "Hips", "Spine", "Spine1", "Neck", "Head", *_arm("Left", ("Thumb", "Index", "Middle", "Ring", "Pinky")),
        *_arm("Right", ("Thumb", "Index", "Middle", "Ring", "Pinky")), *_LEGS[4:], *_LEGS[:4], "LeftFootMod",
        "RightFootMod",
    ],
}  # fmt: skip
"""Names of joints in their order."""

UP = {"holosoma's mocap": "z"}
"""The axis that points up, where all files of a skeleton have the same."""

ARMS = (("shoulder", "elbow", "wrist"), ("Shoulder", "Elbow", "Wrist"), ("Arm", "ForeArm", "Hand"))
PREFIXES = (("left_", "right_"), ("L_", "R_"), ("Left", "Right"))

WOBBLE = 0.05
"""How much a bone's length may change over a motion, as a share of its median (standard deviation)."""
UNLIKE = 0.15
"""How much the bones of both sides may differ."""


def recognised(file: Path, positions: Array) -> str:
    """Which of `SKELETONS` it is."""
    count = positions.shape[1]
    fitting = [name for name, joints in SKELETONS.items() if len(joints) == count and _has_arms(joints, positions)]
    beside = f"{file.stem}.names.txt"
    if len(fitting) != 1:
        known = ", ".join(f"{len(joints)} ({name})" for name, joints in SKELETONS.items())
        why = " and ".join(fitting) + " would both do" if fitting else f"known by its number of joints are {known}"
        raise FileFormatError(
            f"{file}: {count} joints without names; write one name a line into {beside!r} beside it ({why})"
        )
    return fitting[0]


@np.errstate(over="ignore", invalid="ignore")  # points out of reach make no arms
def _has_arms(joints: list[str], positions: Array) -> bool:
    """Whether the arms of a skeleton are arms in these positions."""
    left, right = next(pair for pair in PREFIXES if any(name.startswith(pair[0]) for name in joints))
    arm = next(names for names in ARMS if left + names[1] in joints)
    lengths = []
    for side in (left, right):
        at = [positions[:, joints.index(side + name)].astype(np.float64) for name in arm]
        bones = np.stack([np.linalg.norm(b - a, axis=-1) for a, b in pairwise(at)])
        seen = np.isfinite(bones).all(axis=0)
        if not seen.any() or not (np.median(bones[:, seen], axis=1) > 0).all():
            return False
        middle = np.median(bones[:, seen], axis=1)
        if (bones[:, seen].std(axis=1) > WOBBLE * middle).any():
            return False
        lengths.append(middle)
    return all((np.abs(a - b) < UNLIKE * np.maximum(a, b)).all() for a, b in combinations(lengths, 2))
