"""Lines and tables of text, as most formats of recordings are written."""

import codecs
import csv
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from maniport.util.input_limits import (
    FRAMES,
    LINE,
    PLACES,
    RECORDING_BYTES,
    read_whole,
    require_at_most,
)
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


def fields_of(line: str, separator: str | None) -> list[str]:
    """Split a line into fields without surrounding blanks; None splits at blanks."""
    fields = line.split(separator)
    if separator and '"' in line:
        with suppress(csv.Error):  # a quoted field of 131 072 characters and more
            fields = next(csv.reader([line], delimiter=separator))
    return [field.strip() for field in fields]


def rows_from(lines: Sequence[str], start: int) -> list[Row]:
    """Return the lines from an index on, without empty ones."""
    return [(number, line) for number, line in enumerate(lines[start:], start + 1) if line.strip()]


def number_table(
    rows: Sequence[Row],
    width: int,
    separator: str | None = None,
    used: Sequence[int] = (),
    short: bool = False,
) -> Array:
    """Return the numbers of the used columns (default: all) of a table, shape (len(rows), len(used)).

    Empty fields and placeholders are nan; with `short` also those that are missing at the end of a row.
    """
    if not rows:
        raise ValueError("the file holds no frames")
    require_at_most(len(rows) * width, 3 * PLACES, "numbers")
    used = used or range(width)
    table = np.empty((len(rows), len(used)))
    for i, (number, line) in enumerate(rows):
        fields = fields_of(line, separator)
        while len(fields) > width and not fields[-1]:
            fields.pop()
        if short:
            fields += [""] * (width - len(fields))
        if len(fields) != width:
            cut = i == len(rows) - 1 and len(fields) < width
            fault = "the file is cut off" if cut else "the table is broken"
            raise ValueError(f"{fault} at line {number}: {len(fields)} values instead of {width}")
        try:
            table[i] = [_number(fields[column]) for column in used]
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    return table


def positive_number(text: str) -> float | None:
    """Parse a positive finite number; None where there is none."""
    with suppress(ValueError):
        if 0 < (value := _number(text)) < np.inf:
            return value
    return None


def is_cut_off(declared: str, count: int) -> bool:
    """Whether a header declares at least two rows more than there are."""
    declared = declared.strip()[:15]
    return declared.isdecimal() and int(declared) > count + 1


def _number(field: str) -> float:
    """Parse a number; nan for the placeholders of missing numbers."""
    try:
        return float(field)
    except ValueError:
        missing = field.lower() in ("", "na", "n/a", "null", "none", "-")
        return np.nan if missing else float(field.replace(",", "."))
