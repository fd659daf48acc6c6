"""Tables of programs of optical motion capture: several lines of names above the numbers, brought to one.

Motive, ``Format Version`` 1.2 and later: https://docs.optitrack.com, "Data Export: CSV". Nexus: the section
``Trajectories`` of its ASCII export. Qualisys Track Manager: the TSV files of its manual, "Motion data (.tsv)".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from maniport.demonstrations.import_options import known_unit
from maniport.demonstrations.readers.text import Row, fields_of, most_used, positive_number, rows_from
from maniport.errors import FileFormatError
from maniport.input_limits import POINTS, require_at_most

UNUSED = ""
"""Name of a column that is not read."""


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


def find_table(file: Path, lines: Sequence[str]) -> Table:
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
