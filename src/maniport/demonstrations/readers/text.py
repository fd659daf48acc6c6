"""Lines and tables of text, as most formats of recordings are written."""

import codecs
import csv
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from maniport.errors import FileFormatError
from maniport.input_limits import FRAMES, LINE, PLACES, RECORDING_BYTES, read_whole, require_at_most
from maniport.validation import Array

_ENDS = (b"\n", b"\r", b"\v", b"\f", b"\x1c", b"\x1d", b"\x1e", b"\xc2\x85", b"\xe2\x80")
"""Bytes without which text has no end of a line."""

MISSING = ("", "na", "n/a", "null", "none", "-")
"""What programs write where there is no number, besides ``nan``."""

Row = tuple[int, str]
"""The number of a line, from one, and the line."""


def text_lines(file: Path) -> list[str]:
    """The lines of a file, whatever ends them."""
    content = read_whole(file, (), RECORDING_BYTES)
    require_at_most(sum(map(content.count, _ENDS)), 3 * FRAMES, "ends of lines", file)
    lines = decoded(content).splitlines()
    require_at_most(max(map(len, lines), default=0), LINE, "characters in a line", file)
    return lines


def decoded(content: bytes) -> str:
    """Text in UTF-8, or in UTF-16 where its first bytes say so, as programs on Windows write it."""
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if wide else "utf-8", errors="replace").lstrip("\ufeff")


def most_used(line: str) -> str:
    """What parts the fields of a line: commas, semicolons or tabs."""
    return max(",;\t", key=line.count)


def fields_of(line: str, sign: str) -> list[str]:
    """The fields of a line, without blanks around them."""
    fields = line.split(sign)
    if '"' in line:
        with suppress(csv.Error):  # a quoted field of 131 072 characters and more, which is none
            fields = next(csv.reader([line], delimiter=sign))
    return [field.strip() for field in fields]


def rows_from(lines: Sequence[str], start: int) -> list[Row]:
    """The lines from an index on, without empty ones."""
    return [(number, line) for number, line in enumerate(lines[start:], start + 1) if line.strip()]


def number_table(
    file: Path, rows: Sequence[Row], width: int, split: Callable[[str], list[str]], short: bool = False
) -> Array:
    """Numbers of a table, shape (len(rows), width); nan where a field is empty."""
    if not rows:
        raise FileFormatError(f"{file}: the file holds no frames")
    require_at_most(len(rows) * width, 3 * PLACES, "numbers", file)
    table = np.full((len(rows), width), np.nan)
    for i, (number, line) in enumerate(rows):
        fields = split(line)
        while len(fields) > width and not fields[-1].strip():
            fields.pop()
        if len(fields) > width or (len(fields) < width and not short):
            last = i == len(rows) - 1 and len(fields) < width
            fault = "the file is cut off" if last else "the table is broken"
            raise FileFormatError(f"{file}: {fault} at line {number}: {len(fields)} values instead of {width}")
        try:
            table[i, : len(fields)] = [float(field.replace(",", ".")) if field.strip() else np.nan for field in fields]
        except ValueError:
            table[i, : len(fields)] = [_number(file, number, field) for field in fields]
    return table


def _number(file: Path, line: int, field: str) -> float:
    """A number, or nan for what stands for a missing one."""
    try:
        return np.nan if field.strip().lower() in MISSING else float(field.replace(",", "."))
    except ValueError as error:
        raise FileFormatError(f"{file}: line {line}: {error}") from None
