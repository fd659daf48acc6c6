"""Keypoints in JSON, which pose estimators write frame by frame."""

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from maniport.errors import FileFormatError
from maniport.mocap.import_options import ImportOptions, drop_untrusted
from maniport.mocap.marker_sets import load_names
from maniport.mocap.readers.text import decoded
from maniport.mocap.recording import Recording
from maniport.util.input_limits import (
    FRAMES,
    KEYPOINTS_BYTES,
    PLACES,
    POINTS,
    SETTINGS_BYTES,
    read_whole,
    require_at_most,
)
from maniport.util.validation import Array

MOST_ITEMS = PLACES // 10  # Most lists and mappings of a file, which take more memory than their numbers

_PEOPLE = ("people", "instances")
_POINTS = (
    *("pose_world_landmarks", "poseWorldLandmarks", "worldLandmarks", "world_landmarks"),
    *("pose_keypoints_3d", "keypoints_3d", "keypoints3d", "keypoints3D", "joints", "keypoints"),
    *("landmarks", "landmark", "pose_landmarks", "poseLandmarks", "points"),
)
_IN_PICTURE = (
    "these keypoints are places in a picture, not in space; write those in space (MediaPipe: pose_world_landmarks; "
    "OpenPose: pose_keypoints_3d), or let Pose2Sim or OpenCap find them (TRC)"
)

Point = tuple[float, float, float, float]  # x, y, z and confidence


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a JSON file of frames, a frame a line, or a folder of files, one a frame in the order of their names."""
    head: Mapping[str, Any] = {}
    if file.is_dir():
        parts = sorted(file.glob("*.json"))
        require_at_most(len(parts), FRAMES, "files", file)
        require_at_most(sum(part.lstat().st_size for part in parts), KEYPOINTS_BYTES, "bytes in its files", file)
        frames = [_loaded(part, SETTINGS_BYTES) for part in parts]
    else:
        frames, head = _unwrapped(_loaded(file, KEYPOINTS_BYTES))
    if not frames:
        raise FileFormatError(f"{file}: the file holds no frames")
    require_at_most(len(frames), FRAMES, "frames", file)
    try:
        bodies = [_points(frame) for frame in frames]
        time = _times(frames)
        rate = next((_number(head[key]) for key in ("fps", "rate", "frame_rate") if key in head), None)
    except (ValueError, TypeError, IndexError, OverflowError, RecursionError) as error:
        raise FileFormatError(f"{file}: not readable as keypoints: {error}") from None
    names = _names(file, head, bodies)
    table = _table(file, names, bodies)
    positions, mediapipe = table[..., :3], len(names) == 33
    if mediapipe:
        _require_space(file, positions, names)
    if time is None and rate is not None and 0 < rate < np.inf:
        time = np.arange(len(bodies)) / rate
    notes = drop_untrusted(positions, table[..., 3])
    orders = load_names("joint_orders.yaml")
    if names is orders["by_count"][17] and _wobble(orders["human36m"], positions) < _wobble(names, positions):
        names = orders["human36m"]
        notes.append("17 keypoints taken in the order of Human3.6M, not of COCO: by it the arms keep their lengths")
    several = sum(_count_people(frame) > 1 for frame in frames)
    notes += [f"several people in {several} frames, of whom the first was taken"] if several else []
    unit, up = (head[key] if isinstance(head.get(key), str) else "" for key in ("unit", "up"))
    unit, usual = unit or ("m" if mediapipe else ""), "-y" if mediapipe else "y"
    return options.recording(file, names, positions, time, unit, up, usual=usual, notes=notes)


def _loaded(file: Path, most: int) -> Any:
    content = read_whole(file, (), most)
    require_at_most(content.count(b"[") + content.count(b"{"), MOST_ITEMS, "lists and mappings", file)
    try:
        try:
            return json.loads(content)  # bytes: in UTF-8 or UTF-16
        except json.JSONDecodeError as error:
            if error.msg != "Extra data":
                raise
            return [json.loads(line) for line in decoded(content).splitlines() if line.strip()]
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: not readable as JSON: {error}") from None


def _unwrapped(content: Any) -> tuple[list[Any], Mapping[str, Any]]:
    """Return the frames, and the mapping that holds them."""
    if isinstance(content, dict):
        keys = ("frames", "data", "results", "poses", "instance_info")
        key = next((key for key in keys if isinstance(content.get(key), list)), None)
        return (content[key], content) if key else ([content], content)
    return (content, {}) if isinstance(content, list) else ([], {})


def _points(frame: Any) -> list[Point] | dict[str, Point]:
    """Return the keypoints of one frame, by their names where they have some; empty where nobody was seen."""
    if isinstance(frame, dict):
        people = next((frame[key] for key in _PEOPLE if isinstance(frame.get(key), list)), None)
        if people is not None:
            return _points(people[0]) if people else []
        key = next((key for key in _POINTS if key in frame), None)
        if key is None:
            return _by_name(frame)
        frame = _with_trust(frame, key)
        if isinstance(frame, dict) and "landmark" in frame:  # Google's protocol buffers as JSON
            frame = frame["landmark"]
    if isinstance(frame, dict):
        return {str(name): _point(point) for name, point in frame.items()}
    if not isinstance(frame, list):
        return []
    if len(frame) and isinstance(frame[0], list) and frame[0] and isinstance(frame[0][0], (list, dict)):
        frame = frame[0]  # several people: the first
    names = [point.get("name") if isinstance(point, dict) else None for point in frame]
    if frame and all(isinstance(name, str) for name in names):
        return {str(name): _point(point) for name, point in zip(names, frame, strict=True)}
    return [_point(point) for point in frame]


def _with_trust(frame: Mapping[str, Any], key: str) -> Any:
    """Return the keypoints under a key: flat lists of numbers in threes or fours, others with their confidences."""
    points = frame[key]
    keys = ("keypoint_scores", "keypoints_scores", "scores")
    trust: list[Any] = next((frame[name] for name in keys if isinstance(frame.get(name), list)), [])
    if not isinstance(points, list) or not points:
        return points
    if key.lower().endswith("3d") and not isinstance(points[0], (list, dict)):
        fours = len(points) % 4 == 0 and len(points) // 4 in load_names("joint_orders.yaml")["by_count"]
        width = 4 if fours else 3
        points = [points[i : i + width] for i in range(0, len(points), width)]
    if len(trust) != len(points):
        return points
    pairs = zip(points, trust, strict=True)
    return [[*point, sure] if isinstance(point, list) and len(point) == 3 else point for point, sure in pairs]


def _by_name(frame: Mapping[str, Any]) -> dict[str, Point]:
    """Return the keypoints of a frame that holds them under their names, besides its number or time."""
    points = {str(name): point for name, point in frame.items() if isinstance(point, (dict, list))}
    try:
        named = {name: _point(point) for name, point in points.items()}
    except ValueError as error:
        if any(name.endswith("2d") for name in points):
            raise ValueError(_IN_PICTURE) from None
        if str(error) == _IN_PICTURE:
            raise
        named = {}
    if not named:
        raise ValueError(
            f"no frame with keypoints by name, or with one of {', '.join((*_POINTS, *_PEOPLE))}; "
            f"found {', '.join(map(str, frame))[:200]}"
        )
    return named


def _count_people(frame: Any) -> int:
    people = next((frame[key] for key in _PEOPLE if key in frame), ()) if isinstance(frame, dict) else ()
    return len(people) if isinstance(people, list) else 0


def _point(point: Any) -> Point:
    wrong = f"a keypoint is x, y, z, or these and how far it is trusted; found {str(point)[:80]}"
    if isinstance(point, dict):
        keys = ("visibility", "confidence", "score")
        trust = next((_number(point[key]) for key in keys if key in point), 1.0)
        if isinstance(point.get("position"), (list, dict)):
            return (*_point(point["position"])[:3], trust)
        if "x" in point and "z" not in point:
            raise ValueError(_IN_PICTURE)
        if not point.keys() >= set("xyz"):
            raise ValueError(wrong)
        return (_number(point["x"]), _number(point["y"]), _number(point["z"]), trust)
    if not isinstance(point, list) or len(point) not in (2, 3, 4):
        raise ValueError(wrong)
    if len(point) == 2:
        raise ValueError(_IN_PICTURE)
    x, y, z, trust = map(_number, (*point, 1.0)[:4])
    return x, y, z, trust


def _number(value: Any) -> float:
    """Convert a number; null is nan."""
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"a number is wanted; found {str(value)[:80]!r}")
    return float(value)


def _times(frames: Iterable[Any]) -> Array | None:
    """Return times [s], where every frame has one."""
    seconds = {"time": 1.0, "timestamp": 1.0, "t": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3}
    times = []
    for frame in frames:
        key = next((key for key in seconds if isinstance(frame, dict) and key in frame), None)
        if key is None:
            return None
        times.append(_number(frame[key]) * seconds[key])
    return np.array(times)


def _names(file: Path, head: Mapping[str, Any], bodies: list[Any]) -> Sequence[str]:
    """Return the names of the points, the file's own or those that belong to their number."""
    own = list(dict.fromkeys(name for body in bodies if isinstance(body, dict) for name in body))
    counts = sorted({len(body) for body in bodies if isinstance(body, list) and body})
    if own and counts:
        raise FileFormatError(f"{file}: some frames name their keypoints and some do not")
    if own:
        return own
    if len(counts) != 1:
        raise FileFormatError(f"{file}: every frame needs the same number of keypoints; found {counts[:8] or 'none'}")
    listed = ("names", "joint_names", "keypoint_names")
    names = next((head[key] for key in listed if isinstance(head.get(key), list)), None)
    if names is not None and len(names) == counts[0]:
        return [str(name) for name in names]
    known: dict[int, list[str]] = load_names("joint_orders.yaml")["by_count"]
    if counts[0] in known:
        return known[counts[0]]
    raise FileFormatError(
        f"{file}: {counts[0]} keypoints without names; give each a name, or names beside the frames "
        f'({{"names": [...], "frames": [...]}}); known by their number are {", ".join(map(str, known))}'
    )


def _table(file: Path, names: Sequence[str], bodies: list[Any]) -> Array:
    """Return x, y, z and confidence of all points in all frames, shape (n, k, 4)."""
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
    return table


def _require_space(file: Path, positions: Array, names: Sequence[str]) -> None:
    """Refuse MediaPipe's landmarks of the picture: there the hips are anywhere in it, and their depth is zero."""
    if "left_hip" in names and "right_hip" in names:
        middle = positions[:, [names.index("left_hip"), names.index("right_hip")]].mean(axis=1)
        seen = np.isfinite(middle).all(axis=1)
        if seen.any():
            x, y, depth = np.median(np.abs(middle[seen]), axis=0)
            if depth < 0.05 and max(x, y) > 0.2:
                raise FileFormatError(f"{file}: {_IN_PICTURE}")


@np.errstate(over="ignore", invalid="ignore")  # points out of reach keep no lengths
def _wobble(names: Sequence[str], positions: Array) -> float:
    """Measure how far the arms change their lengths and differ, for points in an order of names."""
    total = 0.0
    for start, end in pairwise(("shoulder", "elbow", "wrist")):
        lengths = []
        for side in ("left", "right"):
            a, b = (positions[:, names.index(f"{side}_{part}")] for part in (start, end))
            bone = np.linalg.norm(b - a, axis=-1)
            lengths.append(bone[bone > 0])
        if not all(map(len, lengths)):
            return np.inf
        left, right = map(np.median, lengths)
        total += sum(np.std(bone) / np.median(bone) for bone in lengths) + abs(np.log(left / right))
    return float(total)
