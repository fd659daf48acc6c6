"""Keypoints in JSON, which pose estimators write frame by frame."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError, counted
from maniport.mocap.readers import ImportOptions, arm_error, drop_untrusted, require_size
from maniport.mocap.readers.text import decoded
from maniport.mocap.readers.times import FileTimes, rates_of
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

_NAMES = load_names("file_keys.yaml")["json"]
KEYS: Mapping[str, Sequence[str]] = _NAMES
SECONDS: Mapping[str, float] = _NAMES["seconds"]  # units of times, by key

_IN_IMAGE = (
    "these keypoints are positions in an image, not in space; write those in space (MediaPipe: pose_world_landmarks; "
    "OpenPose: pose_keypoints_3d), or use Pose2Sim or OpenCap (TRC)"
)

Point = list[float]  # x, y, z and confidence
Body = list[Point] | dict[str, Point]  # keypoints of one person, by name where they have names
Content = Mapping[str, object]  # an object of JSON


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a JSON file of frames, a frame a line, or a folder of files, one a frame in the order of their names."""
    head, frames = _head_and_frames(file)
    bodies = [_points(frame) for frame in frames]
    names = _names(head, bodies)
    require_size(len(bodies), len(names))

    table = _table(bodies, names)
    positions = table[..., :3]
    is_mediapipe = len(names) == 33
    if is_mediapipe and {"left_hip", "right_hip"} <= set(names):
        _require_in_space(positions[:, [names.index("left_hip"), names.index("right_hip")]])
    notes = drop_untrusted(positions, table[..., 3])

    orders = load_names("joint_orders.yaml")
    if names is orders["by_count"][17] and arm_error(orders["human36m"], positions) < arm_error(
        names, positions
    ):
        names = orders["human36m"]
        notes.append(
            "17 keypoints taken in the order of Human3.6M, not of COCO: in it the arms keep their lengths"
        )
    crowded = 0  # frames with several people
    for frame in frames:
        people = _first_list(frame, KEYS["people"])
        crowded += people is not None and len(people) > 1
    if crowded:
        notes.append(f"several people in {counted(crowded, 'frame')}; the first one was taken")

    stated = _times(head, frames)
    unit = head.get("unit")
    if not isinstance(unit, str):
        unit = "m" if is_mediapipe else ""
    return options.recording(file, names, positions, stated, unit, notes=notes)


def _head_and_frames(file: Path) -> tuple[Content, list[Content]]:
    """Return what a file states beside its frames, empty where nothing is, and the frames."""
    head: Content = {}
    if file.is_dir():
        content: object = _contents_of_folder(file)
    else:
        content = _loaded(file, KEYPOINTS_BYTES)
        if isinstance(content, dict):
            head = content
            content = _frames_of_tracks(head) or _frames_of_array(head)
            if not content:
                content = _first_list(head, KEYS["frames"])
            if content is None:
                content = [head]
    if not isinstance(content, list) or not content:
        raise ValueError("the file holds no frames")
    require_at_most(len(content), FRAMES, "frames")

    frames: list[Content] = []
    for frame in content:
        if isinstance(frame, dict):
            frames.append(frame)
        else:
            frames.append({"points": frame})
    return head, frames


def _contents_of_folder(folder: Path) -> list[object]:
    """Return the contents of all files of a folder, in the order of their names."""
    files = sorted(folder.glob("*.json"))
    require_at_most(len(files), FRAMES, "files")
    size = sum(file.lstat().st_size for file in files)
    require_at_most(size, KEYPOINTS_BYTES, "bytes in its files")
    return [_loaded(file, SETTINGS_BYTES) for file in files]


def _table(bodies: Sequence[Body], names: Sequence[str]) -> Array:
    """Return positions and confidences, shape (n, len(names), 4), nan where a point is not seen."""
    table = np.full((len(bodies), len(names), 4), np.nan)
    for row, body in zip(table, bodies, strict=True):
        if isinstance(body, dict):
            for i, name in enumerate(names):
                if name in body:
                    row[i] = body[name]
        elif body:
            row[:] = body
    return table


def _require_in_space(hips: Array) -> None:
    """Raise where the hips (n, 2, 3) are those of MediaPipe's landmarks of the image: anywhere, with zero depth."""
    middle = hips.mean(axis=1)
    if not np.isfinite(middle).all(axis=1).any():
        return
    x, y, depth = np.nanmedian(np.abs(middle), axis=0)
    if depth < 0.05 and max(x, y) > 0.2:
        raise ValueError(_IN_IMAGE)


def _frames_of_array(head: Content) -> list[object]:
    """Return the frames of positions (n, k, 3) in nested lists; empty where there are none."""
    positions = head.get("positions")
    if not isinstance(positions, list) or not positions or not isinstance(positions[0], list):
        return []
    is_array = bool(positions[0]) and isinstance(positions[0][0], list)
    if is_array:
        return positions
    return []


def _frames_of_tracks(head: Content) -> list[Content]:
    """Return the frames of tracks by name, each a list of x, y, z; empty where a file has none."""
    tracks = []
    lengths = set()
    for name, values in head.items():
        if isinstance(values, list) and values and isinstance(values[0], list):
            if len(values[0]) != 3 or isinstance(values[0][0], (list, dict)):
                return []
            tracks.append(name)
            lengths.add(len(values))
    if len(lengths) != 1 or set(tracks) & {*KEYS["points"], *KEYS["people"], *KEYS["frames"]}:
        return []
    return _frames_by_key(head, [*tracks, *SECONDS], lengths.pop())


def _frames_by_key(head: Content, keys: Sequence[str], count: int) -> list[Content]:
    """Return frames with the values of lists of so many values."""
    frames: list[dict[str, object]] = [{} for _ in range(count)]
    for key in keys:
        values = head.get(key)
        if isinstance(values, list) and len(values) == count:
            for frame, value in zip(frames, values, strict=True):
                frame[key] = value
    return [*frames]


def _times(head: Content, frames: Sequence[Content]) -> FileTimes:
    """Return the times of the frames, nan where one has none, and the rates of the file."""
    clocks: dict[str, Array] = {}
    for key, seconds in SECONDS.items():
        if not any(key in frame for frame in frames):
            continue
        try:
            clock = [_number(frame.get(key)) for frame in frames]
        except ValueError:  # a date, which is of no use beside a clock
            if clocks:
                continue
            raise
        clocks[key] = seconds * np.array(clock)
    rates, wrong_rates = rates_of({key: head[key] for key in KEYS["rates"] if key in head})
    return FileTimes(clocks, _frame_numbers(frames), rates, wrong_rates)


def _frame_numbers(frames: Sequence[Content]) -> Array | None:
    """Return the numbers of the frames, which skip those that were lost; None where one has none."""
    for key in KEYS["numbers"]:
        if all(key in frame for frame in frames):
            return _as_numbers([frame[key] for frame in frames])
    return None


def _as_numbers(values: Sequence[object]) -> Array | None:
    """Convert numbers, shape (n,); None where one is none."""
    numbers = []
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        numbers.append(value)
    with suppress(OverflowError):
        return np.array(numbers, dtype=np.float64)
    return None


def _loaded(file: Path, most: int) -> object:
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


def _first_key(values: Content, keys: Iterable[str]) -> str | None:
    """Return the first of some keys that has a value."""
    return next((key for key in keys if key in values), None)


def _first_list(values: Content, keys: Iterable[str]) -> list[object] | None:
    """Return the list under the first of some keys that has one."""
    for key in keys:
        value = values.get(key)
        if isinstance(value, list):
            return value
    return None


def _points(frame: object) -> Body:
    """Return the keypoints of one frame; empty where nobody was detected."""
    if isinstance(frame, Mapping):
        return _points_of_mapping(frame)
    if isinstance(frame, list):
        return _points_of_list(frame)
    return []


def _points_of_mapping(frame: Content) -> Body:
    """Return the keypoints of the first person, those under a key, or those by name."""
    people = _first_list(frame, KEYS["people"])
    if people is not None:
        return _points(people[0]) if people else []
    key = _first_key(frame, KEYS["points"])
    if key is not None:
        scores = _first_list(frame, KEYS["confidences"])
        return _points(_with_confidence(frame[key], scores, key))

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


def _points_of_list(frame: list[object]) -> Body:
    """Return keypoints, by name where all have names; of several people those of the first."""
    first = frame[0] if frame else None
    if isinstance(first, list) and first and isinstance(first[0], (list, dict)):
        return _points(first)
    points = []
    named = dict[str, Point]()
    all_named = True
    for keypoint in frame:
        point = _point(keypoint)
        points.append(point)
        name = keypoint.get("name") if isinstance(keypoint, dict) else None
        if isinstance(name, str):
            named[name] = point
        else:
            all_named = False
    return named if all_named else points


def _with_confidence(points: object, scores: list[object] | None, key: str) -> object:
    """Return the keypoints under a key: flat lists of numbers in threes or fours, others with their confidences."""
    if not isinstance(points, list) or not points:
        return points
    if key.lower().endswith("3d") and not isinstance(points[0], (list, dict)):
        points = _grouped(points)
    if not scores or len(scores) != len(points):
        return points
    with_scores = []
    for point, score in zip(points, scores, strict=True):
        if not isinstance(point, list) or len(point) != 3:
            return points
        with_scores.append([*point, score])
    return with_scores


def _grouped(numbers: list[object]) -> list[list[object]]:
    """Group numbers by points: in fours, with confidences, where that makes a known number of points."""
    width = 3
    if len(numbers) % 4 == 0 and len(numbers) // 4 in load_names("joint_orders.yaml")["by_count"]:
        width = 4
    return [numbers[i : i + width] for i in range(0, len(numbers), width)]


def _point(point: object) -> Point:
    """Convert a keypoint: a list of x, y, z and perhaps the confidence, or a mapping."""
    confidence: object = 1.0
    if isinstance(point, dict):
        key = _first_key(point, KEYS["confidence"])
        if key is not None:
            confidence = point[key]
        point = point.get("position", point)
        if isinstance(point, dict):
            point = [point[axis] for axis in _axes_of(point) if axis in point]
    if isinstance(point, list) and len(point) == 2:
        raise ValueError(_IN_IMAGE)
    if not isinstance(point, list) or len(point) not in (3, 4):
        raise ValueError(
            f"a keypoint must be x, y, z, and optionally its confidence; found {str(point)[:80]}"
        )
    values = (*point, confidence)
    return [_number(value) for value in values[:4]]


def _axes_of(point: Content) -> str:
    """Return the keys of the coordinates of a keypoint, in small letters or in capitals."""
    if "X" in point and "x" not in point:
        return "XYZ"
    return "xyz"


def _number(value: object) -> float:
    """Convert a number; null is nan."""
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"expected a number; found {str(value)[:80]!r}")
    return float(value)


def _names(head: Content, bodies: Sequence[Body]) -> Sequence[str]:
    """Return the names of the points, those of the file or those of an order with their number."""
    names = dict[str, None]()
    counts = set()
    for body in bodies:
        if isinstance(body, dict):
            names |= dict.fromkeys(body)
        elif body:
            counts.add(len(body))
    if names and counts:
        raise ValueError("some frames name their keypoints and some do not")
    if names:
        return list(names)
    if len(counts) != 1:
        raise ValueError(
            f"every frame needs the same number of keypoints; found {sorted(counts)[:8] or 'none'}"
        )
    (count,) = counts
    listed = _first_list(head, KEYS["names"])
    if listed is not None and len(listed) == count:
        return list(map(str, listed))
    orders: dict[int, list[str]] = load_names("joint_orders.yaml")["by_count"]
    if count in orders:
        return orders[count]
    raise ValueError(
        f"{count} keypoints without names; give each a name, or list them in the file "
        f'({{"names": [...], "frames": [...]}}); recognized by their number are {", ".join(map(str, orders))}'
    )
