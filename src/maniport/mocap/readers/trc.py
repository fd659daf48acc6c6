"""TRC, the table of points over time that OpenSim, OpenCap and Pose2Sim write."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError
from maniport.mocap.import_options import ImportOptions
from maniport.mocap.readers.text import (
    fields_of,
    most_used,
    number_table,
    positive_number,
    rows_from,
    text_lines,
)
from maniport.mocap.recording import Recording
from maniport.util.validation import Array


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a TRC file; see `maniport.mocap.readers.read_recording`."""
    lines = text_lines(file)
    if not lines or not lines[0].startswith("PathFileType"):
        raise FileFormatError(f"{file}: this is no TRC file: it does not begin with PathFileType")
    if len(lines) < 5:  # kind of file, keys, their values, names, axes
        raise FileFormatError(f"{file}: the file is cut off in its header, at line {len(lines)}")
    sign = "\t" if "\t" in lines[3] else most_used(lines[3])
    keys, values = (line.split() if sign not in line else fields_of(line, sign) for line in lines[1:3])
    header = dict(zip(filter(None, keys), values, strict=False))
    names = [name for name in fields_of(lines[3], sign)[2:] if name]
    if not names:
        raise FileFormatError(f"{file}: line 4 names no points: after Frame# and Time each has its own, between tabs")
    table = number_table(file, rows_from(lines, 5), 2 + 3 * len(names), lambda line: line.split(sign), short=True)
    notes, quality_warnings = _counts(header, len(table), len(names))
    if sign != "\t":
        quality_warnings.append(
            f"the fields of this TRC file are separated by {sign!r}, not by tabs: see whether points are right"
        )
    positions = table[:, 2:].reshape(len(table), -1, 3)
    missing = np.isnan(positions).any(axis=-1).mean()
    if missing:
        notes.append(f"{missing:.1%} of all points are missing")
    time, unit = _time(table[:, 1], positive_number(header.get("DataRate", ""))), header.get("Units", "")
    recording = options.recording(file, names, positions, time, unit, usual="y", notes=notes)
    return replace(recording, quality_warnings=(*recording.quality_warnings, *quality_warnings))


def _counts(header: dict[str, str], frames: int, points: int) -> tuple[list[str], list[str]]:
    """Compare frames and points with the header: notes, and warnings where the end of the file may be missing."""
    notes, quality_warnings = [], []
    for key, what, count in (("NumFrames", "frames", frames), ("NumMarkers", "points", points)):
        declared = header.get(key, "").strip()
        if declared.isdecimal() and int(declared[:15]) != count:
            text = f"the header says {declared[:15]} {what}, but there are {count}: all {count} were read"
            if what == "frames" and int(declared[:15]) > count + 1:
                quality_warnings.append(f"{text}; the end of the file may be missing")
            else:
                notes.append(text)
    return notes, quality_warnings


def _time(column: Array, rate: float | None) -> Array | None:
    """Return times [s]: even ones where the file's are those of its rate but for rounding."""
    finite = np.isfinite(column).all()
    if rate is None:
        return column if finite else None
    even = np.arange(len(column)) / rate
    start = column[0] if np.isfinite(column[0]) else 0.0
    if not finite or (np.abs(column - start - even) < 0.25 / rate).all():
        return np.asarray(start + even)
    return column
