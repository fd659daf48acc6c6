"""Lines and tables of text, as most formats of recordings are written."""

import codecs
import csv
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from maniport.util.input_limits import FRAMES, LINE, PLACES, RECORDING_BYTES, read_whole, require_at_most
from maniport.util.validation import Array

Row = tuple[int, str]  # The number of a line, from one, and the line

LARGEST_ANGLE = 1e3  # Joint angles beyond this count as missing [rad]


def text_lines(file: Path) -> list[str]:
    """Return the lines of a file, with any line ends."""
    content = read_whole(file, (), RECORDING_BYTES)
    ends = (b"\n", b"\r", b"\v", b"\f", b"\x1c", b"\x1d", b"\x1e", b"\xc2\x85", b"\xe2\x80")
    require_at_most(sum(map(content.count, ends)), 3 * FRAMES, "ends of lines")
    lines = decoded(content).splitlines()
    require_at_most(max(map(len, lines), default=0), LINE, "characters in a line")
    return lines


def decoded(content: bytes) -> str:
    """Decode UTF-8, or UTF-16 with a byte order mark, as programs on Windows write it."""
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if wide else "utf-8", errors="replace").lstrip("\ufeff")


def separator_of(line: str) -> str:
    """Return the separator of the fields of a line: comma, semicolon or tab."""
    return max(",;\t", key=line.count)


def fields_of(line: str, separator: str) -> list[str]:
    """Split a line into fields without surrounding blanks."""
    fields = line.split(separator)
    if '"' in line:
        with suppress(csv.Error):  # a quoted field of 131 072 characters and more
            fields = next(csv.reader([line], delimiter=separator))
    return [field.strip() for field in fields]


def rows_from(lines: Sequence[str], start: int) -> list[Row]:
    """Return the lines from an index on, without empty ones."""
    return [(number, line) for number, line in enumerate(lines[start:], start + 1) if line.strip()]


def number_table(
    rows: Sequence[Row],
    width: int,
    split: Callable[[str], list[str]] = str.split,
    used: Sequence[int] | None = None,
    short: bool = False,
) -> Array:
    """Return the numbers of the used columns (default: all) of a table, shape (len(rows), len(used)).

    Empty fields and placeholders are nan; with `short` also those that are missing at the end of a row.
    """
    if not rows:
        raise ValueError("the file holds no frames")
    require_at_most(len(rows) * width, 3 * PLACES, "numbers")
    table = np.empty((len(rows), width if used is None else len(used)))
    for i, (number, line) in enumerate(rows):
        fields = split(line)
        while len(fields) > width and not fields[-1].strip():
            fields.pop()
        if short:
            fields += [""] * (width - len(fields))
        if len(fields) != width:
            last = i == len(rows) - 1 and len(fields) < width
            fault = "the file is cut off" if last else "the table is broken"
            raise ValueError(f"{fault} at line {number}: {len(fields)} values instead of {width}")
        if used is not None:
            fields = [fields[column] for column in used]
        try:
            table[i] = list(map(float, fields))
        except ValueError:  # decimal commas or placeholders
            try:
                table[i] = list(map(_number, fields))
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
    return table


def positive_number(text: str) -> float | None:
    """Parse a positive finite number; None where there is none."""
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if 0 < value < np.inf else None


def _number(field: str) -> float:
    """Parse a number; nan for the placeholders of missing numbers."""
    if field.strip().lower() in ("", "na", "n/a", "null", "none", "-"):
        return np.nan
    return float(field.replace(",", "."))
