"""TRC, the table of points over time that OpenSim, OpenCap and Pose2Sim write."""

from pathlib import Path

import numpy as np

from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.text import number_table, rows_from, text_lines
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.validation import Array

HEADER = 5
"""Lines before the numbers: kind of file, what follows, its values, names, axes."""


def read(file: Path, given: Given) -> Recording:
    """Read a TRC file; see `maniport.demonstrations.readers.read_recording`.

    A point without coordinates is missing. Layout: https://opensimconfluence.atlassian.net, "Marker (.trc) Files".
    """
    lines = text_lines(file)
    if not lines or not lines[0].startswith("PathFileType"):
        raise FileFormatError(f"{file}: this is no TRC file: it does not begin with PathFileType")
    if len(lines) < HEADER:
        raise FileFormatError(f"{file}: the file is cut off in its header, at line {len(lines)}")
    header = dict(zip(lines[1].split(), lines[2].split("\t") if "\t" in lines[2] else lines[2].split(), strict=False))
    names = [name.strip() for name in lines[3].split("\t")[2:] if name.strip()]
    if not names:
        raise FileFormatError(f"{file}: line 4 names no points: after Frame# and Time each has its own, between tabs")
    table = number_table(file, rows_from(lines, HEADER), 2 + 3 * len(names), lambda line: line.split("\t"), short=True)
    notes = _counts(file, header, len(table), len(names))
    positions = table[:, 2:].reshape(len(table), -1, 3)
    missing = np.isnan(positions).any(axis=-1).mean()
    if missing:
        notes.append(f"{missing:.1%} of all points are missing")
    return given.recording(
        file, names, positions, _time(file, table[:, 1], header), header.get("Units", ""), usual="y", notes=notes
    )


def _counts(file: Path, header: dict[str, str], frames: int, points: int) -> list[str]:
    """What the header says of frames and points, against what there is."""
    notes = []
    for key, what, there in (("NumFrames", "frames", frames), ("NumMarkers", "points", points)):
        said = header.get(key, "").strip()
        if said.isdecimal() and int(said[:15]) != there:
            if what == "frames" and int(said[:15]) > there + 1:
                raise FileFormatError(
                    f"{file}: the file is cut off: its header says {said[:15]} frames, and there are {there}"
                )
            notes.append(f"the header says {said[:15]} {what}, but there are {there}: all {there} were read")
    return notes


def _time(file: Path, column: Array, header: dict[str, str]) -> Array | None:
    """Times [s]: even ones where the file's are those of its rate but for their rounding."""
    try:
        rate = float(header.get("DataRate", ""))
    except ValueError:
        rate = 0.0
    if not (0 < rate < np.inf):
        return column if np.isfinite(column).all() else None
    even = np.arange(len(column)) / rate
    start = column[0] if np.isfinite(column[0]) else 0.0
    steady = np.abs(column - start - even) < 0.25 / rate
    if steady.all() or not np.isfinite(column).all():
        return np.asarray(start + even)
    return column
