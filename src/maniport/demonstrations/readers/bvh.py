"""BVH, the text format of skeleton animation, through pybvh.

pybvh is fast but strict. Two things that many real files do are put right before it sees them: a frame count that is
off by one, and position channels on joints below the root.
"""

import re
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.demonstrations.conventions import in_metres, upward
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError

Array = NDArray[np.float64]

IMPOSSIBLE_SPEED = 5.0
"""A first step faster than this [m/s], and ten times faster than any other, is a rest pose put in front."""


@dataclass
class _Text:
    """A BVH file taken apart: the lines of its hierarchy, its motion, and what was repaired."""

    hierarchy: list[str]
    frame_time: str
    rows: list[str]
    notes: list[str]


def read(file: Path, scale: float | None, up: str | None) -> Recording:
    """Read a BVH file; see `maniport.demonstrations.readers.read_recording`.

    The points are the origins of the joints and the end sites (``EndSite`` + the joint's name), by forward kinematics.
    """
    skeleton, notes = _load(file)
    positions = np.array(skeleton.node_positions(), dtype=np.float64)
    positions[~np.isfinite(positions)] = np.nan
    names = _different([node.name for node in skeleton.nodes])
    tracks = {name: positions[:, i] for i, name in enumerate(names)}
    scale, unit_note = in_metres(tracks, scale, str(file))
    up, up_note = upward(tracks, up, "y")
    positions = positions * scale
    start = _first_real_frame(positions, skeleton.frame_time)
    if start:
        notes.append("the first frame was left out: it is a rest pose, from which the motion jumps away")
    return Recording(
        names=tuple(names),
        positions=positions[start:],
        time=np.arange(len(positions) - start) * skeleton.frame_time,
        up=up,
        source=file.name,
        notes=(unit_note, up_note, *notes),
    )


def _load(file: Path) -> tuple[Any, list[str]]:
    """Let pybvh read the file, repaired where that is needed."""
    import pybvh

    text = _take_apart(file)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        source = file
        if text.notes or file.suffix != ".bvh":
            source = Path(folder) / "repaired.bvh"
            head = [*text.hierarchy, "MOTION", f"Frames: {len(text.rows)}", f"Frame Time: {text.frame_time}"]
            source.write_text("\n".join([*head, *text.rows, ""]))
        try:
            return pybvh.read_bvh_file(source, world_up="+y"), text.notes
        except Exception as error:  # noqa: BLE001  whatever the library raises, the user gets one line
            reason = str(error).replace(str(source), file.name).splitlines()
            raise FileFormatError(
                f"{file}: not readable as BVH: {reason[0] if reason else 'no reason given'}"
            ) from None


def _take_apart(file: Path) -> _Text:
    """Split the file into hierarchy and motion, check that both are complete, and repair what can be."""
    lines = file.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff").splitlines()
    if not lines or not any(line.split()[:1] == ["HIERARCHY"] for line in lines[:20]):
        raise FileFormatError(f"{file}: this is no BVH file: it does not begin with HIERARCHY")
    motion = next((i for i, line in enumerate(lines) if line.split()[:1] == ["MOTION"]), None)
    if motion is None:
        raise FileFormatError(f"{file}: the file is cut off in its hierarchy, at line {len(lines)}: there is no MOTION")
    hierarchy = [line for line in lines[:motion] if line.strip()]
    opened, closed = (sum(line.count(brace) for line in hierarchy) for brace in "{}")
    if opened != closed:
        raise FileFormatError(f"{file}: the hierarchy has {opened} opening and {closed} closing braces")
    body = [(i, line) for i, line in enumerate(lines[motion + 1 :], motion + 2) if line.strip()]
    count = re.match(r"\s*Frames\s*:\s*(\d+)\s*$", body[0][1]) if body else None
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
    notes: list[str] = []
    rows = _rows(file, hierarchy, body[2:], int(count[1]), notes)
    if any("position" in note for note in notes):
        hierarchy = _without_positions(hierarchy)
    return _Text(hierarchy, frame_time[1], rows, notes)


def _rows(file: Path, hierarchy: list[str], body: list[tuple[int, str]], declared: int, notes: list[str]) -> list[str]:
    """Check the lines of the motion against the channels and the frame count."""
    keep = _kept_channels(file, hierarchy)
    if not body:
        raise FileFormatError(f"{file}: the file holds no frames")
    for number, line in body:
        found = len(line.split())
        if found != len(keep):
            cut = "the file is cut off" if number == body[-1][0] else "the motion is broken"
            raise FileFormatError(f"{file}: {cut} at line {number}: {found} values instead of {len(keep)}")
    if abs(len(body) - declared) > 1:
        cut = "the file is cut off" if len(body) < declared else "the frame count is wrong"
        raise FileFormatError(f"{file}: {cut}: its header says {declared} frames, and there are {len(body)}")
    if len(body) != declared:
        notes.append(f"the header says {declared} frames, but there are {len(body)}: all {len(body)} were read")
    rows = [line for _, line in body]
    if all(keep):
        return rows
    notes.append("position channels below the root were left out: every bone keeps the length of its offset")
    return [" ".join(value for value, kept in zip(row.split(), keep, strict=True) if kept) for row in rows]


def _kept_channels(file: Path, hierarchy: list[str]) -> list[bool]:
    """For every channel of the file, whether pybvh can take it: all but positions below the root."""
    keep: list[bool] = []
    for line in hierarchy:
        words = line.split()
        if words[0] == "CHANNELS":
            if len(words) < 2 or not words[1].isdigit() or int(words[1]) != len(words) - 2:
                raise FileFormatError(
                    f"{file}: this line does not list the channels that it announces: {line.strip()!r}"
                )
            keep += (
                [not keep or "position" not in word.lower() for word in words[2:]]
                if keep
                else [True] * (len(words) - 2)
            )
    return keep


def _without_positions(hierarchy: list[str]) -> list[str]:
    """Take the position channels off every joint but the root."""
    result, root = [], True
    for line in hierarchy:
        words = line.split()
        if words[0] == "CHANNELS" and not root:
            kept = [word for word in words[2:] if "position" not in word.lower()]
            line = f"CHANNELS {len(kept)} {' '.join(kept)}"
        root = root and words[0] != "CHANNELS"
        result.append(line)
    return result


def _different(names: list[str]) -> list[str]:
    """Number the names that occur again."""
    return [name if name not in names[:i] else f"{name}#{names[:i].count(name) + 1}" for i, name in enumerate(names)]


def _first_real_frame(positions: Array, step: float) -> int:
    """1 when the motion jumps away from its first frame, else 0.

    The widely used BVH conversion of the CMU database puts a T-pose in front of every recording.
    """
    if len(positions) < 4:
        return 0
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=-1).max(axis=-1) / step
    return int(speed[0] > IMPOSSIBLE_SPEED and speed[0] > 10 * np.percentile(speed[1:], 99))
