"""Keypoints in JSON, which pose estimators write frame by frame."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from maniport.errors import FileFormatError, counted
from maniport.mocap.readers import ImportOptions, arm_error, drop_untrusted, require_size
from maniport.mocap.readers.text import decoded
from maniport.mocap.readers.times import FileTimes
from maniport.mocap.recording import Recording
from maniport.mocap.roles import load_names
from maniport.util.input_limits import (
    FRAMES,
    KEYPOINTS_BYTES,
    PLACES,
    SETTINGS_BYTES,
    read_whole,
    require_at_most,
)
from maniport.util.validation import Array

KEYS: dict[str, Any] = load_names("file_keys.yaml")["json"]

_IN_IMAGE = (
    "these keypoints are positions in an image, not in space; write those in space (MediaPipe: pose_world_landmarks; "
    "OpenPose: pose_keypoints_3d), or use Pose2Sim or OpenCap (TRC)"
)

Point = list[float]  # x, y, z and confidence


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a JSON file of frames, a frame a line, or a folder of files, one a frame in the order of their names."""
    head: Mapping[str, Any] = {}
    if file.is_dir():
        parts = sorted(file.glob("*.json"))
        require_at_most(len(parts), FRAMES, "files")
        require_at_most(
            sum(part.lstat().st_size for part in parts), KEYPOINTS_BYTES, "bytes in its files"
        )
        frames = [_loaded(part, SETTINGS_BYTES) for part in parts]
    else:
        frames = _loaded(file, KEYPOINTS_BYTES)
        if isinstance(frames, dict):
            head = frames
            frames = _frames_of_tracks(head) or _frames_of_array(head)
            if not frames:
                frames = head.get(_first(head, KEYS["frames"], list), [head])
    if not isinstance(frames, list) or not frames:
        raise ValueError("the file holds no frames")
    require_at_most(len(frames), FRAMES, "frames")
    frames = [frame if isinstance(frame, dict) else {"points": frame} for frame in frames]
    bodies = [_points(frame) for frame in frames]
    names = _names(head, bodies)
    require_size(len(bodies), len(names))
    table = np.full((len(bodies), len(names), 4), np.nan)
    for row, body in zip(table, bodies, strict=True):
        if body:
            if isinstance(body, dict):
                row[:] = [body.get(name, [np.nan] * 4) for name in names]
            else:
                row[:] = body
    positions = table[..., :3]
    mediapipe = len(names) == 33
    if mediapipe and {"left_hip", "right_hip"} <= set(names):
        # In MediaPipe's landmarks of the image the hips are anywhere, and their depth is zero.
        middle = positions[:, [names.index("left_hip"), names.index("right_hip")]].mean(axis=1)
        if np.isfinite(middle).all(axis=1).any():
            x, y, depth = np.nanmedian(np.abs(middle), axis=0)
        else:
            x = 0.0
            y = 0.0
            depth = 0.0
        if depth < 0.05 and max(x, y) > 0.2:
            raise ValueError(_IN_IMAGE)
    notes = drop_untrusted(positions, table[..., 3])
    orders = load_names("joint_orders.yaml")
    if names is orders["by_count"][17] and arm_error(orders["human36m"], positions) < arm_error(
        names, positions
    ):
        names = orders["human36m"]
        notes.append(
            "17 keypoints taken in the order of Human3.6M, not of COCO: in it the arms keep their lengths"
        )
    if several := sum(
        len(frame.get(_first(frame, KEYS["people"], list), ())) > 1 for frame in frames
    ):
        notes.append(f"several people in {counted(several, 'frame')}; the first one was taken")
    stated = _times(head, frames)
    if isinstance(head.get("unit"), str):
        unit = head["unit"]
    elif mediapipe:
        unit = "m"
    else:
        unit = ""
    return options.recording(file, names, positions, stated, unit, notes=notes)


def _frames_of_array(head: Mapping[str, Any]) -> list[Any]:
    """Return the frames of positions (n, k, 3) in nested lists; empty where there are none."""
    positions = head.get("positions")
    if not isinstance(positions, list) or not positions or not isinstance(positions[0], list):
        return []
    is_array = bool(positions[0]) and isinstance(positions[0][0], list)
    if is_array:
        return positions
    return []


def _frames_of_tracks(head: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the frames of tracks by name, each a list of x, y, z; empty where a file has none."""
    tracks = {}
    for name, values in head.items():
        if isinstance(values, list) and values and isinstance(values[0], list):
            if len(values[0]) != 3 or isinstance(values[0][0], (list, dict)):
                return []
            tracks[name] = values
    lengths = {len(values) for values in tracks.values()}
    if len(lengths) != 1 or set(tracks) & {*KEYS["points"], *KEYS["people"], *KEYS["frames"]}:
        return []
    (count,) = lengths
    frames: list[dict[str, Any]] = [{} for _ in range(count)]
    for key in (*tracks, *KEYS["seconds"]):
        values = head.get(key)
        if isinstance(values, list) and len(values) == count:
            for frame, value in zip(frames, values, strict=True):
                frame[key] = value
    return frames


def _times(head: Mapping[str, Any], frames: Sequence[Mapping[str, Any]]) -> FileTimes:
    """Return the times of the frames, nan where one has none, and the rates of the file."""
    clocks: dict[str, Any] = {}
    for key, seconds in KEYS["seconds"].items():
        if not any(key in frame for frame in frames):
            continue
        try:
            clock = [_number(frame.get(key)) for frame in frames]
        except ValueError:  # a date, which is of no use beside a clock
            if clocks:
                continue
            raise
        clocks[key] = seconds * np.array(clock)
    rates = {}
    for key in KEYS["rates"]:
        if key in head:
            try:
                rates[key] = _number(head[key])
            except ValueError:
                if not clocks:
                    raise
    return FileTimes(clocks, _frame_numbers(frames), rates)


def _frame_numbers(frames: Sequence[Mapping[str, Any]]) -> Array | None:
    """Return the numbers of the frames, which skip those that were lost; None where one has none."""
    key = next((key for key in KEYS["numbers"] if all(key in frame for frame in frames)), None)
    if key is None:
        return None
    numbers = [frame[key] for frame in frames]
    if any(isinstance(number, bool) or not isinstance(number, int | float) for number in numbers):
        return None
    with suppress(OverflowError):
        return np.array(numbers, dtype=np.float64)
    return None


def _loaded(file: Path, most: int) -> Any:
    """Parse a JSON file, or one with a JSON value on each line."""
    content = read_whole(file, (), most)
    # Lists and mappings take more memory than their numbers.
    require_at_most(
        content.count(b"[") + content.count(b"{"), PLACES // 10, "lists and mappings", file
    )
    try:
        try:
            return json.loads(content)  # bytes: in UTF-8 or UTF-16
        except json.JSONDecodeError as error:
            if error.msg != "Extra data":
                raise
            return [json.loads(line) for line in decoded(content).splitlines() if line.strip()]
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: not readable as JSON: {error}") from None


def _first(values: Mapping[str, Any], keys: Iterable[str], kind: type = object) -> str:
    """Return the first of some keys with a value of a type; empty where there is none."""
    return next((key for key in keys if key in values and isinstance(values[key], kind)), "")


def _points(frame: Any) -> list[Point] | dict[str, Point]:
    """Return the keypoints of one frame, by name where they have names; empty where nobody was detected."""
    if isinstance(frame, dict):
        if key := _first(frame, KEYS["people"], list):
            if frame[key]:
                return _points(frame[key][0])
            return []
        if key := _first(frame, KEYS["points"]):
            return _points(
                _with_confidence(
                    frame[key], frame.get(_first(frame, KEYS["confidences"], list)), key
                )
            )
        named = {}
        for name, point in frame.items():
            if isinstance(point, (dict, list)):
                named[str(name)] = point
        if any(name.endswith("2d") for name in named):
            raise ValueError(_IN_IMAGE)
        if not named:
            wanted = ", ".join((*KEYS["points"], *KEYS["people"]))
            raise ValueError(
                f"no frame with keypoints by name, or with one of {wanted}; found {str([*frame])[:200]}"
            )
        return {name: _point(point) for name, point in named.items()}
    if not isinstance(frame, list):
        return []
    if frame and isinstance(frame[0], list) and frame[0] and isinstance(frame[0][0], (list, dict)):
        return _points(frame[0])  # several people: the first
    points = [_point(point) for point in frame]
    names = []
    for point in frame:
        names.append(point.get("name") if isinstance(point, dict) else None)
    if all(isinstance(name, str) for name in names):
        return dict(zip(map(str, names), points, strict=True))
    return points


def _with_confidence(points: Any, scores: Any, key: str) -> Any:
    """Return the keypoints under a key: flat lists of numbers in threes or fours, others with their confidences."""
    if not isinstance(points, list) or not points:
        return points
    if key.lower().endswith("3d") and not isinstance(points[0], (list, dict)):
        fours = (
            len(points) % 4 == 0 and len(points) // 4 in load_names("joint_orders.yaml")["by_count"]
        )
        if fours:
            width = 4
        else:
            width = 3
        points = [points[i : i + width] for i in range(0, len(points), width)]
    if (
        scores
        and len(scores) == len(points)
        and all(isinstance(point, list) and len(point) == 3 for point in points)
    ):
        points = [[*point, score] for point, score in zip(points, scores, strict=True)]
    return points


def _point(point: Any) -> Point:
    confidence: Any = 1.0
    if isinstance(point, dict):
        confidence = point.get(_first(point, KEYS["confidence"]), 1.0)
        point = point.get("position", point)
        if isinstance(point, dict):
            point = [point[axis] for axis in _axes_of(point) if axis in point]
    if isinstance(point, list) and len(point) == 2:
        raise ValueError(_IN_IMAGE)
    if not isinstance(point, list) or len(point) not in (3, 4):
        raise ValueError(
            f"a keypoint must be x, y, z, and optionally its confidence; found {str(point)[:80]}"
        )
    return [_number(value) for value in (*point, confidence)[:4]]


def _axes_of(point: Mapping[str, Any]) -> str:
    """Return the keys of the coordinates of a keypoint, in small letters or in capitals."""
    if "X" in point and "x" not in point:
        return "XYZ"
    return "xyz"


def _number(value: Any) -> float:
    """Convert a number; null is nan."""
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"expected a number; found {str(value)[:80]!r}")
    return float(value)


def _names(head: Mapping[str, Any], bodies: list[Any]) -> Sequence[str]:
    """Return the names of the points, the file's own or those of an order with their number."""
    own = list(dict.fromkeys(name for body in bodies if isinstance(body, dict) for name in body))
    counts = sorted({len(body) for body in bodies if isinstance(body, list) and body})
    if own and counts:
        raise ValueError("some frames name their keypoints and some do not")
    if own:
        return own
    if len(counts) != 1:
        raise ValueError(
            f"every frame needs the same number of keypoints; found {counts[:8] or 'none'}"
        )
    key = _first(head, KEYS["names"], list)
    if key and len(head[key]) == counts[0]:
        return list(map(str, head[key]))
    orders: dict[int, list[str]] = load_names("joint_orders.yaml")["by_count"]
    if counts[0] in orders:
        return orders[counts[0]]
    raise ValueError(
        f"{counts[0]} keypoints without names; give each a name, or list them in the file "
        f'({{"names": [...], "frames": [...]}}); recognized by their number are {", ".join(map(str, orders))}'
    )
