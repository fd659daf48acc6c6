"""Keypoints in JSON: what finds bodies in pictures writes frame by frame."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bounds import FRAMES, KEYPOINTS_BYTES, PLACES, POINTS, SETTINGS_BYTES, read_whole, require_at_most
from maniport.demonstrations.given import Given, drop_unsure
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
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

_FRAMES = ("frames", "data", "results", "poses")
_WORLD = ("pose_world_landmarks", "poseWorldLandmarks", "worldLandmarks", "world_landmarks")
_POINTS = (*_WORLD, "pose_keypoints_3d", "keypoints_3d", "keypoints3d", "keypoints3D", "joints", "keypoints",
           "landmarks", "pose_landmarks", "poseLandmarks", "points")  # fmt: skip
_TIME = (("time", 1.0), ("timestamp", 1.0), ("t", 1.0), ("time_ms", 1e-3), ("timestamp_ms", 1e-3))
_TRUST = ("visibility", "confidence", "score")
_RATE = ("fps", "rate", "frame_rate")
IN_PICTURE = (
    "these keypoints are places in a picture, not in space; write those in space (MediaPipe: pose_world_landmarks; "
    "OpenPose: pose_keypoints_3d), or let Pose2Sim or OpenCap find them (TRC)"
)

Point = tuple[float, float, float, float]
"""x, y, z and how far it is trusted."""


def read(file: Path, given: Given) -> Recording:
    """Read a JSON file of frames, or a folder of them, one a frame in the order of their names.

    See `maniport.demonstrations.readers.read_recording`. A frame is a list of keypoints, or a mapping in which one
    stands (``pose_world_landmarks``, ``keypoints``, ``joints``, … or OpenPose's ``people``); a keypoint is
    ``{"x", "y", "z"}`` or a list of three numbers, with visibility, confidence or score where there is one.
    """
    head: Mapping[str, Any] = {}
    if file.is_dir():
        parts = sorted(file.glob("*.json"))
        require_at_most(len(parts), FRAMES, "files", file)
        frames = [_loaded(part, SETTINGS_BYTES) for part in parts]
    else:
        frames, head = _unwrapped(_loaded(file, KEYPOINTS_BYTES))
    if not frames:
        raise FileFormatError(f"{file}: the file holds no frames")
    try:
        bodies = [_points(frame) for frame in frames]
        time = _times(frames)
        rate = next((_number(head[key]) for key in _RATE if key in head), None)
    except (ValueError, TypeError, KeyError, IndexError, OverflowError) as error:
        raise FileFormatError(f"{file}: not readable as keypoints: {error}") from None
    names = _names(file, head, bodies)
    require_at_most(len(names), POINTS, "points", file)
    require_at_most(len(names) * len(bodies), PLACES, "places (frames × points)", file)
    table = np.full((len(bodies), len(names), 4), np.nan)
    index = {name: i for i, name in enumerate(names)}
    for row, body in zip(table, bodies, strict=True):
        if isinstance(body, dict):
            for name, point in body.items():
                row[index[name]] = point
        elif body:
            row[:] = body
    positions, mediapipe = table[..., :3], len(names) == len(MEDIAPIPE)
    if mediapipe:
        _require_space(file, positions, index)
    if time is None and rate is not None and 0 < rate < np.inf:
        time = np.arange(len(bodies)) / rate
    unit, usual = str(head.get("unit", "m" if mediapipe else "")), "-y" if mediapipe else "y"
    notes = drop_unsure(positions, table[..., 3])
    return given.recording(file, names, positions, time, unit, str(head.get("up", "")), usual=usual, notes=notes)


def _loaded(file: Path, most: int) -> Any:
    try:
        return json.loads(read_whole(file, (), most))  # bytes: in UTF-8 or UTF-16
    except (ValueError, RecursionError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"{file}: not readable as JSON: {error}") from None


def _unwrapped(content: Any) -> tuple[list[Any], Mapping[str, Any]]:
    """The frames, and what stands beside them."""
    if isinstance(content, dict):
        key = next((key for key in _FRAMES if isinstance(content.get(key), list)), None)
        return (content[key], content) if key else ([content], content)
    return (content, {}) if isinstance(content, list) else ([], {})


def _points(frame: Any) -> list[Point] | dict[str, Point]:
    """The keypoints of one frame: by their names where they have some; empty where nobody was seen."""
    if isinstance(frame, dict):
        if isinstance(frame.get("people"), list):
            return _points(frame["people"][0]) if frame["people"] else []
        key = next((key for key in _POINTS if key in frame), None)
        if key is None:
            if any(str(name).endswith("2d") for name in frame):
                raise ValueError(IN_PICTURE)
            raise KeyError(
                f"no frame without one of {', '.join(_POINTS)}, people; found {', '.join(map(str, frame))[:200]}"
            )
        frame = frame[key]
        if key.lower().endswith("3d") and isinstance(frame, list) and frame and not isinstance(frame[0], (list, dict)):
            width = 4 if len(frame) % 4 == 0 and len(frame) // 4 in NAMES else 3
            frame = [frame[i : i + width] for i in range(0, len(frame), width)]
    if isinstance(frame, dict):
        return {str(name): _point(point) for name, point in frame.items()}
    if not isinstance(frame, list):
        return []
    if len(frame) and isinstance(frame[0], list) and frame[0] and isinstance(frame[0][0], (list, dict)):
        frame = frame[0]  # several people: the first
    named = [point.get("name") if isinstance(point, dict) else None for point in frame]
    if frame and all(isinstance(name, str) for name in named):
        return {str(name): _point(point) for name, point in zip(named, frame, strict=True)}
    return [_point(point) for point in frame]


def _point(point: Any) -> Point:
    if isinstance(point, dict):
        trust = next((_number(point[key]) for key in _TRUST if key in point), 1.0)
        if isinstance(point.get("position"), list):
            return (*_point(point["position"])[:3], trust)
        if "x" in point and "z" not in point:
            raise ValueError(IN_PICTURE)
        return (_number(point["x"]), _number(point["y"]), _number(point["z"]), trust)
    if not isinstance(point, list) or len(point) not in (2, 3, 4):
        raise ValueError(f"a keypoint is x, y, z, or these and how far it is trusted; found {str(point)[:80]}")
    if len(point) == 2:
        raise ValueError(IN_PICTURE)
    x, y, z, trust = map(_number, (*point, 1.0)[:4])
    return x, y, z, trust


def _number(value: Any) -> float:
    """A number; null is none."""
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"a number is wanted; found {str(value)[:80]!r}")
    return float(value)


def _times(frames: Iterable[Any]) -> Array | None:
    """Times [s], where every frame has one."""
    times = []
    for frame in frames:
        key = next((pair for pair in _TIME if isinstance(frame, dict) and pair[0] in frame), None)
        if key is None:
            return None
        times.append(_number(frame[key[0]]) * key[1])
    return np.array(times)


def _names(file: Path, head: Mapping[str, Any], bodies: list[Any]) -> list[str]:
    """Names of the points, the file's own or those that belong to their number."""
    own = list(dict.fromkeys(name for body in bodies if isinstance(body, dict) for name in body))
    counts = sorted({len(body) for body in bodies if isinstance(body, list) and body})
    if own and counts:
        raise FileFormatError(f"{file}: some frames name their keypoints and some do not")
    if own:
        return own
    if len(counts) != 1:
        raise FileFormatError(f"{file}: every frame needs the same number of keypoints; found {counts[:8] or 'none'}")
    names = next(
        (head[key] for key in ("names", "joint_names", "keypoint_names") if isinstance(head.get(key), list)), None
    )
    if names is not None and len(names) == counts[0]:
        return [str(name) for name in names]
    if counts[0] in NAMES:
        return list(NAMES[counts[0]])
    raise FileFormatError(
        f"{file}: {counts[0]} keypoints without names; give each a name, or names beside the frames "
        f'({{"names": [...], "frames": [...]}}); known by their number are {", ".join(map(str, NAMES))}'
    )


def _require_space(file: Path, positions: Array, index: Mapping[str, int]) -> None:
    """Refuse MediaPipe's landmarks of the picture: there the hips are anywhere in it, and their depth is zero."""
    if "left_hip" in index and "right_hip" in index:
        middle = positions[:, [index["left_hip"], index["right_hip"]]].mean(axis=1)
        seen = np.isfinite(middle).all(axis=1)
        if seen.any():
            x, y, depth = np.median(np.abs(middle[seen]), axis=0)
            if depth < 0.05 and max(x, y) > 0.2:
                raise FileFormatError(f"{file}: {IN_PICTURE}")
