"""BVH, the text format of skeleton animation: a tree of joints with offsets, and their angles frame by frame."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from maniport.demonstrations.dialects import END
from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.text import rows_from, text_lines
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import PLACES, POINTS, require_at_most
from maniport.validation import Array

IMPOSSIBLE_SPEED = 5.0
"""A first step faster than this [m/s], and ten times faster than any other, is a rest pose put in front."""

_AT_ONCE = 2000
"""Frames; what forward kinematics keeps of them fits into little memory."""

_CHANNELS = {f"{axis}{kind}": (kind, i) for kind in ("position", "rotation") for i, axis in enumerate("xyz")}


@dataclass
class _Node:
    """A joint or an end site: its parent's index (-1 for the root), its place there, and its columns of the motion."""

    name: str
    parent: int
    offset: Array = field(default_factory=lambda: np.zeros(3))
    channels: list[tuple[int, str, int]] = field(default_factory=list)  # column, position or rotation, axis


def read(file: Path, given: Given) -> Recording:
    """Read a BVH file; see `maniport.demonstrations.readers.read_recording`."""
    lines = text_lines(file)
    if not lines or not any(line.split()[:1] == ["HIERARCHY"] for line in lines[:20]):
        raise FileFormatError(f"{file}: this is no BVH file: it does not begin with HIERARCHY")
    motion = next((i for i, line in enumerate(lines) if line.split()[:1] == ["MOTION"]), None)
    if motion is None:
        raise FileFormatError(f"{file}: the file is cut off in its hierarchy, at line {len(lines)}: there is no MOTION")
    nodes = _hierarchy(file, lines[:motion])
    require_at_most(len(nodes), POINTS, "joints and end sites", file)
    step, table, notes = _motion(file, lines, motion, sum(len(node.channels) for node in nodes))
    if any(kind == "position" for node in nodes[1:] for _, kind, _ in node.channels):
        notes.append("position channels below the root were left out: every bone keeps the length of its offset")
    require_at_most(len(table) * len(nodes), PLACES, "places (frames × joints)", file)
    parts = np.split(table, range(_AT_ONCE, len(table), _AT_ONCE))
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite counts as missing
        positions = np.concatenate([_positions(nodes, part) for part in parts])
    time = np.arange(len(positions)) * step
    recording = given.recording(file, [node.name for node in nodes], positions, time, usual="y", notes=notes)
    if not _begins_at_rest(recording):
        return recording
    note = "the first frame was left out: it is a rest pose, from which the motion jumps away"
    return replace(
        recording, positions=recording.positions[1:], time=recording.time[:-1], notes=(*recording.notes, note)
    )


def _hierarchy(file: Path, lines: list[str]) -> list[_Node]:
    """The joints and end sites, parents before children."""
    opened, closed = (sum(line.count(brace) for line in lines) for brace in "{}")
    if opened != closed:
        raise FileFormatError(f"{file}: the hierarchy has {opened} opening and {closed} closing braces")
    nodes: list[_Node] = []
    path: list[int] = []  # the nodes whose braces are open
    columns = 0
    for number, line in enumerate(lines, 1):
        word, *rest = line.split() or [""]
        try:
            if word in ("ROOT", "JOINT", "End"):
                if (word == "ROOT") != (not nodes) or (nodes and not path):
                    raise ValueError("one ROOT and all else within it is what can be read")
                name = f"{END}{nodes[path[-1]].name}" if word == "End" else " ".join(rest)
                nodes.append(_Node(name, path[-1] if path else -1))
                path.append(len(nodes) - 1)
            elif word == "}":
                path.pop()
            elif word == "OFFSET":
                x, y, z = map(float, rest)
                nodes[path[-1]].offset = np.array([x, y, z])
            elif word == "CHANNELS":
                if nodes[path[-1]].channels:
                    raise ValueError("the channels of this joint stand twice")
                kinds = [_CHANNELS.get(channel.lower()) for channel in rest[1:]]
                if rest[:1] != [str(len(kinds))] or None in kinds:
                    raise FileFormatError(
                        f"{file}: this line does not list the channels that it announces: {line.strip()!r}"
                    )
                nodes[path[-1]].channels = [(columns + i, *kind) for i, kind in enumerate(kinds) if kind is not None]
                columns += len(kinds)
        except (ValueError, IndexError) as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(f"{file}: not readable as BVH: line {number}, {line.strip()!r}: {error}") from None
    if not nodes:
        raise FileFormatError(f"{file}: the hierarchy holds no ROOT")
    return nodes


def _motion(file: Path, lines: list[str], motion: int, width: int) -> tuple[float, Array, list[str]]:
    """Time step [s], channels of each frame, shape (n, width), and what was put right."""
    body = rows_from(lines, motion + 1)
    count = re.match(r"\s*Frames\s*:\s*(\d{1,15})\s*$", body[0][1]) if body else None
    frame_time = re.match(r"\s*Frame\s+Time\s*:\s*(\S+)\s*$", body[1][1]) if len(body) > 1 else None
    if count is None or frame_time is None:
        raise FileFormatError(f"{file}: MOTION at line {motion + 1} must be followed by 'Frames:' and 'Frame Time:'")
    try:
        step = float(frame_time[1])
    except ValueError:
        step = 0.0
    if not 0 < step < np.inf:
        raise FileFormatError(
            f"{file}: Frame Time at line {body[1][0]} must be a positive number; found {frame_time[1]!r}"
        )
    declared, rows = int(count[1]), body[2:]
    if not rows:
        raise FileFormatError(f"{file}: the file holds no frames")
    for number, line in rows:
        found = len(line.split())
        if found != width:
            cut = "the file is cut off" if number == rows[-1][0] else "the motion is broken"
            raise FileFormatError(f"{file}: {cut} at line {number}: {found} values instead of {width}")
    if declared > len(rows) + 1:
        raise FileFormatError(
            f"{file}: the file is cut off: its header says {declared} frames, and there are {len(rows)}"
        )
    notes = [f"the header says {declared} frames, but there are {len(rows)}: all {len(rows)} were read"]
    try:
        table = np.loadtxt([line for _, line in rows], ndmin=2)
    except ValueError as error:
        raise FileFormatError(f"{file}: not readable as BVH: its motion: {error}") from None
    rate = max(round(1 / step), 1)
    if abs(1 / rate - step) < 1e-4 * step:  # many files cut a thirtieth of a second to 0.033333
        step = 1 / rate
    return step, table, notes if len(rows) != declared else []


def _positions(nodes: list[_Node], table: Array) -> Array:
    """Origins of all nodes, shape (n, len(nodes), 3), in the file's unit."""
    positions = np.empty((len(table), len(nodes), 3))
    turns: list[Array] = []
    for i, node in enumerate(nodes):
        turn = np.tile(np.eye(3), (len(table), 1, 1))
        for column, kind, axis in node.channels:
            if kind == "rotation":
                turn = turn @ _about(axis, np.radians(table[:, column]))
        if node.parent < 0:
            place = np.tile(node.offset, (len(table), 1))
            for column, kind, axis in node.channels:
                if kind == "position":
                    place[:, axis] = table[:, column]
            positions[:, i] = 0.0
        else:
            positions[:, i] = np.einsum("fij,j->fi", turns[node.parent], node.offset) + positions[:, node.parent]
            turn = turns[node.parent] @ turn
        turns.append(turn)
    return positions + place[:, None]


def _about(axis: int, angle: Array) -> Array:
    """Rotations about the x (0), y (1) or z (2) axis, shape (n, 3, 3)."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turns = np.zeros((len(angle), 3, 3))
    turns[:, axis, axis] = 1.0
    turns[:, first, first] = turns[:, second, second] = np.cos(angle)
    turns[:, second, first] = np.sin(angle)
    turns[:, first, second] = -turns[:, second, first]
    return turns


def _begins_at_rest(recording: Recording) -> bool:
    """Whether the motion jumps away from its first frame."""
    if len(recording) < 4:
        return False
    steps = np.linalg.norm(np.diff(recording.positions, axis=0), axis=-1).max(axis=-1)
    speed = steps / np.diff(recording.time)
    return bool(speed[0] > IMPOSSIBLE_SPEED and speed[0] > 10 * np.percentile(speed[1:], 99))
