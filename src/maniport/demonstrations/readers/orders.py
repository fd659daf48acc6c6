"""Orders in which programs write keypoints without names, and which of two it is."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from maniport.validation import Array

_OPENPOSE = ("Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist")
_LEGS = ("RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar")


def _pairs(*parts: str) -> tuple[str, ...]:
    return tuple(f"{side}_{part}" for part in parts for side in ("left", "right"))


_LIMBS = ("shoulder", "elbow", "wrist")
MEDIAPIPE = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    *_pairs("ear"), "mouth_left", "mouth_right", *_pairs(*_LIMBS, "pinky", "index", "thumb", "hip", "knee", "ankle",
    "heel", "foot_index"),
)  # fmt: skip

NAMES: dict[int, tuple[str, ...]] = {
    33: MEDIAPIPE,
    17: ("nose", *_pairs("eye", "ear", *_LIMBS, "hip", "knee", "ankle")),
    18: (*_OPENPOSE, *_LEGS),
    25: (*_OPENPOSE, "MidHip", *_LEGS, "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel"),
    26: ("Nose", "LEye", "REye", "LEar", "REar", "LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist",
         "LHip", "RHip", "LKnee", "RKnee", "LAnkle", "RAnkle", "Head", "Neck", "Hip", "LBigToe", "RBigToe", "LSmallToe",
         "RSmallToe", "LHeel", "RHeel"),
}  # fmt: skip
"""Names by the number of keypoints where the file gives none: MediaPipe, COCO, OpenPose (COCO, BODY_25), HALPE."""
HUMAN36M: tuple[str, ...] = (
    "pelvis", *(f"{side}_{part}" for side in ("right", "left") for part in ("hip", "knee", "ankle")), "spine", "thorax",
    "neck", "head", *(f"{side}_{part}" for side in ("left", "right") for part in _LIMBS),
)  # fmt: skip
"""The other order of 17: what lifts poses into space (VideoPose3D, MotionBERT, MMPose) has that of Human3.6M."""


@np.errstate(over="ignore", invalid="ignore")  # points out of reach keep no lengths
def wobble(names: Sequence[str], positions: Array) -> float:
    """How little the arms keep their lengths and are like each other, for points in an order of names."""
    off = 0.0
    for start, end in pairwise(_LIMBS):
        both = []
        for side in ("left", "right"):
            a, b = (positions[:, names.index(f"{side}_{part}")] for part in (start, end))
            lengths = np.linalg.norm(b - a, axis=-1)
            both.append(lengths[lengths > 0])
        if not all(map(len, both)):
            return np.inf
        left, right = map(np.median, both)
        off += sum(np.std(one) / np.median(one) for one in both) + abs(np.log(left / right))
    return float(off)
