"""Tables of programs of optical motion capture: several lines of names above the numbers, brought to one.

Motive, ``Format Version`` 1.2 and later: https://docs.optitrack.com, "Data Export: CSV". Nexus: the section
``Trajectories`` of its ASCII export. Qualisys Track Manager: the TSV files of its manual, "Motion data (.tsv)".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from maniport.demonstrations.conventions import known_unit
from maniport.demonstrations.readers.text import Row, fields_of, most_used, rows_from
from maniport.errors import FileFormatError
from maniport.input_limits import POINTS, require_at_most

UNUSED = ""
"""Name of a column that is not read."""
MOTIVE, QUALISYS, SECTION = "Format Version", "NO_OF_FRAMES", "Trajectories"
"""What files of Motive and Qualisys begin with, and the part of a file of Nexus that holds the markers."""
BEGINNINGS = {MOTIVE: ".csv", QUALISYS: ".tsv", SECTION: ".csv"}
"""Endings of files that begin so."""
AXES = ("X", "Y", "Z")
SOLVED = ("Rigid Body Marker", "Bone Marker")
"""Kinds of columns of Motive that repeat markers where a model of them expects them."""


@dataclass(frozen=True)
class Headed:
    """A table with one name for each column.

    Attributes
    ----------
    columns : sequence of str
        ``NAME_x``, ``NAME_y``, ``NAME_z``, ``time``, or `UNUSED`.
    rows : sequence of Row
        The numbers.
    sign : str
        What parts the fields.
    unit, usual : str
        Of length, and the axis up that is usual; empty where unknown.
    rate : float, optional
        Frames a second, where the columns hold no time.
    unit_by : str
        How the unit is known.
    """

    columns: Sequence[str]
    rows: Sequence[Row]
    sign: str
    unit: str = ""
    usual: str = "z"
    rate: float | None = None
    unit_by: str = "as the file says"

    def fields(self, line: str) -> list[str]:
        """The fields of a row; those that are not read are empty."""
        fields = fields_of(line, self.sign)
        for i, column in enumerate(self.columns[: len(fields)]):
            if column == UNUSED:
                fields[i] = ""
        return fields


def headed(file: Path, lines: Sequence[str]) -> Headed:
    """Find the table of a file, whoever wrote it."""
    rows = rows_from(lines, 0)
    first = rows[0][1].strip(' "') if rows else ""
    if first.startswith(MOTIVE):
        return _motive(file, rows)
    if first.startswith(QUALISYS):
        return _qualisys(file, rows)
    if any(line.strip(',;\t "') == SECTION for _, line in rows):
        return _nexus(file, lines)
    rows = [row for row in rows if not row[1].lstrip().startswith("#")]
    if not rows:
        raise FileFormatError(f"{file}: the file holds no lines")
    if first.startswith("sep="):  # a line of Excel's
        rows = rows[1:] or rows
    sign = most_used(rows[0][1])
    return Headed(fields_of(rows[0][1], sign), rows[1:], sign)


def _motive(file: Path, rows: Sequence[Row]) -> Headed:
    sign = most_used(rows[0][1])
    cells = fields_of(rows[0][1], sign)
    said = dict(zip(cells[::2], cells[1::2], strict=False))
    start = next(
        (i for i, (_, line) in enumerate(rows) if line.lower().lstrip('"').startswith("frame") and i > 3), None
    )
    if start is None:
        raise FileFormatError(
            f"{file}: Motive's table is cut off in its header: there is no line that begins with Frame"
        )
    axes = fields_of(rows[start][1], sign)
    types, names, kinds = (_filled(fields_of(rows[i][1], sign), len(axes)) for i in (1, 2, start - 1))
    measured = {name for name, one in zip(names, types, strict=True) if one not in SOLVED}
    columns = [
        f"{name}_{axis.lower()}"
        if kind == "Position" and axis in AXES and (one not in SOLVED or name not in measured)
        else UNUSED
        for one, name, kind, axis in zip(types, names, kinds, axes, strict=True)
    ]
    columns = _first_of_each(columns)
    columns[1:2] = ["time"]
    _require_points(file, columns, "Motive", "export markers or bones, with their positions")
    return Headed(columns, rows[start + 1 :], sign, said.get("Length Units", ""), "y")


def _nexus(file: Path, lines: Sequence[str]) -> Headed:
    start = next(i for i, line in enumerate(lines) if line.strip(',;\t "') == SECTION)
    if len(lines) < start + 5:
        raise FileFormatError(f"{file}: Nexus' table is cut off in its header, at line {len(lines)}")
    sign = most_used(lines[start + 3])
    axes = fields_of(lines[start + 3], sign)
    names = _filled(fields_of(lines[start + 2], sign), len(axes))
    units = {unit for cell in fields_of(lines[start + 4], sign) if (unit := known_unit(cell)) is not None}
    columns = [
        f"{name}_{axis.lower()}" if name and axis in AXES else UNUSED
        for name, axis in zip(_carried(names), axes, strict=True)
    ]
    columns = _first_of_each(columns)
    _require_points(file, columns, "Nexus", "export trajectories")
    numbers = takewhile(lambda row: row[1].strip(sign + " "), enumerate(lines[start + 5 :], start + 6))
    rate = _number(lines[start + 1].strip(sign + ' "'))
    return Headed(columns, list(numbers), sign, units.pop() if len(units) == 1 else "", rate=rate)


def _qualisys(file: Path, rows: Sequence[Row]) -> Headed:
    said: dict[str, list[str]] = {}
    start = 0
    for _, line in rows:
        key, *values = fields_of(line, "\t")
        if not key.isupper():  # the names of the columns, or the first numbers
            break
        said[key] = [value for value in values if value]
        start += 1  # of events each has a line
    what = " ".join(said.get("DATA_INCLUDED", ["3D"]))
    if what not in ("3D", "Position"):
        raise FileFormatError(f"{file}: it holds {what}, not positions of markers; export 3D data from Qualisys")
    numbers = rows[start:]
    first = fields_of(numbers[0][1], "\t") if numbers else []
    columns = [f"{name}_{axis}" for name in said.get("MARKER_NAMES", ()) for axis in "xyz"]
    if first[:2] == ["Frame", "Time"]:
        columns, numbers = [UNUSED, UNUSED, *(columns or first[2:])], numbers[1:]
    elif columns:
        columns = [UNUSED] * (len(first) - (first[-1:] == [""]) - len(columns)) + columns
    _require_points(file, columns, "Qualisys", "export 3D data, with the names of markers")
    rate = _number(" ".join(said.get("FREQUENCY", ())))
    return Headed(columns, numbers, "\t", "mm", rate=rate, unit_by="as Qualisys has it")


def _first_of_each(columns: Sequence[str]) -> list[str]:
    """Columns without later ones of the same name, such as markers that two models claim."""
    seen = {UNUSED}
    kept = []
    for name in columns:
        kept.append(UNUSED if name in seen else name)
        seen.add(name)
    return kept


def _filled(cells: list[str], width: int) -> list[str]:
    return (cells + [""] * width)[:width]


def _carried(names: Sequence[str]) -> list[str]:
    """Each name up to the next one."""
    last, carried = "", []
    for name in names:
        last = name or last
        carried.append(last)
    return carried


def _require_points(file: Path, columns: Sequence[str], program: str, todo: str) -> None:
    if not any(column not in (UNUSED, "time") for column in columns):
        raise FileFormatError(f"{file}: this table of {program} holds no positions of points; {todo}")
    require_at_most(len(columns), 4 * POINTS, "columns", file)


def _number(text: str) -> float | None:
    """A positive number; None where there is none."""
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if 0 < value < np.inf else None
