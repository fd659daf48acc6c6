"""CSV and TSV, tables of points over time: a row for each frame, or a row for each point of each frame.

Tables of optical motion capture have several lines of names above the numbers. Motive, ``Format Version`` 1.2 and
later: https://docs.optitrack.com, "Data Export: CSV". Nexus: the section ``Trajectories`` of its ASCII export. Qualisys
Track Manager: the TSV files of its manual, "Motion data (.tsv)".
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError
from maniport.mocap.import_options import ImportOptions, drop_untrusted, known_unit
from maniport.mocap.readers.text import (
    Row,
    fields_of,
    most_used,
    number_table,
    positive_number,
    rows_from,
    text_lines,
)
from maniport.mocap.recording import Recording
from maniport.util.input_limits import NAME, PLACES, POINTS, require_at_most
from maniport.util.validation import Array

_COLUMN = re.compile(r"(.+?)(?:[ _.:-]+pos(?:ition)?)?[ _.:-]+\(?([xyz])\)?(?: *[\[(](\w+)[\])])?", re.IGNORECASE)
_TRUST = re.compile(r"(.+?)[ _.:-]+(?:visibility|confidence|conf|score|likelihood)", re.IGNORECASE)
_TIME = re.compile(r"(?:time|t|timestamp|seconds)(?:[ _]*[\[(]?(s|ms)[\])]?)?", re.IGNORECASE)

LAYOUTS = (
    "a table of points has a line of names first and then either a row for each frame, with columns NAME_x, NAME_y, "
    "NAME_z (or NAME.x …) and time, or a row for each point, with columns time, name, x, y, z"
)

UNUSED = ""  # Name of a column that is not read


@dataclass(frozen=True)
class Table:
    """A table with one name for each column."""

    columns: Sequence[str]  # NAME_x, NAME_y, NAME_z, time, or `UNUSED`
    rows: Sequence[Row]
    sign: str  # separator of fields
    unit: str = ""  # of length; empty where unknown
    usual: str = "z"  # usual vertical axis
    rate: float | None = None  # frames per second, where no column holds the time
    unit_by: str = "as the file says"

    def fields(self, line: str) -> list[str]:
        """Return the fields of a row; those that are not read are empty."""
        fields = fields_of(line, self.sign)
        for i, column in enumerate(self.columns[: len(fields)]):
            if column == UNUSED:
                fields[i] = ""
        return fields


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a CSV file; see `maniport.mocap.readers.read_recording`."""
    table = _find_table(file, text_lines(file))
    columns = [column.lower() for column in table.columns]
    words = ("name", "joint", "marker", "keypoint", "landmark", "point")
    name = next((columns.index(word) for word in words if word in columns), None)
    if name is not None and all(axis in columns for axis in "xyz"):
        return _one_row_a_point(file, options, table, columns, name)
    return _one_row_a_frame(file, options, table)


def _one_row_a_frame(file: Path, options: ImportOptions, table: Table) -> Recording:
    columns = table.columns
    places: dict[str, dict[str, int]] = {}
    trust: dict[str, int] = {}
    units = set()
    require_at_most(max(map(len, columns)), NAME, "characters in the name of a column", file)
    for i, column in enumerate(columns):
        if match := _COLUMN.fullmatch(column):
            if places.setdefault(match[1], {}).setdefault(match[2].lower(), i) != i:
                raise FileFormatError(f"{file}: the column {column!r} is there twice")
            units.add(match[3] or "")
        elif match := _TRUST.fullmatch(column):
            trust[match[1]] = i
    names = list(places)
    lacking = [f"{name}_{axis}" for name, axes in places.items() for axis in "xyz" if axis not in axes]
    if not names or lacking:
        why = f"there is no column {lacking[0]}" if lacking else f"found columns {', '.join(columns[:8])[:200]}"
        raise FileFormatError(f"{file}: {LAYOUTS}; {why}")
    numbers = number_table(file, table.rows, len(columns), table.fields)
    positions = numbers[:, [[places[name][axis] for axis in "xyz"] for name in names]]
    trusted = [name in trust for name in names]
    notes = drop_untrusted(positions, np.where(trusted, numbers[:, [trust.get(name, 0) for name in names]], 1.0))
    unit = table.unit or (units.pop() if len(units) == 1 else "")
    time = _time(columns, numbers) if table.rate is None else np.arange(len(numbers)) / table.rate
    return options.recording(file, names, positions, time, unit, usual=table.usual, notes=notes, unit_by=table.unit_by)


def _one_row_a_point(file: Path, options: ImportOptions, table: Table, columns: list[str], name: int) -> Recording:
    """Read rows of which those of one time, or of one frame, make a frame."""
    clock = next((i for i, column in enumerate(columns) if _TIME.fullmatch(column)), None)
    if clock is None:
        counters = ("frame", "frame#", "frames", "index", "")
        clock = next((i for i, column in enumerate(columns) if column in counters), None)
    if clock is None:
        raise FileFormatError(f"{file}: {LAYOUTS}; there is no column time")
    names: dict[str, int] = {}
    chosen = [clock, *(columns.index(axis) for axis in "xyz")]
    points = []
    for number, line in table.rows:
        fields = fields_of(line, table.sign)
        if len(fields) != len(columns):
            raise FileFormatError(
                f"{file}: the table is broken at line {number}: {len(fields)} values instead of {len(columns)}"
            )
        points.append(names.setdefault(fields[name], len(names)))
        require_at_most(len(names), POINTS, "points", file)

    def split(line: str) -> list[str]:
        fields = fields_of(line, table.sign)
        return [fields[i] for i in chosen]

    numbers = number_table(file, table.rows, len(chosen), split)
    times, frames = np.unique(numbers[:, 0], return_inverse=True)
    require_at_most(len(times) * len(names), PLACES, "places (frames × points)", file)
    pairs = frames * len(names) + np.array(points)
    if len(np.unique(pairs)) < len(pairs):
        again = int(np.flatnonzero(np.bincount(pairs)[pairs] > 1)[1])
        raise FileFormatError(f"{file}: line {table.rows[again][0]}: this point stands twice at one time")
    flat = np.full((len(times) * len(names), 3), np.nan)
    flat[pairs] = numbers[:, 1:]
    positions = flat.reshape(len(times), len(names), 3)
    return options.recording(file, list(names), positions, _time([columns[clock]], times[:, None]))


def _time(columns: Sequence[str], table: Array) -> Array | None:
    """Return times [s]; None where no column holds them."""
    for i, column in enumerate(columns):
        if match := _TIME.fullmatch(column):
            return np.asarray(table[:, i] / (1000.0 if (match[1] or "").lower() == "ms" else 1.0))
    return None


def _find_table(file: Path, lines: Sequence[str]) -> Table:
    """Find the table of a file of any program."""
    rows = rows_from(lines, 0)
    first = rows[0][1].strip(' "') if rows else ""
    if first.startswith("Format Version"):
        return _motive(file, rows)
    if first.startswith("NO_OF_FRAMES"):
        return _qualisys(file, rows)
    section = next((i for i, line in enumerate(lines) if line.strip(',;\t "') == "Trajectories"), None)
    if section is not None:
        return _nexus(file, lines[section:], section)
    rows = [row for row in rows if not row[1].lstrip().startswith("#")]
    if not rows:
        raise FileFormatError(f"{file}: the file holds no lines")
    if first.startswith("sep="):  # a line of Excel's
        rows = rows[1:] or rows
    sign = most_used(rows[0][1])
    return Table(fields_of(rows[0][1], sign), rows[1:], sign)


def _motive(file: Path, rows: Sequence[Row]) -> Table:
    sign = most_used(rows[0][1])
    cells = fields_of(rows[0][1], sign)
    header = dict(zip(cells[::2], cells[1::2], strict=False))
    start = next(
        (i for i, (_, line) in enumerate(rows) if i > 3 and line.lower().lstrip('"').startswith("frame")), None
    )
    if start is None:
        raise FileFormatError(
            f"{file}: Motive's table is cut off in its header: there is no line that begins with Frame"
        )
    axes = fields_of(rows[start][1], sign)
    types, names, kinds = ((fields_of(rows[i][1], sign) + [""] * len(axes))[: len(axes)] for i in (1, 2, start - 1))
    solved = ("Rigid Body Marker", "Bone Marker")  # which repeat markers where a model of them expects them
    measured = {name for name, type_ in zip(names, types, strict=True) if type_ not in solved}
    columns = [
        f"{name}_{axis.lower()}"
        if kind == "Position" and axis in ("X", "Y", "Z") and (type_ not in solved or name not in measured)
        else UNUSED
        for type_, name, kind, axis in zip(types, names, kinds, axes, strict=True)
    ]
    columns = _first_of_each(columns)
    columns[1:2] = ["time"]
    _require_points(file, columns, "Motive", "export markers or bones, with their positions")
    return Table(columns, rows[start + 1 :], sign, header.get("Length Units", ""), "y")


def _nexus(file: Path, lines: Sequence[str], start: int) -> Table:
    """Read the section of markers, which begins after `start` lines: title, rate, names, axes, units, numbers."""
    if len(lines) < 5:
        raise FileFormatError(f"{file}: Nexus' table is cut off in its header, at line {start + len(lines)}")
    sign = most_used(lines[3])
    axes = fields_of(lines[3], sign)
    names = (fields_of(lines[2], sign) + [""] * len(axes))[: len(axes)]
    units = {unit for cell in fields_of(lines[4], sign) if (unit := known_unit(cell)) is not None}
    columns, name = [], ""
    for own, axis in zip(names, axes, strict=True):
        name = own or name  # a name stands above the first of its columns
        columns.append(f"{name}_{axis.lower()}" if name and axis in ("X", "Y", "Z") else UNUSED)
    columns = _first_of_each(columns)
    _require_points(file, columns, "Nexus", "export trajectories")
    numbers = takewhile(lambda row: row[1].strip(sign + " "), enumerate(lines[5:], start + 6))
    rate = positive_number(lines[1].strip(sign + ' "'))
    return Table(columns, list(numbers), sign, units.pop() if len(units) == 1 else "", rate=rate)


def _qualisys(file: Path, rows: Sequence[Row]) -> Table:
    header: dict[str, list[str]] = {}
    start = 0
    for _, line in rows:
        key, *values = fields_of(line, "\t")
        if not key.isupper():  # the names of the columns, or the first numbers
            break
        header[key] = [value for value in values if value]
        start += 1  # of events each has a line
    content = " ".join(header.get("DATA_INCLUDED", ["3D"]))
    if content not in ("3D", "Position"):
        raise FileFormatError(f"{file}: it holds {content}, not positions of markers; export 3D data from Qualisys")
    numbers = rows[start:]
    first = fields_of(numbers[0][1], "\t") if numbers else []
    columns = [f"{name}_{axis}" for name in header.get("MARKER_NAMES", ()) for axis in "xyz"]
    if first[:2] == ["Frame", "Time"]:
        columns, numbers = [UNUSED, UNUSED, *(columns or first[2:])], numbers[1:]
    elif columns:
        columns = [UNUSED] * (len(first) - (first[-1:] == [""]) - len(columns)) + columns
    _require_points(file, columns, "Qualisys", "export 3D data, with the names of markers")
    rate = positive_number(" ".join(header.get("FREQUENCY", ())))
    return Table(columns, numbers, "\t", "mm", rate=rate, unit_by="as Qualisys has it")


def _first_of_each(columns: Sequence[str]) -> list[str]:
    """Drop later columns of the same name, such as markers that two models claim."""
    first = {name: i for i, name in reversed(list(enumerate(columns)))}
    return [name if first[name] == i else UNUSED for i, name in enumerate(columns)]


def _require_points(file: Path, columns: Sequence[str], program: str, advice: str) -> None:
    if not any(column not in (UNUSED, "time") for column in columns):
        raise FileFormatError(f"{file}: this table of {program} holds no positions of points; {advice}")
    require_at_most(len(columns), 4 * POINTS, "columns", file)
