"""BVH, a tree of joints with offsets, and their angles frame by frame."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.mocap.readers import ImportOptions, require_size
from maniport.mocap.readers.text import (
    is_cut_off,
    number_table,
    positive_number,
    rows_from,
    text_lines,
)
from maniport.mocap.recording import Recording
from maniport.mocap.roles import END
from maniport.util.input_limits import POINTS, require_at_most
from maniport.util.validation import Array

CHANNELS = {(kind, axis) for kind in ("position", "rotation") for axis in "xyz"}


@dataclass
class _Node:
    """A joint or an end site."""

    name: str
    parent: int  # index, -1 for the root
    offset: Array = field(default_factory=lambda: np.zeros(3))  # position in the parent
    channels: list[tuple[str, str]] = field(default_factory=list)  # position or rotation, and axis


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a BVH file; see `maniport.mocap.readers.read_recording`."""
    lines = text_lines(file)
    if not any(line.split()[:1] == ["HIERARCHY"] for line in lines[:20]):
        raise ValueError("this is no BVH file: it does not begin with HIERARCHY")
    motion = next((i for i, line in enumerate(lines) if line.split()[:1] == ["MOTION"]), None)
    if motion is None:
        raise ValueError(
            f"the file is cut off in its hierarchy, at line {len(lines)}: there is no MOTION"
        )
    nodes = _hierarchy(lines[:motion])
    require_at_most(len(nodes), POINTS, "joints and end sites")
    step, table, notes = _motion(lines, motion, sum(len(node.channels) for node in nodes))
    if any(kind == "position" for node in nodes[1:] for kind, _ in node.channels):
        notes.append(
            "position channels below the root were ignored: every bone keeps the length of its offset"
        )
    require_size(len(table), len(nodes))
    parts = np.split(table, range(2000, len(table), 2000))  # limits the memory
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite counts as missing
        positions = np.concatenate([_positions(nodes, part) for part in parts])
    time = np.arange(len(positions)) * step
    recording = options.recording(file, [node.name for node in nodes], positions, time, notes=notes)
    speed = np.linalg.norm(np.diff(recording.positions, axis=0), axis=-1).max(axis=-1) / step
    if len(speed) < 3 or not speed[0] > max(5.0, 10 * np.percentile(speed[1:], 99)):  # [m/s]
        return recording
    notes = [
        *recording.notes,
        "the first frame, a rest pose from which the motion jumps, was omitted",
    ]
    return replace(
        recording, positions=recording.positions[1:], time=recording.time[:-1], notes=tuple(notes)
    )


def _hierarchy(lines: list[str]) -> list[_Node]:
    """Return the joints and end sites, parents before children."""
    opened, closed = (sum(line.count(brace) for line in lines) for brace in "{}")
    if opened != closed:
        raise ValueError(f"the hierarchy has {opened} opening and {closed} closing braces")
    nodes: list[_Node] = []
    path: list[int] = []  # the nodes with open braces
    for number, line in enumerate(lines, 1):
        word, *rest = line.split() or [""]
        try:
            if word in ("ROOT", "JOINT", "End"):
                if (word == "ROOT") != (not nodes) or (nodes and not path):
                    raise ValueError("there must be one ROOT that contains all else")
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
                    raise ValueError("the channels of this joint occur twice")
                channels = [(word[1:].lower(), word[0].lower()) for word in rest[1:]]
                if rest[:1] != [str(len(channels))] or not set(channels) <= CHANNELS:
                    raise ValueError(
                        "the number of channels differs from the declared one, or a channel is unknown"
                    )
                nodes[path[-1]].channels = channels
        except (ValueError, IndexError) as error:
            raise ValueError(
                f"not readable as BVH: line {number}, {line.strip()!r}: {error}"
            ) from None
    if not nodes:
        raise ValueError("the hierarchy holds no ROOT")
    return nodes


def _motion(lines: list[str], motion: int, width: int) -> tuple[float, Array, list[str]]:
    """Return the time step [s], the channels of each frame, shape (n, width), and notes on repairs."""
    body = rows_from(lines, motion + 1)
    header = re.match(
        r"\s*Frames\s*:\s*(\d{1,15})\s+Frame\s+Time\s*:\s*(\S+)\s*$",
        " ".join(row[1] for row in body[:2]),
    )
    if header is None:
        raise ValueError(
            f"MOTION at line {motion + 1} must be followed by 'Frames:' and 'Frame Time:'"
        )
    declared, rows, step = header[1], body[2:], positive_number(header[2])
    if step is None:
        raise ValueError(
            f"Frame Time at line {body[1][0]} must be a positive number; found {header[2]!r}"
        )
    table = number_table(rows, width)
    if is_cut_off(declared, len(rows)):
        raise ValueError(
            f"the file is cut off: its header declares {declared} frames, and there are {len(rows)}"
        )
    rate = max(round(1 / step), 1)
    if abs(1 / rate - step) < 1e-4 * step:  # many files cut a thirtieth of a second to 0.033333
        step = 1 / rate
    text = f"the header declares {declared} frames, but there are {len(rows)}: all were read"
    return step, table, [] if len(rows) == int(declared) else [text]


def _positions(nodes: list[_Node], table: Array) -> Array:
    """Return the origins of all nodes, shape (n, len(nodes), 3), in the file's unit."""
    positions, columns = np.zeros((len(table), len(nodes), 3)), iter(table.T)
    rotations: list[Array] = []
    for i, node in enumerate(nodes):
        rotation = (
            np.tile(np.eye(3), (len(table), 1, 1)) if node.parent < 0 else rotations[node.parent]
        )
        positions[:, i] = positions[:, node.parent] + rotation @ node.offset
        for (kind, axis), values in zip(node.channels, columns, strict=False):
            if kind == "rotation":
                rotation = (
                    rotation @ Rotation.from_euler(axis, values[:, None], degrees=True).as_matrix()
                )
            elif node.parent < 0:
                positions[:, i, "xyz".index(axis)] = values
        rotations.append(rotation)
    return positions
