"""The content of a C3D file, read without native code.

A C3D file is a row of 512-byte blocks: a header, the parameters (groups and parameters in one chain, each entry with
the distance to the next) and the data, frame by frame: four numbers for each point, then what force plates and the like
measured, which is passed over. Described at https://www.c3d.org.
"""

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maniport.errors import FileFormatError
from maniport.input_limits import FRAMES, PLACES, POINTS, RECORDING_BYTES, read_whole, require_at_most
from maniport.validation import Array

BLOCK = 512
MARK = 0x50
INTEL, DEC, MIPS = 84, 85, 86
"""Processors: how numbers are stored. DEC's have the order of Intel's, but their own floats."""
TEXT, BYTE, SHORT, REAL = -1, 1, 2, 4
NEEDED = {"USED": SHORT, "SCALE": REAL, "RATE": REAL, "DATA_START": SHORT, "LABELS": TEXT}
"""Parameters of the group POINT and their types, without which points cannot be read."""
LONGEST = 65_535
"""More frames than fit into the header's words are said elsewhere."""

Parameters = dict[str, list[float] | list[str]]


@dataclass(frozen=True, eq=False)
class C3D:
    """What is read of a C3D file.

    Attributes
    ----------
    points : ndarray, shape (n_frames, n_points, 3)
        In the file's unit.
    seen : ndarray of bool, shape (n_frames, n_points)
        Where the file does not mark a point as lost.
    parameters : dict
        Those of the group POINT: lists of numbers or of texts.
    """

    points: Array
    seen: NDArray[np.bool_]
    parameters: Parameters


def read_c3d(file: Path) -> C3D:
    """Read the points of a C3D file and the parameters that belong to them."""
    content = read_whole(file, (), RECORDING_BYTES)
    if len(content) < BLOCK:
        raise FileFormatError(f"{file}: the file is cut off in its header: {len(content)} of {BLOCK} bytes")
    if content[1] != MARK:
        raise FileFormatError(
            f"{file}: this is no C3D file: its second byte is {content[1]:#04x} instead of {MARK:#04x}"
        )
    start = BLOCK * (max(content[0], 1) - 1)
    section = content[start : start + BLOCK * content[start + 2]] if start + 4 <= len(content) else b""
    if len(section) < 4 or section[3] not in (INTEL, DEC, MIPS):
        raise FileFormatError(f"{file}: its parameters are missing or damaged at byte {start}")
    if len(section) < BLOCK * section[2]:
        raise FileFormatError(
            f"{file}: the file is cut off in its parameters: {len(section)} of {BLOCK * section[2]} bytes"
        )
    groups = _parameters(file, section, start)
    point = groups.get("POINT", {})
    for name, kind in NEEDED.items():
        if point.get(name, (0, []))[0] != kind or (kind != TEXT and not point[name][1]):
            raise FileFormatError(f"{file}: its parameters are damaged: POINT:{name} is missing or of the wrong type")
    values = {name: value for name, (_, value) in point.items()}
    points, seen = _points(file, content, section[3], values, groups.get("TRIAL", {}))
    return C3D(points, seen, values)


Parameter = tuple[int, list[float] | list[str]]


def _parameters(file: Path, section: bytes, start: int) -> dict[str, dict[str, Parameter]]:
    """Follow the chain of groups and parameters, each of which must lie inside the section and hold its own data."""
    order = ">" if section[3] == MIPS else "<"
    names: dict[int, str] = {}
    found: list[tuple[int, str, Parameter]] = []
    at, step = 4, 1
    while step and at + 2 <= len(section) and section[at]:
        length, group = struct.unpack_from("bb", section, at)
        body = at + 2 + abs(length)
        step = struct.unpack_from(f"{order}h", section, body)[0] if body + 4 <= len(section) else -1
        end = body + step if step else len(section)
        name = section[at + 2 : body].decode("latin-1").strip().upper()
        parameter = None if group <= 0 or step < 0 else _parameter(section[:end], body + 2)
        if step < 0 or end > len(section) or group == 0 or (group > 0 and parameter is None):
            raise FileFormatError(f"{file}: its parameters are damaged at byte {start + at}")
        if parameter is None:
            names[-group] = name
        else:
            found.append((group, name, parameter))
        at = end
    orphan = next((name for group, name, _ in found if group not in names), None)
    if orphan is not None:
        raise FileFormatError(f"{file}: its parameters are damaged: {orphan} belongs to no group")
    groups: dict[str, dict[str, Parameter]] = {}
    for group, name, parameter in found:
        groups.setdefault(names[group], {})[name] = parameter
    return groups


def _parameter(section: bytes, at: int) -> Parameter | None:
    """Type and values of the parameter at a place; None when they do not end before the section does."""
    if at + 2 > len(section):
        return None
    kind, dimensions = struct.unpack_from("bB", section, at)
    extents = list(section[at + 2 : at + 2 + dimensions])
    count = math.prod(extents)
    data = section[at + 2 + dimensions : at + 2 + dimensions + abs(kind) * count]
    if kind not in (TEXT, BYTE, SHORT, REAL) or dimensions > 7 or len(extents) < dimensions:
        return None
    if len(data) < abs(kind) * count:
        return None
    if kind == TEXT:
        width = extents[0] if extents else 1
        return kind, [_text(data[i : i + width]) for i in range(0, len(data), max(width, 1))]
    return kind, _numbers(data, kind, section[3]).tolist()


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8").strip(" \0")
    except UnicodeDecodeError:
        return data.decode("latin-1").strip(" \0")


def _numbers(data: bytes, kind: int, processor: int) -> Array:
    """Numbers of a type as a processor stores them."""
    order = ">" if processor == MIPS else "<"
    if kind == REAL and processor == DEC:
        words = np.frombuffer(data, "<u2").reshape(-1, 2).astype(np.uint32)
        bits = (words[:, 0] << 16) | words[:, 1]
        return np.asarray(bits.view(np.float32).astype(np.float64) / 4)
    code = {BYTE: "i1", SHORT: "i2", REAL: "f4"}[kind]
    with np.errstate(invalid="ignore"):
        return np.frombuffer(data, f"{order}{code}").astype(np.float64)


def _points(
    file: Path, content: bytes, processor: int, values: Parameters, trial: dict[str, Parameter]
) -> tuple[Array, NDArray[np.bool_]]:
    """Points of all frames and where they were seen."""
    order = ">" if processor == MIPS else "<"
    _, analog, first, last = struct.unpack_from(f"{order}HHHH", content, 2)
    used, scale, begin = (float(values[name][0]) for name in ("USED", "SCALE", "DATA_START"))
    count, start = int(used) % 2**16, BLOCK * (int(begin) % 2**16 - 1)
    frames = _frame_count(last - first + 1, values, trial)
    kind = REAL if scale < 0 else SHORT
    size = kind * (4 * count + analog)
    for number, most, what in (
        (count, POINTS, "points"),
        (frames, FRAMES, "frames"),
        (frames * count, PLACES, "places"),
    ):
        require_at_most(number, most, what, file)
    if count == 0 or frames <= 0:
        raise FileFormatError(
            f"{file}: the file holds no points ({count} points, {max(frames, 0)} frames); "
            "rotations alone, as of Theia, are not read: export centers of joints as points"
        )
    if not math.isfinite(scale) or start < BLOCK:
        raise FileFormatError(f"{file}: its parameters are damaged: POINT:SCALE is {scale}, POINT:DATA_START {begin}")
    needed = start + frames * size
    if needed > len(content):
        raise FileFormatError(
            f"{file}: the file is cut off: its header announces {frames} frames of {count} points, that is "
            f"{needed} bytes; it ends after {len(content)}"
        )
    rows = np.frombuffer(content, np.uint8, frames * size, start).reshape(frames, size)[:, : kind * 4 * count]
    numbers = _numbers(rows.tobytes(), kind, processor).reshape(frames, count, 4)
    points = numbers[..., :3] if kind == REAL else numbers[..., :3] * scale
    return points, numbers[..., 3] >= 0


def _frame_count(header: int, values: Parameters, trial: dict[str, Parameter]) -> int:
    """How many frames there are; what does not fit into two bytes is said by TRIAL or by POINT:LONG_FRAMES."""
    if 0 < header < LONGEST:
        return header
    ends = [trial.get(f"ACTUAL_{end}_FIELD", (0, []))[1] for end in ("START", "END")]
    if all(len(end) == 2 for end in ends):
        first, last = (int(end[0]) % 2**16 + 2**16 * (int(end[1]) % 2**16) for end in ends)
        return last - first + 1
    for name in ("LONG_FRAMES", "FRAMES"):
        said = values.get(name) or [0.0]
        if isinstance(said[0], float) and math.isfinite(said[0]) and said[0] > header:
            return int(said[0])
    return header
