"""C3D, the binary format of optical motion capture, read without native code.

A C3D file is a row of 512-byte blocks: a header, the parameters (groups and parameters in one chain, each entry with
the distance to the next) and the data, frame by frame: four numbers for each point, then analog channels, which are
skipped. Described at https://www.c3d.org.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from maniport.errors import argument
from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.times import FileTimes
from maniport.mocap.recording import Recording
from maniport.util.input_limits import RECORDING_BYTES, read_whole
from maniport.util.validation import Array

BLOCK = 512
DEC = 85
MIPS = 86
"""Processors. DEC's numbers have the order of Intel's (84), but their own floats; those of MIPS are big-endian."""

Parameter = Sequence[float | str]  # The numbers or the texts of a parameter
QUOTES = " \"'"  # Signs around labels

TEXT = -1
SHORT = 2
REAL = 4
TYPES = {1: "i1", SHORT: "i2", REAL: "f4"}
ORDER = {84: "<", DEC: "<", MIPS: ">"}


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a C3D file; see `maniport.mocap.readers.read_recording`."""
    content = read_whole(file, (), RECORDING_BYTES)
    section, start = _parameter_section(content)
    values = _parameters(section, start)
    positions = _points(content, section[3], values)
    rate = _number(values, "RATE")
    if options.rate is None and not 0 < rate < np.inf:
        raise ValueError(
            f"POINT:RATE must be a positive number; found {rate}; {argument('rate')} sets the frames per second"
        )
    stated = FileTimes(rates={"POINT:RATE": rate, "header": _header_rate(content, section[3])})
    names = _names(values, positions.shape[1])
    unit = str((values.get("POINT:UNITS") or [""])[0])
    return options.recording(file, names, positions, stated, unit)


def _parameter_section(content: bytes) -> tuple[bytes, int]:
    """Return the section of the parameters, and the byte at which it begins."""
    if len(content) < BLOCK:
        raise ValueError(f"the file is cut off in its header: {len(content)} of {BLOCK} bytes")
    if content[1] != 0x50:
        raise ValueError(
            f"this is no C3D file: its second byte is {content[1]:#04x} instead of 0x50"
        )
    start = BLOCK * (max(content[0], 1) - 1)
    section = b""
    if start + 4 <= len(content):
        section = content[start : start + BLOCK * content[start + 2]]
    if len(section) < 4 or section[3] not in ORDER:
        raise ValueError(f"its parameters are missing or damaged at byte {start}")
    if len(section) < BLOCK * section[2]:
        raise ValueError(
            f"the file is cut off in its parameters: {len(section)} of {BLOCK * section[2]} bytes"
        )
    return section, start


def _names(values: Mapping[str, Parameter], count: int) -> list[str]:
    """Return the names of points: labels without the subject's prefix, as long as all stay different."""
    labels = []
    for number in range(1, 100):  # more than 255 labels continue in LABELS2, …
        key = "POINT:LABELS" if number == 1 else f"POINT:LABELS{number}"
        for label in values.get(key, []):
            labels.append(str(label).strip(QUOTES))
    labels += [""] * count
    names = []
    bare = []
    for i, label in enumerate(labels[:count]):
        name = label or f"point{i + 1}"
        names.append(name)
        bare.append(name.rpartition(":")[2].strip(QUOTES))
    if len(set(bare)) == len(bare):
        return bare
    return names


def _header_rate(content: bytes, processor: int) -> float:
    """Return the frames per second of the header, which repeats those of the parameters; zero where unset."""
    return float(_numbers(content[20:24], REAL, processor)[0])


def _parameters(section: bytes, start: int) -> dict[str, Parameter]:
    """Return the parameters by ``GROUP:NAME``; each entry must lie inside the section and hold its own data."""
    groups: dict[int, str] = {}
    parameters: list[tuple[int, str, Parameter]] = []
    at = 4
    end = -1
    while end != len(section) and at + 2 <= len(section) and section[at]:
        length, group = struct.unpack_from("bb", section, at)
        body = at + 2 + abs(length)
        step = struct.unpack_from(f"{ORDER[section[3]]}h", section[body : body + 2] + bytes(2))[0]
        if step:
            end = body + step
        else:
            end = len(section)
        name = section[at + 2 : body].decode("latin-1").strip().upper()
        if not body + 2 <= end <= len(section) or group == 0:
            raise ValueError(f"its parameters are damaged at byte {start + at}")
        if group < 0:
            groups[-group] = name
        else:
            parameters.append((group, name, _values(section[body + 2 : end], section[3], name)))
        at = end
    values = {}
    for group, name, of_name in parameters:
        if group not in groups:
            raise ValueError(f"its parameters are damaged: {name} belongs to no group")
        values[f"{groups[group]}:{name}"] = of_name
    return values


def _values(data: bytes, processor: int, name: str) -> Parameter:
    """Return the texts or numbers of a parameter."""
    kind, dimensions = struct.unpack_from("bB", data + bytes(2))
    extents = data[2 : 2 + dimensions]
    start = 2 + dimensions
    count = math.prod(extents)
    stop = start + abs(kind) * count
    if kind not in (TEXT, *TYPES) or stop > len(data):
        raise ValueError(
            f"its parameters are damaged: {name} has the type {kind} and {count} values"
        )
    if kind != TEXT:
        return list(_numbers(data[start:stop], kind, processor))
    width = max(extents[0] if extents else 1, 1)
    return [_text(data[i : i + width]) for i in range(start, stop, width)]


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8").strip(" \0")
    except UnicodeDecodeError:
        return data.decode("latin-1").strip(" \0")


def _number(values: Mapping[str, Parameter], name: str) -> float:
    """Return the first number of a parameter of points."""
    numbers = values.get(f"POINT:{name}") or [""]
    number = numbers[0]
    if not isinstance(number, float):
        raise ValueError(
            f"its parameters are damaged: POINT:{name} is missing or of the wrong type"
        )
    return number


def _numbers(data: bytes, kind: int, processor: int) -> Array:
    """Decode numbers of a type as a processor stores them."""
    if kind == REAL and processor == DEC:
        words = np.frombuffer(data, "<u2").reshape(-1, 2).astype(np.uint32)
        bits = (words[:, 0] << 16) | words[:, 1]
        return np.asarray(bits.view(np.float32).astype(np.float64) / 4)
    with np.errstate(invalid="ignore"):
        return np.frombuffer(data, ORDER[processor] + TYPES[kind]).astype(np.float64)


def _points(content: bytes, processor: int, values: Mapping[str, Parameter]) -> Array:
    """Return the points (n_frames, n_points, 3) in the file's unit; nan where they are invalid."""
    _, analog, first, last = struct.unpack_from(f"{ORDER[processor]}HHHH", content, 2)
    used = _number(values, "USED")
    scale = _number(values, "SCALE")
    begin = _number(values, "DATA_START")
    count = int(used) % 2**16
    start = BLOCK * (int(begin) % 2**16 - 1)
    frames = _frame_count(last - first + 1, values)
    if scale < 0:
        kind = REAL
    else:
        kind = SHORT
    size = kind * (4 * count + analog)
    require_size(frames, count)
    if count == 0 or frames <= 0:
        raise ValueError(
            f"the file holds no points ({count} points, {max(frames, 0)} frames); "
            "rotations alone, as of Theia, are not supported: export centers of joints as points"
        )
    if not math.isfinite(scale) or start < BLOCK:
        raise ValueError(
            f"its parameters are damaged: POINT:SCALE is {scale}, POINT:DATA_START {begin}"
        )
    needed = start + frames * size
    if needed > len(content):
        raise ValueError(
            f"the file is cut off: its header announces {frames} frames of {count} points, that is "
            f"{needed} bytes; it ends after {len(content)}"
        )
    rows = np.frombuffer(content, np.uint8, frames * size, start).reshape(frames, size)[
        :, : kind * 4 * count
    ]
    numbers = _numbers(rows.tobytes(), kind, processor).reshape(frames, count, 4)
    if kind == REAL:
        points = numbers[..., :3]
    else:
        points = numbers[..., :3] * scale
    points[~(numbers[..., 3] >= 0) | (points == 0).all(axis=-1)] = np.nan
    return points


def _frame_count(header: int, values: Mapping[str, Parameter]) -> int:
    """Return the number of frames; what exceeds two bytes is in TRIAL or in POINT:LONG_FRAMES."""
    if 0 < header < 65_535:
        return header
    start = values.get("TRIAL:ACTUAL_START_FIELD", [])
    end = values.get("TRIAL:ACTUAL_END_FIELD", [])
    if len(start) == len(end) == 2:
        first = _wide_number(start)
        return _wide_number(end) - first + 1
    for name in ("LONG_FRAMES", "FRAMES"):
        for count in values.get(f"POINT:{name}", [])[:1]:
            if isinstance(count, float) and header < count < np.inf:
                return int(count)
    return header


def _wide_number(words: Parameter) -> int:
    """Return a number of four bytes from two numbers of two bytes, the lower one first."""
    low, high = words
    return int(low) % 2**16 + 2**16 * (int(high) % 2**16)
