"""CSV and TSV, tables of points over time: a row for each frame, or a row for each point of each frame."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maniport.demonstrations.import_options import ImportOptions, drop_untrusted
from maniport.demonstrations.readers.exports import Table, find_table
from maniport.demonstrations.readers.text import fields_of, number_table, text_lines
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import NAME, PLACES, POINTS, require_at_most
from maniport.validation import Array

_COLUMN = re.compile(r"(.+?)(?:[ _.:-]+pos(?:ition)?)?[ _.:-]+\(?([xyz])\)?(?: *[\[(](\w+)[\])])?", re.IGNORECASE)
_TRUST = re.compile(r"(.+?)[ _.:-]+(?:visibility|confidence|conf|score|likelihood)", re.IGNORECASE)
_TIME = re.compile(r"(?:time|t|timestamp|seconds)(?:[ _]*[\[(]?(s|ms)[\])]?)?", re.IGNORECASE)

LAYOUTS = (
    "a table of points has a line of names first and then either a row for each frame, with columns NAME_x, NAME_y, "
    "NAME_z (or NAME.x …) and time, or a row for each point, with columns time, name, x, y, z"
)


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a CSV file; see `maniport.demonstrations.readers.read_recording`."""
    table = find_table(file, text_lines(file))
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
