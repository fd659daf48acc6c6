"""Tables of points over time: TRC, CSV and TSV, with a row for each frame, or for each point of each frame.

TRC is the format of OpenSim, OpenCap and Pose2Sim. Tables of optical motion capture have several lines of names above
the numbers. Motive, ``Format Version`` 1.2 and later: https://docs.optitrack.com, "Data Export: CSV". Nexus: the
section ``Trajectories`` of its ASCII export. Qualisys Track Manager: the TSV files of its manual, "Motion data (.tsv)".
"""

import re
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maniport.mocap.readers import ImportOptions, drop_untrusted, known_unit, require_size, text
from maniport.mocap.readers.text import Row, fields_of, positive_number, separator_of
from maniport.mocap.recording import Recording
from maniport.util.input_limits import NAME, POINTS, require_at_most

_COLUMN = re.compile(
    r"(.+?)(?:[ _.:-]+pos(?:ition)?)?[ _.:-]+\(?([xyz])\)?(?: *[\[(](\w+)[\])])?", re.IGNORECASE
)
_CONFIDENCE = re.compile(
    r"(.+?)[ _.:-]+(?:visibility|confidence|conf|score|likelihood)", re.IGNORECASE
)
_TIME = re.compile(r"(?:time|t|timestamp|seconds)(?:[ _]*[\[(]?(s|ms)[\])]?)?", re.IGNORECASE)

LAYOUTS = (
    "a table of points has a line of names first and then either a row for each frame, with columns NAME_x, NAME_y, "
    "NAME_z (or NAME.x …) and time, or a row for each point, with columns time, name, x, y, z"
)


class Table(NamedTuple):
    """A table with one name for each column."""

    columns: Sequence[str]  # NAME_x, NAME_y, NAME_z, time, or empty where it is not read
    rows: Sequence[Row]
    separator: str
    unit: str = ""  # of length; empty where unknown
    rate: float | None = None  # frames per second
    advice: str = LAYOUTS  # for a table without points
    warnings: Sequence[str] = ()
    short: bool = False  # fields may be missing at the end of a row


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a table of points; see `maniport.mocap.readers.read_recording`."""
    lines = text.text_lines(file)
    rows = text.rows_from(lines, 0)
    first = rows[0][1].strip(' "') if rows else ""
    section = next(
        (i for i, line in enumerate(lines) if line.strip(',;\t "') == "Trajectories"), None
    )
    if first.startswith("PathFileType"):
        table = _trc(lines)
    elif first.startswith("Format Version"):
        table = _motive(rows)
    elif first.startswith("NO_OF_FRAMES"):
        table = _qualisys(rows)
    elif section is not None:
        table = _nexus(lines[section:], section)
    else:
        rows = [row for row in rows if not row[1].lstrip().startswith("#")]
        if first.startswith("sep="):  # written by Excel
            rows = rows[1:]
        if not rows:
            raise ValueError("the file holds no lines")
        separator = separator_of(rows[0][1])
        table = Table(fields_of(rows[0][1], separator), rows[1:], separator)
        columns, words = (
            [*map(str.lower, table.columns)],
            ("name", "joint", "marker", "keypoint", "landmark", "point"),
        )
        name = next((columns.index(word) for word in words if word in columns), None)
        if name is not None and {"x", "y", "z"} <= set(columns):
            return _one_row_a_point(file, options, table, columns, name)
    return _one_row_a_frame(file, options, table)


def _one_row_a_frame(file: Path, options: ImportOptions, table: Table) -> Recording:
    points: dict[str, dict[str, int]] = {}
    units = set()
    require_at_most(len(table.columns), 4 * POINTS, "columns")
    require_at_most(
        max(map(len, table.columns), default=0), NAME, "characters in the name of a column"
    )
    for i, column in enumerate(table.columns):
        if match := _COLUMN.fullmatch(column):
            if points.setdefault(match[1], {}).setdefault(match[2].lower(), i) != i:
                raise ValueError(f"the column {column!r} occurs twice")
            units.add(match[3] or "")
    missing = [
        f"{name}_{axis}" for name, axes in points.items() for axis in "xyz" if axis not in axes
    ]
    if not points or missing:
        fault = (
            f"there is no column {missing[0]}"
            if missing
            else "the table holds no positions of points"
        )
        raise ValueError(
            f"{fault}; {table.advice}; found columns {', '.join(table.columns[:8])[:200]}"
        )
    confidence = {
        match[1]: i
        for i, column in enumerate(table.columns)
        if (match := _CONFIDENCE.fullmatch(column))
    }
    clock, per_second = _clock(table.columns)
    used = [axes[axis] for axes in points.values() for axis in "xyz"]
    used += [confidence.get(name, axes["x"]) for name, axes in points.items()]
    used += [] if clock is None else [clock]
    numbers = text.number_table(table.rows, len(table.columns), table.separator, used, table.short)
    positions = numbers[:, : 3 * len(points)].reshape(len(numbers), -1, 3)
    confidences = numbers[:, 3 * len(points) : 4 * len(points)]
    notes = drop_untrusted(
        positions, np.where([name in confidence for name in points], confidences, 1.0)
    )
    time = None if clock is None else numbers[:, -1] / per_second
    if table.rate is not None:
        start = time[0] if time is not None and np.isfinite(time[0]) else 0.0
        even = start + np.arange(len(numbers)) / table.rate
        if time is None or np.isnan(time).any() or (np.abs(time - even) < 0.25 / table.rate).all():
            time = even  # where the column is incomplete or rounded
    unit = table.unit or (units.pop() if len(units) == 1 else "")
    return options.recording(
        file, list(points), positions, time, unit, notes=notes, quality_warnings=table.warnings
    )


def _one_row_a_point(
    file: Path, options: ImportOptions, table: Table, columns: list[str], name: int
) -> Recording:
    """Read rows of points; those of one time, or of one frame number, make a frame."""
    clock, per_second = _clock(columns)
    counters = [
        i
        for i, column in enumerate(columns)
        if column in ("frame", "frame#", "frames", "index", "")
    ]
    if clock is None and not counters:
        raise ValueError(f"{LAYOUTS}; there is no column time")
    used = [counters[0] if clock is None else clock, *map(columns.index, "xyz")]
    numbers = text.number_table(table.rows, len(columns), table.separator, used)
    labels = [fields_of(line, table.separator)[name] for _, line in table.rows]
    names = {label: i for i, label in enumerate(dict.fromkeys(labels))}
    times, frames = np.unique(numbers[:, 0], return_inverse=True)
    require_size(len(times), len(names))
    pairs = frames * len(names) + np.array([names[label] for label in labels])
    if (count := np.bincount(pairs)).max() > 1:
        again = int(np.flatnonzero(count[pairs] > 1)[1])
        raise ValueError(f"line {table.rows[again][0]}: this point occurs twice at one time")
    positions = np.full((len(times) * len(names), 3), np.nan)
    positions[pairs] = numbers[:, 1:]
    time = None if clock is None else times / per_second
    return options.recording(file, list(names), positions.reshape(len(times), -1, 3), time)


def _clock(columns: Sequence[str]) -> tuple[int | None, float]:
    """Return the first column of times, and its units per second."""
    matches = ((i, match) for i, column in enumerate(columns) if (match := _TIME.fullmatch(column)))
    return next(
        ((i, 1000.0 if (match[1] or "").lower() == "ms" else 1.0) for i, match in matches),
        (None, 1.0),
    )


def _trc(lines: Sequence[str]) -> Table:
    if len(lines) < 5:  # kind of file, keys, their values, names, axes
        raise ValueError(f"the file is cut off in its header, at line {len(lines)}")
    separator = "\t" if "\t" in lines[3] else separator_of(lines[3])
    keys, values = (
        fields_of(line, separator if separator in line else None) for line in lines[1:3]
    )
    header = dict(zip(filter(None, keys), values, strict=False))
    names = [name for name in fields_of(lines[3], separator)[2:] if name]
    columns = ["", "time", *_columns([name for name in names for _ in "XYZ"], "XYZ" * len(names))]
    rows, warnings, declared = text.rows_from(lines, 5), [], header.get("NumFrames", "")
    if text.is_cut_off(declared, len(rows)):
        fault = f"the header declares {declared} frames, and there are {len(rows)}: the end of the file may be missing"
        warnings.append(fault)
    if separator != "\t":
        warnings.append(
            f"the fields of this TRC file are separated by {separator!r}, not by tabs: check the points"
        )
    advice, rate = (
        "line 4 must name the points, after Frame# and Time",
        positive_number(header.get("DataRate", "")),
    )
    return Table(
        columns, rows, separator, header.get("Units", ""), rate, advice, warnings, short=True
    )


def _motive(rows: Sequence[Row]) -> Table:
    separator = separator_of(rows[0][1])
    cells = fields_of(rows[0][1], separator)
    header = dict(zip(cells[::2], cells[1::2], strict=False))
    start = next(
        (
            i
            for i, row in enumerate(rows)
            if i > 3 and row[1].lower().lstrip('"').startswith("frame")
        ),
        None,
    )
    if start is None:
        raise ValueError("the header of Motive is cut off: there is no line that begins with Frame")
    axes = fields_of(rows[start][1], separator)
    types, names, kinds = (_padded(rows[i][1], separator, len(axes)) for i in (1, 2, start - 1))
    solved = (
        "Rigid Body Marker",
        "Bone Marker",
    )  # expected positions of markers that are recorded, too
    measured = {name for name, type_ in zip(names, types, strict=True) if type_ not in solved}
    points = [
        name if kind == "Position" and (type_ not in solved or name not in measured) else ""
        for type_, name, kind in zip(types, names, kinds, strict=True)
    ]
    columns, advice = (
        _columns(points, axes),
        "in Motive export markers or bones, with their positions",
    )
    columns[1:2] = ["time"]
    return Table(
        columns, rows[start + 1 :], separator, header.get("Length Units", ""), advice=advice
    )


def _nexus(lines: Sequence[str], start: int) -> Table:
    """Read the section of markers, which begins after `start` lines: title, rate, names, axes, units, numbers."""
    if len(lines) < 5:
        raise ValueError(f"the header of Nexus is cut off at line {start + len(lines)}")
    separator = separator_of(lines[3])
    axes = fields_of(lines[3], separator)
    points = _padded(lines[2], separator, len(axes))
    for i in range(1, len(points)):
        points[i] = points[i] or points[i - 1]  # a name is above the first of its columns
    units = {
        unit for cell in fields_of(lines[4], separator) if (unit := known_unit(cell)) is not None
    }
    rows = takewhile(lambda row: row[1].strip(separator + " "), enumerate(lines[5:], start + 6))
    rate = positive_number(lines[1].strip(separator + ' "'))
    unit = units.pop() if len(units) == 1 else ""
    return Table(
        _columns(points, axes), list(rows), separator, unit, rate, "in Nexus export trajectories"
    )


def _qualisys(rows: Sequence[Row]) -> Table:
    # until the names of the columns, or the first numbers; keys of events repeat
    head = list(
        takewhile(lambda fields: fields[0].isupper(), (fields_of(line, "\t") for _, line in rows))
    )
    header = {key: list(filter(None, values)) for key, *values in head}
    content = " ".join(header.get("DATA_INCLUDED", ["3D"]))
    if content not in ("3D", "Position"):
        raise ValueError(
            f"it holds {content}, not positions of markers; export 3D data from Qualisys"
        )
    rows = rows[len(head) :]
    first = fields_of(rows[0][1], "\t") if rows else []
    columns = [f"{name}_{axis}" for name in header.get("MARKER_NAMES", ()) for axis in "xyz"]
    if first[:2] == ["Frame", "Time"]:
        columns, rows = ["", "", *(columns or first[2:])], rows[1:]
    elif columns:
        columns = [""] * (len(first) - (first[-1:] == [""]) - len(columns)) + columns
    rate = positive_number(" ".join(header.get("FREQUENCY", ())))
    return Table(
        columns, rows, "\t", "mm", rate, "in Qualisys export 3D data, with the names of markers"
    )


def _padded(line: str, separator: str, width: int) -> list[str]:
    return (fields_of(line, separator) + [""] * width)[:width]


def _columns(points: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Name the columns of points; later ones of the same name, as of markers that two models claim, are not used."""
    columns = [
        f"{name}_{axis.lower()}" if name and axis in ("X", "Y", "Z") else ""
        for name, axis in zip(points, axes, strict=True)
    ]
    first = {column: i for i, column in reversed([*enumerate(columns)])}
    return [column if first[column] == i else "" for i, column in enumerate(columns)]
