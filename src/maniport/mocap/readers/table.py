"""Tables of points over time: TRC, CSV and TSV, with a row for each frame, or for each point of each frame.

TRC is the format of OpenSim, OpenCap and Pose2Sim. Tables of optical motion capture have several lines of names above
the numbers. Motive, ``Format Version`` 1.2 and later: https://docs.optitrack.com, "Data Export: CSV". Nexus: the
section ``Trajectories`` of its ASCII export. Qualisys Track Manager: the TSV files of its manual, "Motion data (.tsv)".
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.mocap.readers import ImportOptions, drop_untrusted, known_unit, require_size, text
from maniport.mocap.readers.columns import (
    COUNTERS,
    HALF_A_DAY,
    PER_SECOND,
    TIME,
    Coordinate,
    as_time,
    axis_of,
    coordinates_of,
    has_points,
    increasing,
    is_numbers,
    unit_of_axis,
)
from maniport.mocap.readers.text import (
    Block,
    Row,
    field_of,
    fields_of,
    positive_number,
    separator_of,
)
from maniport.mocap.readers.times import FileTimes, FrameTimes
from maniport.mocap.recording import Recording
from maniport.util.input_limits import NAME, POINTS, require_at_most
from maniport.util.validation import Array

_CONFIDENCE = re.compile(
    r"(.+?)(?:[ _.:-]+|(?<=[a-z0-9])(?=[A-Z]))(?i:visibility|confidence|conf|score|likelihood)"
)
_COLUMN_AXIS = re.compile(r"[ _.:-]+\(?[xyz]\)?$", re.IGNORECASE)
_STATED_RATE = re.compile(
    r"(?:fps|(?:frame|sampling|sample|data|capture|camera)[ _]*(?:rate|frequency)|frequency|rate|frames per second)"
    r"(?:[ _]*[\[(]\w+[\])])?[\s,;:=\"]+(\d+(?:\.\d+)?)",
    re.IGNORECASE,
)
_STATED_UNIT = re.compile(r"(?:length[ _]*)?units?[\s,;:=\"]+([a-z]+)", re.IGNORECASE)
"""What lines above the names of columns may state."""

NEXUS_SECTIONS = ("Devices", "Events", "Joints", "Model Outputs", "Segments", "Trajectories")
HEADER = 300  # Lines in which the names of the columns are

POINT_WORDS = (
    "name",
    "joint",
    "marker",
    "keypoint",
    "landmark",
    "point",
    "bone",
    "segment",
    "body part",
    "bodypart",
)

PERSON_WORDS = (
    "person",
    "subject",
    "actor",
    "skeleton",
    "body",
    "person_id",
    "subject_id",
    "track_id",
    "body_id",
)

_PLACE = re.compile(
    r"(?:pos(?:ition)?[ _.:-]*)?([xyz])(?:[ _]*[\[(]?(?:(\w+))[\])]?)?", re.IGNORECASE
)
"""The column of a coordinate in a table with a row for each point."""

LAYOUTS = (
    "a table of points has a line of names first and then either a row for each frame, with columns NAME_x, NAME_y, "
    "NAME_z (or NAME.x …) and time, or a row for each point, with columns time, name, x, y, z"
)


class Table(NamedTuple):
    """A table with one name for each column."""

    columns: Sequence[str]  # NAME_x, NAME_y, NAME_z, time, or empty where it is not read
    first: int  # number of the line with the first row, from one
    separator: str | None  # None where blanks separate the fields
    unit: str = ""  # of length; empty where unknown
    rates: Mapping[str, float] = {}  # frames per second that the header states
    advice: str = LAYOUTS  # for a table without points
    warnings: Sequence[str] = ()
    short: bool = False  # fields may be missing at the end of a row
    frame_column: int | None = None  # of the numbers of frames
    declared_frames: str = ""  # number of frames in the header
    ends_at_blank: bool = False  # whether another section follows
    comments: bool = False  # whether lines that begin with # are comments
    are_plain: bool = False  # whether columns are NAME_x, NAME_y and NAME_z, whatever the names


def read(file: Path, options: ImportOptions) -> Recording:
    """Read a table of points; see `maniport.mocap.readers.read_recording`."""
    head = list(islice(text.rows_of(file), HEADER))
    if head:
        first = head[0][1].strip(' "')
    else:
        first = ""
    if first.startswith("PathFileType") or _is_trc(head):
        return _one_row_a_frame(file, options, _trc(head))
    if first.startswith("Format Version"):
        return _one_row_a_frame(file, options, _motive(head))
    if first.startswith("NO_OF_FRAMES"):
        return _one_row_a_frame(file, options, _qualisys(head))

    table = _named_columns(head)
    columns, unit = _columns_of_places(table.columns)
    if _name_column(columns) is not None:
        table = table._replace(unit=unit or table.unit)
        return _one_row_a_point(file, options, table, columns)
    _require_usable_names(table)
    table = table._replace(frame_column=_first_column(columns, COUNTERS[:-1]))
    if not coordinates_of(table.columns):
        table = _nexus(file) or _names_above_axes(head) or table
    return _one_row_a_frame(file, options, table)


def _named_columns(head: Sequence[Row]) -> Table:
    """Return a table with one line of names, which may have lines of a title above it or be a comment."""
    rows = []
    comments = []
    for number, line in head:
        if line.lstrip().startswith("#"):
            comments.append((number, line.lstrip(" \t#")))
        else:
            rows.append((number, line))
    if rows and rows[0][1].strip(' "').startswith("sep="):  # written by Excel
        rows = rows[1:]
    if not rows:
        raise ValueError("the file holds no lines")

    named = _row_of_names([*comments, *rows])
    if named is None:
        number, line = rows[0]
        separator = _separator_of(line)
        return Table(
            fields_of(line, separator), first=number + 1, separator=separator, comments=True
        )
    number, line = named
    separator = _separator_of(line)
    title = [above for row, above in head if row < number]
    unit, rates = _stated_in_title("\n".join(title))
    below = next((row for row in rows if row[0] > number), None)
    if below is not None:
        stated = _units_of(fields_of(below[1], separator))
        if stated is not None:
            number = below[0]
            unit = stated or unit
    return Table(
        fields_of(line, separator),
        first=number + 1,
        separator=separator,
        unit=unit,
        rates=rates,
        comments=True,
    )


def _stated_in_title(title: str) -> tuple[str, dict[str, float]]:
    """Return the unit of length, empty where there is none, and the frame rates that lines above a table state."""
    unit = ""
    found = _STATED_UNIT.search(title)
    if found is not None:
        unit = known_unit(found[1]) or ""
    rates = {}
    found = _STATED_RATE.search(title)
    if found is not None:
        rates = _rates({"rate": found[1]}, "rate")
    return unit, rates


def _first_column(columns: Sequence[str], names: Iterable[str]) -> int | None:
    """Return the column with the first of some names that there is."""
    for name in names:
        if name in columns:
            return columns.index(name)
    return None


def _units_of(cells: Sequence[str]) -> str | None:
    """Return the unit of length in a row of units below the names; None where it is no such row."""
    units = set()
    for cell in cells:
        unit = known_unit(cell.strip("()[]"))
        if unit is not None:
            units.add(unit)
        elif cell.strip("()[]").lower() not in ("", "-", "s", "ms", "sec", "seconds", "frame", "#"):
            return None
    if not units:
        return None
    return _only_one(units)


def _only_one(texts: set[str]) -> str:
    """Return the text where there is one; else an empty one."""
    if len(texts) == 1:
        return next(iter(texts))
    return ""


def _row_of_names(rows: Sequence[Row]) -> Row | None:
    """Return the first row, above the numbers, that names the columns of points; None where there is none."""
    for number, line in rows:
        fields = fields_of(line, _separator_of(line))
        if len(fields) > 4 * POINTS:
            return None
        if max(map(len, fields)) <= NAME:
            if _name_column(_columns_of_places(fields)[0]) is not None or has_points(fields):
                return number, line
            if is_numbers(fields):
                return None
    return None


def _separator_of(line: str) -> str | None:
    """Return the separator of a line; None where there are blanks only."""
    if not any(separator in line for separator in ",;\t"):
        if line.count("|") > 3 and line.count("|") >= len(line.split()) - 1:
            return "|"
        if len(line.split()) > 3:
            return None
    return separator_of(line)


def _name_column(columns: Sequence[str]) -> int | None:
    """Return the column of names in a table with a row for each point; None where it is none."""
    if not {"x", "y", "z"} <= set(columns):
        return None
    words = []
    for word in POINT_WORDS:
        for end in ("", "_name", " name", "name"):
            words.append(f"{word}{end}")
    return _first_column(columns, words)


def _names_above_axes(head: Sequence[Row]) -> Table | None:
    """Return a table with a line of names above a line of axes, as of DeepLabCut; None where there is none."""
    for (_, line), (number, below) in pairwise(head):
        separator = _separator_of(below)
        axes = fields_of(below, separator)
        if separator is None or not 3 <= len(axes) <= 4 * POINTS:
            continue
        if [axis_of(cell) for cell in axes].count("x") < 1 or is_numbers(axes):
            continue
        columns = _named_axes(_padded(line, separator, len(axes)), axes)
        if len(coordinates_of(columns)) < 3:
            continue
        small = [column.lower() for column in columns]
        counter = _first_column(small, COUNTERS[:-1])
        if counter is None and not any(map(TIME.fullmatch, columns)):
            counter = 0
        units = set(map(unit_of_axis, axes))
        return Table(
            _first_of_each(columns),
            first=number + 1,
            separator=separator,
            unit=_only_one(units - {""}),
            frame_column=counter,
            comments=True,
            are_plain=True,
        )
    return None


def _named_axes(names: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return columns NAME_x, NAME_y, NAME_z, from names above the first axis of each point; others keep their names."""
    columns = []
    point = ""
    for cell, axis in zip(names, axes, strict=True):
        name = cell or axis
        if TIME.fullmatch(name) or name.lower() in COUNTERS:
            columns.append(name)
            continue
        point = cell or point
        if point:
            name = f"{point}_{axis_of(axis) or axis}"
        else:
            name = ""
        columns.append(name)
    return columns


def _columns_of_places(names: Sequence[str]) -> tuple[list[str], str]:
    """Return columns in small letters, coordinates as x, y and z, and the unit that all three state."""
    columns = [name.lower() for name in names]
    if {"x", "y", "z"} <= set(columns):
        return columns, ""
    places = {}
    units = set()
    for i, column in enumerate(columns):
        found = _PLACE.fullmatch(column)
        if found is None or (found[2] and known_unit(found[2]) is None):
            continue
        if found[1] in places:  # two points in a row
            return columns, ""
        places[found[1]] = i
        units.add(found[2] or "")
    if len(places) < 3:
        return columns, ""
    for axis, i in places.items():
        columns[i] = axis
    return columns, _only_one(units)


def _blocks(file: Path, table: Table) -> Iterator[Block]:
    """Iterate over the rows of numbers."""
    if table.ends_at_blank:
        end = f"{table.separator or ''} \n"
    else:
        end = None
    return text.row_blocks(file, table.first, table.comments, end)


def _require_usable_names(table: Table) -> None:
    """Raise where there are too many columns, or names so long that matching them takes long."""
    require_at_most(len(table.columns), 4 * POINTS, "columns")
    longest = max(map(len, table.columns), default=0)
    require_at_most(longest, NAME, "characters in the name of a column")


def _coordinates(table: Table) -> dict[int, Coordinate]:
    """Return the coordinates of points among the columns."""
    if not table.are_plain:
        return coordinates_of(table.columns)
    found = {}
    for i, column in enumerate(table.columns):
        point, _, axis = column.rpartition("_")
        if point and axis in ("x", "y", "z"):
            found[i] = Coordinate(point, axis)
    return found


def _points_of(table: Table) -> tuple[dict[str, dict[str, int]], str]:
    """Return the columns of each point by axis, and the unit that their names state."""
    points: dict[str, dict[str, int]] = {}
    units = set()
    _require_usable_names(table)
    for i, coordinate in _coordinates(table).items():
        axes = points.setdefault(coordinate.point, {})
        if axes.setdefault(coordinate.axis, i) != i:
            raise ValueError(f"the column {table.columns[i]!r} occurs twice")
        units.add(coordinate.unit)
    fault = ""
    if not points:
        fault = "the table holds no positions of points"
    for name, axes in points.items():
        for axis in "xyz":
            if axis not in axes and not fault:
                fault = f"there is no column {name}_{axis}"
    if fault:
        raise ValueError(
            f"{fault}; {table.advice}; found columns {', '.join(table.columns[:8])[:200]}"
        )
    return points, _only_one(units)


def _confidence_columns(columns: Sequence[str], points: Collection[str]) -> dict[str, int]:
    """Return the columns of the confidences of points."""
    confidence = {}
    for i, column in enumerate(columns):
        match = _CONFIDENCE.fullmatch(column)
        if match and match[1] in points:
            confidence[match[1]] = i
    return confidence


def _one_row_a_frame(file: Path, options: ImportOptions, table: Table) -> Recording:
    points, unit = _points_of(table)
    confidence = _confidence_columns(table.columns, points)
    clock, per_second = _clock(table.columns)
    axes = []
    for columns in points.values():
        axes += [columns["x"], columns["y"], columns["z"]]
    clocks = []
    if clock is not None:
        clocks.append(clock)
    if table.frame_column is not None:
        clocks.append(table.frame_column)

    has_text = clock is not None and _is_text(file, table, clock)
    blocks = _blocks(file, table)
    size = file.stat().st_size
    times: FrameTimes | None = None
    if options.crops:
        size = 0  # of the part, which is not known
        numbers = _scanned(blocks, table, clocks)
        times = _times(options, table, numbers, clock, per_second)
        part = times.rows_between(options.start, options.stop)
        count = len(times.time)
        times = times.part(part)
        blocks = text.sliced(_blocks(file, table), part)

    texts = []
    if has_text:
        texts = [clocks.pop(0)]
    groups = (axes, list(confidence.values()), clocks)
    reader = text.NumberTable(
        len(table.columns), groups, table.separator, short=table.short, texts=texts
    )
    coordinates, confidences, numbers = reader.read(blocks, size)
    positions = coordinates.reshape(len(coordinates), -1, 3)
    if times is None:
        count = len(positions)
        if has_text:
            clocks_of_day = _times_of(reader.labels[0])
            numbers = np.column_stack([clocks_of_day, numbers])
        times = _times(options, table, numbers, clock, per_second)

    names = list(points)
    notes = []
    if confidence:
        rows = [names.index(name) for name in confidence]
        trusted = np.ones(positions.shape[:2])
        trusted[:, rows] = confidences
        notes = drop_untrusted(positions, trusted)
    warnings = list(table.warnings)
    if text.is_cut_off(table.declared_frames, count):
        warnings.insert(
            0,
            f"the header declares {table.declared_frames} frames, and the file holds {count}: its end may be missing",
        )
    return options.recording(
        file, names, positions, times, table.unit or unit, notes=notes, quality_warnings=warnings
    )


def _is_text(file: Path, table: Table, clock: int) -> bool:
    """Whether the times of a table are texts such as hh:mm:ss."""
    block = next(_blocks(file, table), None)
    return block is not None and ":" in field_of(block.lines[0], table.separator, clock)


def _times_of(labels: text.Labels) -> Array:
    """Return the times [s] of rows from their texts."""
    seconds = np.array(list(map(as_time, labels.names)))
    return np.array(increasing(seconds[labels.indices()].tolist()))


def _scanned(blocks: Iterable[Block], table: Table, columns: Sequence[int]) -> Array:
    """Return some columns of all rows, times or numbers, without parsing the others."""
    numbers = []
    for block in blocks:
        for number, line in zip(block.numbers, block.lines, strict=True):
            try:
                fields = [field_of(line, table.separator, column) for column in columns]
                numbers.append([as_time(field) for field in fields])
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
    if not numbers:
        raise ValueError("the file holds no frames")
    scanned = np.array(numbers).reshape(len(numbers), len(columns))
    for column in scanned.T:
        if (np.diff(column) < -HALF_A_DAY).any():
            column[:] = increasing(column.tolist())
    return scanned


def _times(
    options: ImportOptions, table: Table, numbers: Array, clock: int | None, per_second: float
) -> FrameTimes:
    """Return the times of frames from the columns of times and of frame numbers, in this order."""
    clocks = {}
    if clock is not None:
        clocks["time"] = numbers[:, 0] / per_second
    frame_numbers = numbers[:, -1] if table.frame_column is not None else None
    return options.frame_times(FileTimes(clocks, frame_numbers, table.rates), len(numbers))


def _one_row_a_point(
    file: Path, options: ImportOptions, table: Table, columns: list[str]
) -> Recording:
    """Read rows of points; those of one time, or of one frame number, make a frame."""
    clock, per_second = _clock(columns)
    counter = clock
    if counter is None:
        counter = next((i for i, column in enumerate(columns) if column in COUNTERS), None)
    if counter is None:
        raise ValueError(f"{LAYOUTS}; there is no column time")
    has_text = clock is not None and _is_text(file, table, clock)
    texts = []
    person = _first_column(columns, PERSON_WORDS)
    if person is not None:
        texts.append(person)
    texts.append(int(_name_column(columns) or 0))
    numbers = []
    if has_text:
        texts.append(counter)
    else:
        numbers.append(counter)
    axes = [columns.index(axis) for axis in "xyz"]
    reader = text.NumberTable(len(columns), (axes, numbers), table.separator, texts=texts)
    places, counts = reader.read(_blocks(file, table), file.stat().st_size)
    if has_text:
        counts = _times_of(reader.labels.pop())[:, None]
    names, points = _named_points(reader.labels)
    times, pairs = _frames_of(counts[:, 0])
    require_size(len(times), len(names))
    pairs *= len(names)
    pairs += points
    del counts, points
    is_complete = len(pairs) == len(times) * len(names) and bool((np.diff(pairs) == 1).all())
    positions = places
    if not is_complete:
        _require_once(file, table, pairs)
        positions = np.full((len(times) * len(names), 3), np.nan)
        positions[pairs] = places
    del places, pairs  # as large as the positions
    reader.arrays.clear()
    stated = FileTimes(frame_numbers=times)
    if clock is not None:
        stated = FileTimes({"time": times / per_second})
    tracks = positions.reshape(len(times), -1, 3)
    return options.recording(file, names, tracks, stated, table.unit)


def _require_once(file: Path, table: Table, pairs: NDArray[np.int64]) -> None:
    """Raise where a point occurs twice at one time, with the number of the second line."""
    occurrences = np.bincount(pairs)
    if occurrences.max() > 1:
        again = int(np.flatnonzero(occurrences[pairs] > 1)[1])
        block = next(text.sliced(_blocks(file, table), slice(again, again + 1)))
        raise ValueError(f"line {block.numbers[0]}: this point occurs twice at one time")


def _named_points(labels: list[text.Labels]) -> tuple[list[str], NDArray[np.int64]]:
    """Return names, with those of several persons before a colon, and the index of the name of each row."""
    points = labels[-1].indices()
    names = list(labels[-1].names)
    if len(labels) == 1 or len(labels[0].names) < 2:
        return names, points
    pairs = labels[0].indices() * len(names) + points
    used, order, indices = np.unique(pairs, return_index=True, return_inverse=True)
    ranks = np.argsort(np.argsort(order))  # of the first row of each
    persons = list(labels[0].names)
    names_of_pairs = []
    for pair in used[np.argsort(order)].tolist():
        names_of_pairs.append(f"{persons[pair // len(names)]}:{names[pair % len(names)]}")
    return names_of_pairs, ranks[indices].astype(np.int64)


def _frames_of(counts: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the different times or frame numbers of rows, in order, and the index of each row among them."""
    steps = np.diff(counts)
    if not (steps >= 0).all():
        times, frames = np.unique(counts, return_inverse=True)
        return times, frames.astype(np.int64)
    is_new = np.concatenate([[True], steps > 0])
    return counts[is_new], np.cumsum(is_new, dtype=np.int64) - 1


def _clock(columns: Sequence[str]) -> tuple[int | None, float]:
    """Return the first column of times, and its units per second."""
    for i, column in enumerate(columns):
        match = TIME.fullmatch(column)
        if match is not None:
            unit = (match[1] or "").lower()
            factors = [factor for name, factor in PER_SECOND.items() if unit.startswith(name)]
            return i, factors[0] if factors else 1.0
    return None, 1.0


def _is_trc(head: Sequence[Row]) -> bool:
    """Whether a table without the line PathFileType is a TRC file: its keys, or names above axes with numbers."""
    for i, (_, line) in enumerate(head[:4]):
        words = line.replace(",", " ").split()
        if words[:1] == ["DataRate"]:
            return True
        if i + 1 < len(head):
            below = head[i + 1][1].replace(",", " ").split()
        else:
            below = []
        if words[:1] == ["Frame#"] and below and all(map(axis_of, below)):
            return True
    return False


def _trc(head: Sequence[Row]) -> Table:
    """Read the header: kind of file, keys, their values, names and axes; the names alone are indispensable."""
    keys, named = _trc_rows(head)
    if len(head) <= named:
        last = head[-1][0] if head else 0
        raise ValueError(f"the file is cut off in its header, at line {last}")
    header = {}
    if keys + 1 < named:
        names_of_keys = _tabbed_fields(head[keys][1])
        values = _tabbed_fields(head[keys + 1][1])
        header = dict(zip(filter(None, names_of_keys), values, strict=False))

    number, line = head[named]
    separator: str | None = "\t"
    if "\t" not in line:
        separator = _separator_of(line)
    labels = list(filter(None, fields_of(line, separator)[2:]))
    axes = _trc_axes(head[named + 1 :], separator)
    last = named + (len(axes) > 0)
    if len(head) == last + 1:
        raise ValueError(f"the file is cut off in its header, at line {head[-1][0]}")
    if not axes:
        axes = ["X", "Y", "Z"] * len(labels)
    names = _trc_names(labels, axes, header.get("NumMarkers", ""), number)
    points = []
    for name in names:
        points += [name, name, name]
    columns = ["", "time", *_columns(points, "XYZ" * len(names))]
    warnings = []
    if separator != "\t":
        what = "blanks" if separator is None else repr(separator)
        warnings.append(
            f"the fields of this TRC file are separated by {what}, not by tabs: check the points"
        )
    return Table(
        columns,
        first=head[last][0] + 1,
        separator=separator,
        unit=header.get("Units", ""),
        rates=_rates(header, "DataRate"),
        advice=f"line {number} must name the points, after Frame# and Time",
        warnings=warnings,
        short=True,
        frame_column=0,
        declared_frames=header.get("NumFrames", ""),
        are_plain=True,
    )


def _trc_rows(head: Sequence[Row]) -> tuple[int, int]:
    """Return the indices of the rows of keys and of names in the header of a TRC file."""
    keys = 1
    for i, (_, line) in enumerate(head[:4]):
        if line.split()[:1] == ["DataRate"]:
            keys = i
            break
    for i, (_, line) in enumerate(head[:12]):
        if line.lower().lstrip().startswith("frame#"):
            return keys, i
    return keys, keys + 2


def _trc_axes(below: Sequence[Row], separator: str | None) -> list[str]:
    """Return the names of the axes in the row below the names of points; empty where it has none."""
    if not below:
        return []
    cells = fields_of(below[0][1], separator)
    if any(map(axis_of, cells)):
        return list(filter(None, cells))
    return []


def _tabbed_fields(line: str) -> list[str]:
    """Split a line at tabs, or where it has none at its separator."""
    return fields_of(line, "\t" if "\t" in line else _separator_of(line))


def _trc_names(
    labels: Sequence[str], axes: Sequence[str], declared: str, line: int
) -> Sequence[str]:
    """Return the names of the points of a TRC file, each of which may stand above all three of its columns."""
    if declared.isdecimal() and len(declared) < 10:
        count = int(declared)
    else:
        count = len(labels)
    if len(labels) in (3 * count, len(axes)) and len(labels) % 3 == 0:
        names: list[str] = []
        for i in range(0, len(labels), 3):
            of_point = set(labels[i : i + 3])
            if len(of_point) > 1:
                of_point = {_COLUMN_AXIS.sub("", label) for label in of_point}
            if len(of_point) == 1:
                names += of_point
        if 3 * len(names) == len(labels):
            return names
    if len(labels) != count and len(axes) == 3 * count:
        raise ValueError(
            f"line {line} holds {len(labels)} names, for {count} markers by NumMarkers and {len(axes)} columns on the "
            "line below: each marker needs one name, above the first of its columns"
        )
    return labels


def _rates(header: Mapping[str, str], *keys: str) -> dict[str, float]:
    """Return the positive rates under some keys of a header."""
    rates = {}
    for key in keys:
        rate = positive_number(header.get(key, ""))
        if rate is not None:
            rates[key] = rate
    return rates


def _motive(rows: Sequence[Row]) -> Table:
    separator = separator_of(rows[0][1])
    cells = fields_of(rows[0][1], separator)
    header = dict(zip(cells[::2], cells[1::2], strict=False))
    start = 4
    while start < len(rows) and not rows[start][1].lower().lstrip('"').startswith("frame"):
        start += 1
    if start >= len(rows):
        raise ValueError("the header of Motive is cut off: there is no line that begins with Frame")
    axes = fields_of(rows[start][1], separator)
    types = _padded(rows[1][1], separator, len(axes))
    names = _padded(rows[2][1], separator, len(axes))
    kinds = _padded(rows[start - 1][1], separator, len(axes))
    # these are the expected positions of markers that are recorded, too
    solved = ("Rigid Body Marker", "Bone Marker")
    measured = set()
    for name, type_ in zip(names, types, strict=True):
        if type_ not in solved:
            measured.add(name)
    points = []
    for type_, name, kind in zip(types, names, kinds, strict=True):
        if kind == "Position" and (type_ not in solved or name not in measured):
            points.append(name)
        else:
            points.append("")
    columns = _columns(points, axes)
    columns[1:2] = ["time"]
    rates = _rates(header, "Export Frame Rate") or _rates(header, "Capture Frame Rate")
    return Table(
        columns,
        first=rows[start][0] + 1,
        separator=separator,
        unit=header.get("Length Units", ""),
        rates=rates,
        advice="in Motive export markers or bones, with their positions",
        frame_column=0,
        are_plain=True,
    )


def _nexus(file: Path) -> Table | None:
    """Find the section of markers of Nexus: title, rate, names, axes, units, numbers; None in other files."""
    lines = text.lines_of(file)
    start = _start_of_trajectories(lines)
    if start is None:
        return None
    header = [line for _, line in islice(lines, 4)]
    if len(header) < 4:
        raise ValueError(f"the header of Nexus is cut off at line {start + len(header)}")
    separator = separator_of(header[2])
    axes = fields_of(header[2], separator)
    points = _padded(header[1], separator, len(axes))
    for i in range(1, len(points)):
        points[i] = points[i] or points[i - 1]  # a name is above the first of its columns
    units = set()
    for cell in fields_of(header[3], separator):
        unit = known_unit(cell)
        if unit is not None:
            units.add(unit)
    rates = {}
    rate = positive_number(header[0].strip(separator + ' "'))
    if rate is not None:
        rates["frame rate"] = rate
    return Table(
        _columns(points, axes),
        first=start + 5,
        separator=separator,
        unit=_only_one(units),
        rates=rates,
        advice="in Nexus export trajectories",
        frame_column=0 if axes[:1] == ["Frame"] else None,
        ends_at_blank=True,
        are_plain=True,
    )


def _start_of_trajectories(lines: Iterable[Row]) -> int | None:
    """Advance to the title of the section of markers, and return its line; None where there is no section of Nexus."""
    sections = []
    before = ""
    for number, line in lines:
        title = line.strip(',;\t "')
        if title == "Trajectories":
            return number
        if not before and title in NEXUS_SECTIONS and title not in sections:
            sections.append(title)
        before = title
    if not sections:
        return None
    raise ValueError(
        "the table holds no positions of points: in Nexus export Trajectories; found the sections "
        f"{', '.join(sections)}"
    )


def _qualisys(rows: Sequence[Row]) -> Table:
    header: dict[str, list[str]] = {}
    count = 0
    # keys are in capitals, until the names of the columns or the first numbers; those of events repeat
    for _, line in rows:
        key, *values = fields_of(line, "\t")
        if not key.isupper():
            break
        header[key] = list(filter(None, values))
        count += 1
    content = " ".join(header.get("DATA_INCLUDED", ["3D"]))
    if content not in ("3D", "Position"):
        raise ValueError(
            f"it holds {content}, not positions of markers; export 3D data from Qualisys"
        )
    last = rows[count - 1][0]
    rows = rows[count:]
    first = []
    if rows:
        first = fields_of(rows[0][1], "\t")
    columns = []
    for name in header.get("MARKER_NAMES", ()):
        for axis in "xyz":
            columns.append(f"{name}_{axis}")
    frame_column = None
    if first[:2] == ["Frame", "Time"]:
        columns = ["", "time", *(columns or first[2:])]
        last = rows[0][0]
        frame_column = 0
    elif columns:
        columns = [""] * (len(first) - (first[-1:] == [""]) - len(columns)) + columns
    rates = {}
    rate = positive_number(" ".join(header.get("FREQUENCY", ())))
    if rate is not None:
        rates["FREQUENCY"] = rate
    return Table(
        columns,
        first=last + 1,
        separator="\t",
        unit="mm",
        rates=rates,
        advice="in Qualisys export 3D data, with the names of markers",
        frame_column=frame_column,
    )


def _padded(line: str, separator: str, width: int) -> list[str]:
    return (fields_of(line, separator) + [""] * width)[:width]


def _columns(points: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Name the columns of points; later ones of the same name, as of markers that two models claim, are not used."""
    columns = []
    for name, axis in zip(points, axes, strict=True):
        if name and axis in ("X", "Y", "Z"):
            columns.append(f"{name}_{axis.lower()}")
        else:
            columns.append("")
    return _first_of_each(columns)


def _first_of_each(columns: Sequence[str]) -> list[str]:
    """Return columns of which later ones of the same name are empty."""
    seen = set()
    unique = []
    for column in columns:
        unique.append("" if column in seen else column)
        seen.add(column)
    return unique
