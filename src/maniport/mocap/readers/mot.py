"""MOT and STO, the tables of joint angles that OpenSim writes, as points of an arm with these angles.

Two families of coordinates are read. Those of Saul et al. (2015), MoBL-ARMS, are the joints of our own arm models.
Those of Rajagopal et al. (2016), which OpenCap and Pose2Sim use, rotate the humerus in the torso about z (right), x
(forward) and y (up) in this order; axes and offsets of elbow, forearm and wrist are those of the model
``LaiUhlrich2022.osim`` of OpenCap and of ``Rajagopal2015.osim``. Left arms are mirror images in both.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.arms import myoarm
from maniport.arms.human import JOINTS
from maniport.mocap.directions import HALF_WIDTH, TRUNK, synthetic_recording
from maniport.mocap.readers import ImportOptions
from maniport.mocap.readers.text import (
    LARGEST_ANGLE,
    Block,
    NumberTable,
    as_float,
    field_of,
    fields_of,
    is_cut_off,
    lines_of,
    positive_number,
    row_blocks,
    sliced,
)
from maniport.mocap.readers.times import FileTimes, FrameTimes
from maniport.mocap.recording import Recording
from maniport.util.validation import Array

HEADER = 200  # Lines within which the header must end
BLANKS = " ,;\t\"'"  # Around the entries of a header

RAJAGOPAL = ("arm_flex", "arm_add", "arm_rot", "elbow_flex", "pro_sup", "wrist_flex", "wrist_dev")
ENDINGS = {"right": ("", "_r"), "left": ("_l",)}  # of the names of the angles of an arm
MIRROR = {"right": 1.0, "left": -1.0}  # of the coordinate across the body
ARM_ANGLES = {*JOINTS, *RAJAGOPAL}
_SIDE = re.compile("_[rl]$")


class _Head(NamedTuple):
    """What a file states above its numbers."""

    header: Mapping[str, str]  # entries by their keys in lower case
    columns: Sequence[str]  # time, and coordinates of the model
    separator: str | None  # None where blanks separate the fields
    first: int  # number of the line of the first row, from one

    def blocks(self, file: Path) -> Iterator[Block]:
        """Iterate over the rows of numbers."""
        return row_blocks(file, self.first)


def read(file: Path, options: ImportOptions) -> Recording:
    """Read joint angles; see `maniport.mocap.readers.read_recording`."""
    head = _head(file)
    times: FrameTimes | None = None
    blocks = head.blocks(file)
    size = file.stat().st_size
    if options.crops:
        clock = []
        for block in blocks:
            clock += [as_float(field_of(row, head.separator, 0)) for row in block.lines]
        times = _times(options, head.header, np.array(clock))
        part = times.rows_between(options.start, options.stop)
        blocks = sliced(head.blocks(file), part)
        count = len(clock)
        times = times.part(part)
        size = 0
    angle_columns = []
    for i, name in enumerate(head.columns):
        if _SIDE.sub("", name) in ARM_ANGLES:
            angle_columns.append(i)
    reader = NumberTable(len(head.columns), [[0], angle_columns], head.separator)
    clocks, table = reader.read(blocks, size)
    if times is None:
        times = _times(options, head.header, clocks[:, 0])
        count = len(table)
    declared = head.header.get("nrows", "")
    if is_cut_off(declared, count):
        raise ValueError(
            f"the file is cut off: the header declares {declared} rows, and there are {count}"
        )

    angles = {head.columns[column]: table[:, i] for i, column in enumerate(angle_columns)}
    unit, notes, quality_warnings = _radians(angles, head.header.get("indegrees", "").lower())
    points: dict[str, Array] = {}
    for side in ENDINGS:
        points_of_side, note = _points_of_side(side, angles, unit, len(table))
        points |= points_of_side
        notes += note
    if not points:
        raise ValueError(
            f"no joint angles of an arm; needed are {', '.join(JOINTS[:4])}, or {', '.join(RAJAGOPAL[:4])} "
            f"with _r or _l; found {', '.join(head.columns[1:])[:300]}"
        )
    for name, point in TRUNK.items():
        points[name] = np.tile(np.array(point), (len(table), 1))
    positions = np.stack(list(points.values()), axis=1)
    return options.recording(file, list(points), positions, times, "m", notes, quality_warnings)


def _head(file: Path) -> _Head:
    """Read the lines up to the names of the columns."""
    head = list(islice(lines_of(file), HEADER))
    end = next((i for i, (_, line) in enumerate(head) if _is_end(line)), None)
    names = None
    if end is not None:
        names = next(((n, line) for n, line in head[end + 1 :] if line.strip()), None)
    if end is None or names is None:
        raise ValueError(
            "this is no table of OpenSim: it lacks the line endheader or the numbers after it"
        )
    header = _header([line for _, line in head[:end]])
    first, line = names
    columns, separator = _columns(line, first)
    row = next((line for number, line in head if number > first and line.strip()), "")
    if separator is None and row.count("\t") == len(columns) - 1:
        separator = "\t"  # of which single columns are read faster than of blanks
    return _Head(header, columns, separator, first + 1)


def _columns(line: str, number: int) -> tuple[list[str], str | None]:
    """Return the names of the columns in a line, and the separator; None for blanks."""
    separator = next((character for character in ",;" if character in line), None)
    # newer files write the path of a coordinate in the model, as /jointset/elbow/elbow_flexion/value
    columns = []
    for word in fields_of(line, separator):
        columns.append(word.lower().removesuffix("/value").rpartition("/")[2])
    while columns and not columns[-1]:
        columns.pop()
    if columns[:1] != ["time"]:
        raise ValueError(f"line {number} must name the columns, time first; found {line[:80]!r}")
    return columns, separator


def _points_of_side(
    side: str, angles: Mapping[str, Array], unit: float, count: int
) -> tuple[dict[str, Array], list[str]]:
    """Return the points (count, 3) of one arm from its joint angles, with a note; empty where it has none.

    `unit` is that of the angles [rad].
    """
    mirror = np.array([1.0, MIRROR[side], 1.0])
    for family, points_of in ((JOINTS, _saul), (RAJAGOPAL, _rajagopal)):
        recorded = {}
        for name in family:
            for ending in ENDINGS[side]:
                if name + ending in angles:
                    recorded[name] = unit * angles[name + ending]
        if not recorded.keys() >= set(family[:4]):
            continue

        q = np.zeros((count, len(family)))
        for i, name in enumerate(family):
            if name in recorded:
                q[:, i] = recorded[name]
        valid = (np.abs(q) < LARGEST_ANGLE).all(axis=1, keepdims=True)
        points = {}
        for name, position in points_of(np.where(valid, q, 0.0)).items():
            points[f"{side}_{name}"] = np.where(valid, position * mirror, np.nan)
        missing = ", ".join(name for name in family if name not in recorded)
        note = (
            f"points of the {side} arm from its joint angles ({', '.join(recorded)}), with the "
            "lengths of the model"
        )
        if missing:
            note += f"; not recorded and set to zero: {missing}"
        return points, [note]
    return {}, []


def _is_end(line: str) -> bool:
    return line.strip(BLANKS).lower() == "endheader"


def _header(lines: Sequence[str]) -> dict[str, str]:
    """Return the entries of the header by their keys in lower case; spreadsheets fill its lines with separators."""
    header = {}
    for line in lines:
        key, _, value = line.strip(BLANKS).partition("=")
        words = value.split()
        if words:
            header[key.strip().lower()] = words[0].strip(BLANKS)
    return header


def _times(options: ImportOptions, header: Mapping[str, str], clock: Array) -> FrameTimes:
    """Return the times of frames from their column and the rate that some programs write into the header."""
    rates = {}
    for key in ("datarate", "samplerate", "framerate", "rate"):
        rate = positive_number(header.get(key, ""))
        if rate is not None:
            rates[key] = rate
    stated = FileTimes({"time": clock}, rates=rates)
    return options.frame_times(stated, len(clock))


def _radians(angles: Mapping[str, Array], degrees: str) -> tuple[float, list[str], list[str]]:
    """Return radians per unit, from the header or by the angles, with notes and data-quality warnings."""
    full_turn = 2 * np.pi  # more than the range of any joint of an arm
    largest = 0.0
    for angle in angles.values():
        finite = np.abs(angle[np.isfinite(angle)])
        if len(finite):
            largest = max(largest, float(np.percentile(finite, 95)))
    if degrees == "no" and largest > full_turn:
        raise ValueError(
            f"the header declares angles in radians (inDegrees=no), but a joint of the arm is at "
            f"{largest:.4g}; if they are degrees write inDegrees=yes"
        )
    if degrees == "no":
        return 1.0, [], []
    if degrees == "" and largest <= full_turn:
        note = (
            "angles taken as radians: the header does not state the unit, and those of the arm are "
            "≤ 2 π"
        )
        return 1.0, [note], []
    warnings = []
    if degrees == "yes" and 0.0 < largest <= full_turn:
        warnings.append(
            f"all angles of the arm are within {largest:.2g}°: if they are radians, write inDegrees=no"
        )
    return np.radians(1.0), [], warnings


def _saul(q: Array) -> dict[str, Array]:
    """Return the points of our own right arm; x forward, y left, z up."""
    recording = synthetic_recording(myoarm(), q, np.arange(len(q)) / 100.0)
    return {name: recording.point(name) for name in recording.names if name not in TRUNK}


def _rajagopal(q: Array) -> dict[str, Array]:
    """Return the points of the right arm of Rajagopal's model; its axes are x forward, y up, z right [m]."""
    elbow_axis = np.array([0.22604696, 0.022269, 0.97386183])
    humerus = Rotation.from_euler("ZXY", q[:, [0, 1, 2]])
    ulna = humerus * Rotation.from_rotvec(q[:, 3:4] * elbow_axis)
    radius = ulna * Rotation.from_rotvec(q[:, 4:5] * [0.05639803, 0.99840646, 0.001952])
    hand = radius * Rotation.from_euler("ZX", q[:, 5:7])
    elbow = humerus.apply([0.013144, -0.286273, -0.009595])
    wrist = (
        elbow
        + ulna.apply([-0.006727, -0.013007, 0.026083])
        + radius.apply([-0.008797, -0.235841, 0.01361])
    )
    across = humerus.apply(HALF_WIDTH * elbow_axis)
    radial = radius.apply([0.0, 0.0, HALF_WIDTH])
    points = {
        "shoulder": np.zeros((len(q), 3)),
        "elbow": elbow,
        "wrist": wrist,
        "hand": wrist + hand.apply([0.0, -0.055, 0.0]),
        "elbow_medial": elbow - across,
        "elbow_lateral": elbow + across,
        "wrist_ulnar": wrist - radial,
        "wrist_radial": wrist + radial,
    }
    shoulder = np.array([0.0, -0.17, 0.0])  # of a right arm in the trunk [m]
    for name, point in points.items():
        points[name] = point[:, [0, 2, 1]] * [1.0, -1.0, 1.0] + shoulder
    return points
