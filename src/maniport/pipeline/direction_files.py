"""Lines of force and speed that a file gives, in place of the person's."""

import csv
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError, InvalidInputError, argument, some_of
from maniport.pipeline.options import TransferOptions
from maniport.util.files import load_arrays
from maniport.util.input_limits import FRAMES, RECORDING_BYTES, read_whole, require_at_most
from maniport.util.validation import Array, as_times

TIMES = ("time_s", "time")
COLUMNS = {
    "force": tuple(f"direction_force_{axis}" for axis in "xyz"),
    "velocity": tuple(f"direction_speed_{axis}" for axis in "xyz"),
}
"""Columns of a line by the kind of its extent, as ``person.csv`` has them."""

COVERED = 1e-3  # [s]: by which times may lack the ends of a recording; many files have milliseconds


@dataclass(frozen=True, eq=False)
class GivenLines:
    """Lines along which an arm shall be strong or fast, at times of a recording.

    Attributes
    ----------
    source : str
        File that they come from.
    time : ndarray, shape (m,)
        [s]
    lines : mapping
        Unit vectors (m, 3) in the robot's base frame by kind, ``"force"`` or ``"velocity"``, none of which points away
        from the one before.
    """

    source: str
    time: Array
    lines: Mapping[str, Array]

    def require_cover(self, time: Array) -> None:
        """Raise `InvalidInputError` unless all of these times [s] are within those of the lines."""
        if self.time[0] <= time[0] + COVERED and time[-1] - COVERED <= self.time[-1]:
            return
        raise InvalidInputError(
            f"{argument('directions')}: the times of {self.source}, {self.time[0]:g} to "
            f"{self.time[-1]:g} s, must cover the part of the recording that is used, "
            f"{time[0]:g} to {time[-1]:g} s; add rows, or use less by {argument('start')} and "
            f"{argument('stop')}"
        )

    def at(self, time: Array, kind: str) -> Array:
        """Interpolate lines of a kind at times (n,) [s]; unit vectors, shape (n, 3)."""
        self.require_cover(time)
        columns = [np.interp(time, self.time, column) for column in self.lines[kind].T]
        vectors = np.stack(columns, axis=1)
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def given_lines(options: TransferOptions, arms: int) -> tuple[GivenLines, ...]:
    """Read the files of lines that options name, one for each arm; none where they name none.

    Raises
    ------
    InvalidInputError
        When there is not one file for each arm, no motion is planned along the lines, or a file lacks the lines of the
        kind that shall be large.
    FileFormatError
        When a file cannot be read.
    """
    files = options.directions
    if not files:
        return ()
    flag = argument("directions")
    if not options.move:
        raise InvalidInputError(f"{flag} needs a trajectory; found {argument('no_move')}")
    if options.part == "rotation":
        raise InvalidInputError(
            f"{flag} needs ellipsoids of the translation; found {argument('part', 'rotation')}"
        )
    if len(files) != arms:
        raise InvalidInputError(
            f"{flag} must be one file for each arm, left first: {arms}; found {len(files)}"
        )
    results = []
    for file in files:
        given = read_lines(file)
        needed = {"force": "force", "speed": "velocity"}.get(options.capability)
        if needed is not None and needed not in given.lines:
            raise InvalidInputError(
                f"{argument('capability', options.capability)} needs {', '.join(COLUMNS[needed])}; "
                f"{given.source} lacks them"
            )
        results.append(given)
    return tuple(results)


def read_lines(path: str | os.PathLike[str]) -> GivenLines:
    """Read lines from ``.npz`` or a table with commas, with the columns of ``person.csv``.

    Raises
    ------
    FileFormatError
        When columns are missing, numbers are not finite, a vector has no length, or times do not increase.
    """
    source = os.fspath(path)
    needed = [*TIMES, *COLUMNS["force"], *COLUMNS["velocity"]]
    if Path(path).suffix.lower() == ".npz":
        columns = _npz_columns(path, needed)
    else:
        columns = _csv_columns(path, needed)

    time_name = _name_of_time(source, columns)
    try:
        time = as_times(columns[time_name], f"{time_name} in {source}")
    except InvalidInputError as error:
        raise FileFormatError(str(error)) from None
    lines = {}
    for kind, names in COLUMNS.items():
        missing = [name for name in names if name not in columns]
        if len(missing) == len(names):
            continue
        if missing:
            raise FileFormatError(f"{source}: lacks {', '.join(missing)}; found {some_of(columns)}")
        for name in names:
            if columns[name].shape != time.shape:
                raise FileFormatError(
                    f"{source}: {name} must have one number for each of {len(time)} times; "
                    f"found shape {columns[name].shape}"
                )
        vectors = np.stack([columns[name] for name in names], axis=1)
        lines[kind] = _aligned(_unit_vectors(vectors, time, f"{source}: {', '.join(names)}"))
    if not lines:
        wanted = " or ".join(", ".join(names) for names in COLUMNS.values())
        raise FileFormatError(f"{source}: needs the columns {wanted}; found {some_of(columns)}")
    return GivenLines(source, time, lines)


def _name_of_time(source: str, columns: Mapping[str, Array]) -> str:
    for name in TIMES:
        if name in columns:
            return name
    raise FileFormatError(f"{source}: needs the column {TIMES[0]}; found {some_of(columns)}")


def _npz_columns(path: str | os.PathLike[str], needed: list[str]) -> dict[str, Array]:
    """Return the arrays that are needed, as numbers."""
    columns = {}
    for name, values in load_arrays(path, "file of directions", needed).items():
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            raise FileFormatError(
                f"{os.fspath(path)}: {name} must be numbers; found {array.dtype.name}"
            )
        columns[name] = array.astype(np.float64)
    return columns


def _csv_columns(path: str | os.PathLike[str], needed: list[str]) -> dict[str, Array]:
    """Return the columns that are needed, of a table whose first line names them."""
    source = os.fspath(path)
    text = read_whole(path, (), RECORDING_BYTES).decode("utf-8", "replace").lstrip("\ufeff")
    require_at_most(text.count("\n"), FRAMES, "rows", path)
    header, _, body = text.partition("\n")
    names = [name.strip() for name in next(csv.reader([header.strip()]), [])]
    places = [place for place, name in enumerate(names) if name in needed]
    if not places or not body.strip():
        rows = "" if places else f"; the first line is {header.strip()[:80]!r}"
        raise FileFormatError(
            f"{source}: needs a line with {TIMES[0]} and the names of directions, and rows of "
            f"numbers with commas{rows}"
        )
    try:
        table = np.loadtxt(
            io.StringIO(body), delimiter=",", ndmin=2, comments=None, usecols=places, quotechar='"'
        )
    except ValueError as error:
        raise FileFormatError(f"{source}: must hold numbers with commas: {error}") from None
    return {names[place]: table[:, column] for column, place in enumerate(places)}


def _unit_vectors(vectors: Array, time: Array, where: str) -> Array:
    """Return vectors (m, 3) of length 1; the largest component is made 1 first, so that no square overflows."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    wrong = np.flatnonzero(~np.isfinite(largest[:, 0]) | (largest[:, 0] == 0.0))
    if len(wrong):
        row = int(wrong[0])
        found = ", ".join(f"{value:g}" for value in vectors[row])
        raise FileFormatError(
            f"{where} must be finite and not all 0; found {found} at {time[row]:g} s"
        )
    scaled = vectors / largest
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1, keepdims=True))


def _aligned(lines: Array) -> Array:
    """Turn lines around that point away from the line before: they have no sign, but interpolation has."""
    turns = np.where(np.sum(lines[1:] * lines[:-1], axis=1) < 0.0, -1.0, 1.0)
    signs = np.cumprod(np.append(1.0, turns))
    return np.asarray(lines * signs[:, None])
