"""BVH, a tree of joints with offsets, and their angles frame by frame."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maniport.errors import argument, counted
from maniport.mocap.cleaning import rest_frames, rest_pose_note
from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.text import (
    Block,
    NumberTable,
    Row,
    as_float,
    is_cut_off,
    lines_of,
    positive_number,
    row_blocks,
    sliced,
)
from maniport.mocap.readers.times import FileTimes, FrameTimes
from maniport.mocap.recording import Recording
from maniport.mocap.roles import END
from maniport.util.input_limits import FRAMES, POINTS, require_at_most
from maniport.util.validation import Array

FRAMES_AT_ONCE = 2000
LONGEST_FRAME_TIME = 2.0  # [s]; motion is not captured so slowly, and longer times are milliseconds
_STATEMENT = re.compile(
    r"([{}])|(?=\b(?:OFFSET|CHANNELS)\s+[-+.\d])|(?<=HIERARCHY\s)"
    r"|(?<=(?:rotation|position)\s)(?=\s*(?:JOINT|END)\s)",
    re.IGNORECASE,
)
_FRAMES = re.compile(r"Frames\s*:\s*(\d{1,15})(?!\S)", re.IGNORECASE)
_FRAME_TIME = re.compile(
    r"Frame\s*Time\s*:\s*(\S+?)\s*(hz|fps|ms|s|sec|seconds)?(?!\S)", re.IGNORECASE
)
_COMMA = re.compile(r",(?=\s|$)")  # which separates numbers, since blanks follow
LONGEST_HEADER = 1000  # Characters between MOTION and the first frame
CHANNELS = {(kind, axis) for kind in ("position", "rotation") for axis in "xyz"}


@dataclass
class _Node:
    """A joint or an end site."""

    name: str
    parent: int  # index, -1 for the root
    offset: Array = field(default_factory=lambda: np.zeros(3))  # position in the parent
    channels: list[tuple[str, str]] = field(default_factory=list)  # position or rotation, and axis


class _Motion(NamedTuple):
    """The header of the frames."""

    declared: str  # number of frames
    step: float  # of time [s]
    first: int  # number of the line of the first frame
    warnings: tuple[str, ...] = ()


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a BVH file; see `maniport.mocap.readers.read_recording`."""
    lines = lines_of(file)
    hierarchy, number = _hierarchy_lines(lines)
    nodes = _hierarchy(hierarchy)
    require_at_most(len(nodes), POINTS, "joints and end sites")
    motion = _motion(lines, number, options)
    if options.crops:
        count = sum(len(block.lines) for block in row_blocks(file, motion.first))
        rest = _rest_frames(file, options, nodes, motion, count)
        times = _times(options, motion, count)
        shifted = np.empty(count)
        shifted[rest:] = times.time[: count - rest]
        shifted[:rest] = -times.time[rest:0:-1]
        times = replace(times, time=shifted)
        kept = times.rows_between(options.start, options.stop)
        if 0 < rest <= kept.start:
            times = replace(times, notes=(*times.notes, rest_pose_note(rest, "first")))
        times = times.part(kept)
        table = _table(file, nodes, motion, kept)
    else:
        table = _table(file, nodes, motion, slice(0, FRAMES))
        count = len(table)
        times = _times(options, motion, count)
    if is_cut_off(motion.declared, count):
        raise ValueError(
            f"the file is cut off: its header declares {counted(int(motion.declared), 'frame')}, and there are {count}"
        )
    notes = []
    if count != int(motion.declared):
        notes.append(
            f"the header declares {counted(int(motion.declared), 'frame')}, but the file holds {count}: all were read"
        )
    require_size(len(table), len(nodes))
    warnings = [*motion.warnings, *_unit_warnings(nodes, table)]
    positions, position_notes = _all_positions(nodes, table)
    del table  # as large as the positions
    names = [node.name for node in nodes]
    return options.recording(
        file,
        names,
        positions,
        times,
        notes=[*notes, *position_notes],
        quality_warnings=warnings,
    )


def _hierarchy_lines(lines: Iterator[Row]) -> tuple[list[Row], int]:
    """Return the lines before MOTION, and the number of its line."""
    hierarchy: list[Row] = []
    motion = 0
    for number, line in lines:
        if _is_word(line, "MOTION"):
            motion = number
            break
        hierarchy.append((number, line))
        if number == 20 and not _begins(hierarchy):
            break
        require_at_most(len(hierarchy), 40 * POINTS, "lines in its hierarchy")
    if not _begins(hierarchy):
        raise ValueError("this is no BVH file: it does not begin with HIERARCHY")
    if motion == 0:
        raise ValueError(
            f"the file is cut off in its hierarchy, at line {len(hierarchy)}: there is no MOTION"
        )
    return hierarchy, motion


def _unit_warnings(nodes: Sequence[_Node], table: Array) -> list[str]:
    """Return a warning where rotations are so small that they may be radians."""
    rotations = [kind == "rotation" for node in nodes for kind, _ in node.channels]
    sample = table[:: max(len(table) // 1000, 1)]
    angles = np.abs(sample[:, rotations])
    largest = float(np.max(angles, initial=0.0, where=np.isfinite(angles)))
    if not 0.0 < largest <= 2 * np.pi:
        return []
    return [
        f"all rotations are within {largest:.2g}°: if they are radians, convert them to degrees, the unit of BVH"
    ]


def _begins(hierarchy: Sequence[Row]) -> bool:
    return any(_is_word(line, "HIERARCHY") for _, line in hierarchy[:20])


def _is_word(line: str, word: str) -> bool:
    """Whether a line begins with a word, in any case."""
    return line.upper().split(None, 1)[:1] == [word]


def _table(file: Path, nodes: list[_Node], motion: _Motion, frames: slice) -> Array:
    """Return the channels of some frames, shape (n_frames, n_channels)."""
    width = sum(len(node.channels) for node in nodes)
    blocks = sliced(row_blocks(file, motion.first), frames)
    possible = file.stat().st_size // max(2 * width, 1)  # a digit and a blank for each number
    expected = min(int(motion.declared), frames.stop - frames.start, possible)
    reader = NumberTable(width, [range(width)], expected=expected)
    (table,) = reader.read(map(_without_separators, blocks))
    return table


def _without_separators(block: Block) -> Block:
    """Return rows whose commas and semicolons between numbers are blanks; those of decimals stay."""
    if ";" not in block.lines[0] and not _COMMA.search(block.lines[0]):
        return block
    lines = [_COMMA.sub(" ", line.replace(";", " ")) for line in block.lines]
    return Block(block.numbers, lines)


def _times(options: ImportOptions, motion: _Motion, count: int) -> FrameTimes:
    """Return the times of all frames, which begin at zero."""
    times = options.frame_times(FileTimes(rates={"Frame Time": 1 / motion.step}), count)
    if options.rate is None:
        times = replace(times, time=motion.step * np.arange(count, dtype=np.float64))
    return times


def _rest_frames(
    file: Path,
    options: ImportOptions,
    nodes: list[_Node],
    motion: _Motion,
    count: int,
) -> int:
    """Return the number of frames of a rest pose at the start, from no more frames than necessary."""
    names = [node.name for node in nodes]
    whole = replace(options, start=None, stop=None, keep_rest_poses=True)
    size = min(64, count)
    while size:
        table = _table(file, nodes, motion, slice(0, size))
        positions, _ = _all_positions(nodes, table)
        beginning = whole.recording(file, names, positions, _times(options, motion, size))
        rest = rest_frames(beginning.positions, beginning.time)
        has_moved = bool((table[: size // 2] != table[0]).any())
        if rest or has_moved or size == count:
            return rest
        size = min(4 * size, count)
    return 0


def _hierarchy(lines: Sequence[Row]) -> list[_Node]:
    """Return the joints and end sites, parents before children."""
    opened = 0
    closed = 0
    for _, line in lines:
        opened += line.count("{")
        closed += line.count("}")
    if opened != closed:
        raise ValueError(f"the hierarchy has {opened} opening and {closed} closing braces")
    nodes: list[_Node] = []
    path: list[int] = []  # the nodes with open braces
    for number, line in lines:
        for statement in filter(None, _STATEMENT.split(line)):
            word, *values = statement.split() or [""]
            try:
                _read_statement(word, values, nodes, path)
            except (ValueError, IndexError) as error:
                raise ValueError(
                    f"not readable as BVH: line {number}, {line.strip()!r}: {error}"
                ) from None
    if not nodes:
        raise ValueError("the hierarchy holds no ROOT")
    return nodes


def _read_statement(word: str, values: list[str], nodes: list[_Node], path: list[int]) -> None:
    """Read one statement of the hierarchy, a word and its values, into the nodes."""
    word = word.upper()
    if word in ("ROOT", "JOINT", "END"):
        _add_node(word, values, nodes, path)
    elif word == "}":
        path.pop()
    elif word == "OFFSET":
        x, y, z = map(as_float, values)
        nodes[path[-1]].offset = np.array([x, y, z])
    elif word == "CHANNELS":
        if nodes[path[-1]].channels:
            raise ValueError("the channels of this joint occur twice")
        nodes[path[-1]].channels = _channels(values)


def _add_node(word: str, values: list[str], nodes: list[_Node], path: list[int]) -> None:
    """Append a joint, or an end site with the name of its parent."""
    if (word == "ROOT") != (not nodes) or (nodes and not path):
        raise ValueError("there must be one ROOT that contains all else")
    if word == "END":
        name = f"{END}{nodes[path[-1]].name}"
    else:
        name = " ".join(values)
    nodes.append(_Node(name, path[-1] if path else -1))
    path.append(len(nodes) - 1)


def _channels(values: list[str]) -> list[tuple[str, str]]:
    """Return the channels of a joint, position or rotation and axis, from their number and names."""
    channels = []
    for value in values[1:]:
        channels.append((value[1:].lower(), value[0].lower()))
    if values[:1] != [str(len(channels))] or not set(channels) <= CHANNELS:
        raise ValueError(
            "the number of channels differs from the declared one, or a channel is unknown"
        )
    return channels


def _motion(lines: Iterator[Row], motion: int, options: ImportOptions) -> _Motion:
    """Read the lines after MOTION, up to the first frame."""
    header = ""
    last = motion
    count = None
    frame_time = None
    for number, line in lines:
        stripped = line.strip()
        if not stripped or stripped.startswith(("#", "//")):
            continue
        if not stripped[0].isalpha():  # the first frame
            break
        last = number
        header += f" {stripped}"
        count = _FRAMES.search(header)
        frame_time = _FRAME_TIME.search(header)
        if (count and frame_time) or len(header) > LONGEST_HEADER:
            break
    if count is None or frame_time is None:
        raise ValueError(f"MOTION at line {motion} must be followed by 'Frames:' and 'Frame Time:'")
    step = positive_number(frame_time[1])
    if step is None and options.rate is None:
        raise ValueError(
            f"Frame Time at line {last} must be a positive number; found {frame_time[1]!r}; "
            f"{argument('rate')} sets the frames per second"
        )
    if step is None:
        step = 1 / float(options.rate or 1.0)
    unit = (frame_time[2] or "").lower()
    if unit in ("hz", "fps"):
        step = 1 / step
    elif unit == "ms":
        step *= 1e-3
    warnings = []
    if step >= LONGEST_FRAME_TIME and options.rate is None and not unit:
        warnings.append(
            f"Frame Time at line {last} is {frame_time[1]}, which was taken as milliseconds: as seconds, frames would "
            f"be {step:g} s apart; {argument('rate')} sets the frames per second"
        )
        step *= 1e-3
    rate = max(round(1 / step), 1)
    if abs(1 / rate - step) < 1e-4 * step:  # many files cut a thirtieth of a second to 0.033333
        step = 1 / rate
    return _Motion(count[1], step, last + 1, tuple(warnings))


def _all_positions(nodes: list[_Node], table: Array) -> tuple[Array, list[str]]:
    """Return the origins of all nodes, shape (n, len(nodes), 3), in the file's unit, with notes."""
    translations, notes = _translations(nodes, table)
    positions = np.empty((len(table), len(nodes), 3))
    turning = _turning(nodes, translations)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite counts as missing
        for first in range(0, len(table), FRAMES_AT_ONCE):  # limits the memory
            part = slice(first, first + FRAMES_AT_ONCE)
            _fill_positions(positions[part], nodes, table[part], translations, turning)
    return positions, notes


def _turning(nodes: list[_Node], translations: set[int]) -> set[int]:
    """Return the nodes whose rotation moves others."""
    turning = set()
    for i in range(len(nodes) - 1, 0, -1):  # children before parents
        if i in turning or i in translations or nodes[i].offset.any():
            turning.add(nodes[i].parent)
    return turning


def _translations(nodes: list[_Node], table: Array) -> tuple[set[int], list[str]]:
    """Return the nodes below the root whose position channels replace their offsets, with a note.

    Channels that are zero, or no more than rounding, keep the offset, and those that equal it are not needed.
    """
    bones = []
    for node in nodes[1:]:
        length = float(np.linalg.norm(node.offset))
        if length > 0:
            bones.append(length)
    tolerance = 0.0
    if bones:
        tolerance = 1e-3 * float(np.median(bones))
    used = set()
    largest = 0.0
    text = ""
    column = 0
    for i, node in enumerate(nodes):
        values, present = _position_channels(node, table, column)
        column += len(node.channels)
        if node.parent < 0 or values is None:
            continue
        with np.errstate(invalid="ignore", over="ignore"):
            finite = np.isfinite(values).all(axis=1)
            stated = values[finite & (np.abs(values) > tolerance).any(axis=1)]
            differences = np.linalg.norm(stated - node.offset[present], axis=1)
        if not len(stated) or differences.max() <= tolerance:
            continue
        used.add(i)
        if differences.max() > largest:
            largest = float(differences.max())
            by_channels = np.median(np.linalg.norm(stated, axis=1))
            by_offset = np.linalg.norm(node.offset)
            text = (
                f"{largest:.4g} units at {node.name} (offset {by_offset:.4g} long, channels "
                f"{by_channels:.4g})"
            )
    if not used:
        return used, []
    joints = counted(len(used), "joint")
    return used, [
        f"position channels of {joints} below the root were used, since they differ from the offsets; most by {text}"
    ]


def _position_channels(node: _Node, table: Array, column: int) -> tuple[Array | None, list[int]]:
    """Return the position channels of a node, shape (n, axes), and their axes; None where it has none."""
    columns = []
    axes = []
    for i, (kind, axis) in enumerate(node.channels):
        if kind == "position":
            columns.append(column + i)
            axes.append("xyz".index(axis))
    if columns:
        return (table[:, columns], axes)
    return (None, axes)


def _offsets(node: _Node, values: Array, axes: list[int]) -> Array:
    """Return the positions in the parent, shape (n, 3), from channels (n, axes); zero ones keep the offset."""
    offsets = np.tile(node.offset, (len(values), 1))
    is_stated = (values != 0).any(axis=1)
    offsets[np.ix_(is_stated, axes)] = values[is_stated]
    return offsets


def _fill_positions(
    positions: Array,
    nodes: list[_Node],
    table: Array,
    translations: set[int],
    turning: set[int],
) -> None:
    """Write the origins of nodes into an array (n, len(nodes), 3).

    Parameters
    ----------
    positions : ndarray, shape (n, len(nodes), 3)
    nodes : list of _Node
    table : ndarray, shape (n, n_channels)
    translations : set of int
        Nodes whose position channels replace their offsets.
    turning : set of int
        Nodes whose rotations are needed.
    """
    count = len(table)
    channels = np.ascontiguousarray(table.T)
    rotations: list[list[Array]] = []  # of each node, its three axes, each of shape (3, n)
    places: list[Array] = []  # of each node, shape (3, n)
    column = 0
    for i, node in enumerate(nodes):
        if node.parent < 0:
            rotation = [np.repeat(unit[:, None], count, axis=1) for unit in np.eye(3)]
            place = np.repeat(node.offset[:, None], count, axis=1)
        else:
            rotation = rotations[node.parent]
            offsets = node.offset[:, None]
            values, axes = _position_channels(node, table, column)
            if i in translations and values is not None:
                offsets = _offsets(node, values, axes).T
            place = places[node.parent].copy()
            for direction, coordinates in zip(rotation, offsets, strict=True):
                place += direction * coordinates
        for kind, axis in node.channels:
            values = channels[column]
            column += 1
            if kind == "position":
                if node.parent < 0:
                    place["xyz".index(axis)] = values
            elif i in turning and values.any():
                rotation = _rotated(rotation, "xyz".index(axis), np.radians(values))
        positions[:, i] = place.T
        places.append(place)
        rotations.append(rotation)


def _rotated(rotation: list[Array], axis: int, angles: Array) -> list[Array]:
    """Rotate three axes, each of shape (3, n), about one of them by angles (n,) [rad]."""
    second = (axis + 1) % 3
    third = (axis + 2) % 3
    cosine = np.cos(angles)
    sine = np.sin(angles)
    rotated = list(rotation)
    rotated[second] = cosine * rotation[second]
    rotated[second] += sine * rotation[third]
    rotated[third] = cosine * rotation[third]
    rotated[third] -= sine * rotation[second]
    return rotated
