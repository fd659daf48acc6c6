"""Names of the columns of tables: the point and the axis, frame numbers, times, and times as text."""

import re
from collections.abc import Iterable, Sequence, Set
from contextlib import suppress
from datetime import UTC, datetime
from typing import NamedTuple

from maniport.mocap.readers import known_unit
from maniport.mocap.readers.text import as_float
from maniport.util.input_limits import NAME

_BETWEEN = r"[ _.:/|\-]"
_POSITION = r"pos(?:ition)?|trans(?:lation|late)?|loc(?:ation)?"
_CAMEL = r"(?<=[a-z0-9])(?-i:Pos(?:ition)?|Trans(?:lation|late)?|Loc(?:ation)?)"
_UNIT = r"(?: *[\[(](?P<unit>\w+)[\])]|[ _](?P<ending>mm|cm|dm|m|meters?|millimeters?|inch))?"
_SEPARATED = (
    # NAME_x, NAME.pos.x, NamePosition_x, NAME x (mm)
    rf"(?P<point>.+?)(?:{_BETWEEN}+(?:{_POSITION})|{_CAMEL})?{_BETWEEN}+\(?(?P<axis>[xyz])\)?{_UNIT}",
    # NAME [X], NAME(X)
    rf"(?P<point>.+?)(?:{_BETWEEN}+(?:{_POSITION}))?{_BETWEEN}*[\[(](?P<axis>[xyz])[\])]{_UNIT}",
    # NAME_PosX, NAME_tx
    rf"(?P<point>.+?){_BETWEEN}+(?:{_POSITION}|t)(?P<axis>[xyz]){_UNIT}",
    # NAME_Xposition
    rf"(?P<point>.+?){_BETWEEN}+(?P<axis>[xyz]){_BETWEEN}*(?:{_POSITION}|coordinate|coord){_UNIT}",
    # ('NAME', 'x')
    r"\(['\"](?P<point>.+?)['\"], *['\"](?P<axis>[xyz])['\"]\)",
)
_JOINED = (
    # NameX, NamePosX, NameTx
    rf"(?P<point>.+?)(?:{_CAMEL}|(?P<t>(?<=[a-z0-9])(?-i:T)))?(?P<axis>[xyz]){_UNIT}",
    # x_NAME, X(NAME)
    rf"(?P<axis>[xyz])(?:{_BETWEEN}+(?P<point>.+)|[\[(](?P<inside>.+)[\])])",
)
SEPARATED = tuple(re.compile(pattern, re.IGNORECASE) for pattern in _SEPARATED)
JOINED = tuple(re.compile(pattern, re.IGNORECASE) for pattern in _JOINED)
"""Names without a separator, which count only where there are columns of all three axes."""

_OTHER_QUANTITY = re.compile(
    rf"(?P<point>.+?)(?:{_BETWEEN}+|(?<=[a-z0-9])(?=[A-Z]))(?i:rot(?:ation)?|quat(?:ernion)?|euler|"
    r"orient(?:ation)?|vel(?:ocity)?|acc(?:eleration)?|angles?)"
)
"""Names of rotations, velocities and accelerations of a point."""

TIME = re.compile(
    r"(?:(?:elapsed|relative)[ _]?)?(?:date[ _]?time|time[ _]?stamp|time|t|seconds|sec|elapsed)"
    r"(?:[ _]*[\[(]?(s|sec|secs|seconds|ms|msec|milliseconds|us|µs|usec|microseconds|ns|nsec|nanoseconds)[\])]?)?",
    re.IGNORECASE,
)
PER_SECOND = {"ms": 1e3, "milli": 1e3, "us": 1e6, "µs": 1e6, "micro": 1e6, "n": 1e9}
"""Units of time in a second, by the first letters of their names."""
COUNTERS = (
    "frame",
    "frame#",
    "frames",
    "frame number",
    "frame_number",
    "framenumber",
    "frame id",
    "frame_id",
    "frame index",
    "frame_index",
    "frame_idx",
    "index",
    "",
)
"""Names of columns of frame numbers, in small letters."""

_AXIS = re.compile(rf"\(?(?P<axis>[xyz])\d*\)?{_UNIT}", re.IGNORECASE)
_CLOCK = re.compile(
    r"(?:(?:(?P<hours>\d{1,3}):)?(?P<minutes>\d{1,3}):)(?P<seconds>\d{1,2}(?:[.,]\d*)?)"
)
HALF_A_DAY = 43_200.0  # [s]


class Coordinate(NamedTuple):
    """What a column holds."""

    point: str
    axis: str  # in small letters
    unit: str = ""  # of length; empty where the name states none


def coordinates_of(columns: Sequence[str]) -> dict[int, Coordinate]:
    """Return the coordinates of points among columns, by their indices.

    Columns of rotations, velocities and accelerations of a point with a position are left out.
    """
    found = {}
    joined: dict[str, dict[int, Coordinate]] = {}
    rotated = set()
    for i, column in enumerate(columns):
        if len(column) > NAME:
            continue
        match = _first_match(SEPARATED, column)
        if match is not None:
            found[i] = Coordinate(match["point"], match["axis"].lower(), _unit_of(match))
            continue
        match = _first_match(JOINED, column)
        if match is None:
            continue
        groups = match.groupdict()
        point = groups["point"] or groups.get("inside") or ""
        if groups.get("t"):
            rotated.add(f"{point}R")  # NameTx, NameRx
        coordinate = Coordinate(point, match["axis"].lower(), _unit_of(match))
        joined.setdefault(point, {})[i] = coordinate
    for of_point in joined.values():
        if sorted(coordinate.axis for coordinate in of_point.values()) == ["x", "y", "z"]:
            found |= of_point

    rotated |= _other_quantities({coordinate.point for coordinate in found.values()})
    positions = {}
    for i in sorted(found):
        if found[i].point not in rotated:
            positions[i] = found[i]
    return positions


def _other_quantities(points: Set[str]) -> set[str]:
    """Return the names of rotations, velocities and accelerations of points among some names."""
    others = set()
    for point in points:
        match = _OTHER_QUANTITY.fullmatch(point)
        if match is not None and match["point"] in points:
            others.add(point)
    return others


def has_points(columns: Sequence[str]) -> bool:
    """Whether the columns hold all three coordinates of a point."""
    axes: dict[str, set[str]] = {}
    for coordinate in coordinates_of(columns).values():
        of_point = axes.setdefault(coordinate.point, set())
        of_point.add(coordinate.axis)
        if len(of_point) == 3:
            return True
    return False


def axis_of(cell: str) -> str:
    """Return the axis that a cell alone names, as ``X`` or ``x1``, in small letters; empty where it names none."""
    match = _AXIS.fullmatch(cell)
    if match is None:
        return ""
    return match["axis"].lower()


def unit_of_axis(cell: str) -> str:
    """Return the unit of length beside an axis, as in ``X (mm)``; empty where there is none."""
    match = _AXIS.fullmatch(cell)
    if match is None:
        return ""
    return _unit_of(match)


def is_numbers(cells: Sequence[str]) -> bool:
    """Whether a row has numbers and nothing else but empty cells and times."""
    count = 0
    for cell in cells:
        if not cell:
            continue
        try:
            as_time(cell)
        except ValueError:
            return False
        count += 1
    return count > 1


def as_time(field: str) -> float:
    """Parse a number, a time ``hh:mm:ss.fff`` or ``mm:ss.fff``, or a date with a time in ISO 8601 [s]."""
    if ":" not in field:
        return as_float(field)
    match = _CLOCK.fullmatch(field)
    if match is not None:
        minutes = 60 * int(match["hours"] or 0) + int(match["minutes"])
        return 60.0 * minutes + float(match["seconds"].replace(",", "."))
    with suppress(ValueError):
        date = datetime.fromisoformat(field.replace(",", "."))
        if date.tzinfo is None:  # a local time may jump
            date = date.replace(tzinfo=UTC)
        return date.timestamp()
    raise ValueError(
        f"could not convert the time {field[:40]!r}; times are numbers, hh:mm:ss.fff, mm:ss.fff or dates of ISO 8601"
    )


def increasing(times: Iterable[float]) -> list[float]:
    """Return times of day [s] that pass midnight as times that increase."""
    values: list[float] = []
    days = 0.0
    before = 0.0
    for time in times:
        if values and before - time > HALF_A_DAY:
            days += 2 * HALF_A_DAY
        before = time
        values.append(time + days)
    return values


def _first_match(patterns: Sequence[re.Pattern[str]], column: str) -> re.Match[str] | None:
    for pattern in patterns:
        match = pattern.fullmatch(column)
        if match is not None:
            return match
    return None


def _unit_of(match: re.Match[str]) -> str:
    groups = match.groupdict()
    unit = groups.get("unit") or groups.get("ending") or ""
    if known_unit(unit) is not None:
        return unit
    return ""
