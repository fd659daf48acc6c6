"""TRC, the table of points over time that OpenSim, OpenCap and Pose2Sim write."""

from pathlib import Path

import numpy as np

from maniport.mocap.import_options import ImportOptions
from maniport.mocap.readers.text import fields_of, number_table, positive_number, rows_from, separator_of, text_lines
from maniport.mocap.recording import Recording
from maniport.util.validation import Array


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a TRC file; see `maniport.mocap.readers.read_recording`."""
    lines = text_lines(file)
    if not lines or not lines[0].startswith("PathFileType"):
        raise ValueError("this is no TRC file: it does not begin with PathFileType")
    if len(lines) < 5:  # kind of file, keys, their values, names, axes
        raise ValueError(f"the file is cut off in its header, at line {len(lines)}")
    separator = "\t" if "\t" in lines[3] else separator_of(lines[3])
    keys, values = (line.split() if separator not in line else fields_of(line, separator) for line in lines[1:3])
    header = dict(zip(filter(None, keys), values, strict=False))
    names = [name for name in fields_of(lines[3], separator)[2:] if name]
    if not names:
        raise ValueError("line 4 must name the points, after Frame# and Time, between tabs")
    table = number_table(rows_from(lines, 5), 2 + 3 * len(names), lambda line: line.split(separator), short=True)
    time: Array | None = table[:, 1]
    complete = np.isfinite(table[:, 1]).all()
    if rate := positive_number(header.get("DataRate", "")):
        even = (table[0, 1] if np.isfinite(table[0, 1]) else 0.0) + np.arange(len(table)) / rate
        if not complete or (np.abs(table[:, 1] - even) < 0.25 / rate).all():
            time = even  # the column differs by rounding only
    elif not complete:
        time = None
    warnings: list[str] = []
    declared = header.get("NumFrames", "").strip()[:15]
    if declared.isdecimal() and int(declared) > len(table) + 1:
        text = f"the header declares {declared} frames, and there are {len(table)}: the end of the file may be missing"
        warnings.append(text)
    if separator != "\t":
        warnings.append(f"the fields of this TRC file are separated by {separator!r}, not by tabs: check the points")
    positions, unit = table[:, 2:].reshape(len(table), -1, 3), header.get("Units", "")
    return options.recording(file, names, positions, time, unit, quality_warnings=warnings)
