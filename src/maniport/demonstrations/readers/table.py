"""CSV and TSV, tables of points over time: a row for each frame, or a row for each point of each frame."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maniport.demonstrations.given import Given, drop_unsure
from maniport.demonstrations.readers.headed import Headed, headed
from maniport.demonstrations.readers.text import Row, fields_of, number_table, text_lines
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.input_limits import NAME, PLACES, POINTS, require_at_most
from maniport.validation import Array

_COLUMN = re.compile(r"(.+?)(?:[ _.:-]+pos(?:ition)?)?[ _.:-]+\(?([xyz])\)?(?: *[\[(](\w+)[\])])?", re.IGNORECASE)
_TRUST = re.compile(r"(.+?)[ _.:-]+(?:visibility|confidence|conf|score|likelihood)", re.IGNORECASE)
_TIME = re.compile(r"(?:time|t|timestamp|seconds)(?:[ _]*[\[(]?(s|ms)[\])]?)?", re.IGNORECASE)
_FRAME = ("frame", "frame#", "frames", "index", "")
_NAME = ("name", "joint", "marker", "keypoint", "landmark", "point")

LAYOUTS = (
    "a table of points has a line of names first and then either a row for each frame, with columns NAME_x, NAME_y, "
    "NAME_z (or NAME.x …) and time, or a row for each point, with columns time, name, x, y, z"
)


def read(file: Path, given: Given) -> Recording:
    """Read a CSV file; see `maniport.demonstrations.readers.read_recording`."""
    table = headed(file, text_lines(file))
    lower = [column.lower() for column in table.columns]
    name = next((lower.index(word) for word in _NAME if word in lower), None)
    if name is not None and all(axis in lower for axis in "xyz"):
        return _one_row_a_point(file, given, table.rows, table.sign, lower, name)
    return _one_row_a_frame(file, given, table)


def _one_row_a_frame(file: Path, given: Given, headed: Headed) -> Recording:
    columns = headed.columns
    places: dict[str, dict[str, int]] = {}
    trust: dict[str, int] = {}
    units = set()
    require_at_most(max(map(len, columns)), NAME, "characters in the name of a column", file)
    for i, column in enumerate(columns):
        if found := _COLUMN.fullmatch(column):
            if places.setdefault(found[1], {}).setdefault(found[2].lower(), i) != i:
                raise FileFormatError(f"{file}: the column {column!r} is there twice")
            units.add(found[3] or "")
        elif found := _TRUST.fullmatch(column):
            trust[found[1]] = i
    names = [name for name, axes in places.items() if len(axes) == 3]
    lacking = [f"{name}_{axis}" for name, axes in places.items() for axis in "xyz" if axis not in axes]
    if not names or lacking:
        why = f"there is no column {lacking[0]}" if lacking else f"found columns {', '.join(columns[:8])[:200]}"
        raise FileFormatError(f"{file}: {LAYOUTS}; {why}")
    table = number_table(file, headed.rows, len(columns), headed.fields)
    positions = table[:, [[places[name][axis] for axis in "xyz"] for name in names]]
    trusted = [name in trust for name in names]
    sure = np.where(trusted, table[:, [trust.get(name, 0) for name in names]], 1.0)
    notes = drop_unsure(positions, sure)
    unit = headed.unit or (units.pop() if len(units) == 1 else "")
    time = _time(columns, table) if headed.rate is None else np.arange(len(table)) / headed.rate
    return given.recording(file, names, positions, time, unit, usual=headed.usual, notes=notes, unit_by=headed.unit_by)


def _one_row_a_point(
    file: Path, given: Given, rows: Sequence[Row], sign: str, columns: list[str], name: int
) -> Recording:
    """Rows of one time, or of one frame, make a frame."""
    when = next((i for i, column in enumerate(columns) if _TIME.fullmatch(column)), None)
    if when is None:
        when = next((i for i, column in enumerate(columns) if column in _FRAME), None)
    if when is None:
        raise FileFormatError(f"{file}: {LAYOUTS}; there is no column time")
    names: dict[str, int] = {}
    chosen = [when, *(columns.index(axis) for axis in "xyz")]
    which = []
    for number, line in rows:
        fields = fields_of(line, sign)
        if len(fields) != len(columns):
            raise FileFormatError(
                f"{file}: the table is broken at line {number}: {len(fields)} values instead of {len(columns)}"
            )
        which.append(names.setdefault(fields[name], len(names)))
        require_at_most(len(names), POINTS, "points", file)

    def split(line: str) -> list[str]:
        fields = fields_of(line, sign)
        return [fields[i] for i in chosen]

    table = number_table(file, rows, len(chosen), split)
    frames, at = np.unique(table[:, 0], return_inverse=True)
    require_at_most(len(frames) * len(names), PLACES, "places (frames × points)", file)
    pairs = at * len(names) + np.array(which)
    if len(np.unique(pairs)) < len(pairs):
        again = int(np.flatnonzero(np.bincount(pairs)[pairs] > 1)[1])
        raise FileFormatError(f"{file}: line {rows[again][0]}: this point stands twice at one time")
    flat = np.full((len(frames) * len(names), 3), np.nan)
    flat[pairs] = table[:, 1:]
    positions = flat.reshape(len(frames), len(names), 3)
    return given.recording(file, list(names), positions, _time([columns[when]], frames[:, None]))


def _time(columns: Sequence[str], table: Array) -> Array | None:
    """Times [s]; None where no column holds them."""
    for i, column in enumerate(columns):
        if found := _TIME.fullmatch(column):
            return np.asarray(table[:, i] / (1000.0 if (found[1] or "").lower() == "ms" else 1.0))
    return None
