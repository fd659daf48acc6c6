"""The table of a batch: a row for each pair, all its measures, by the names that `summary.json` has for them."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from maniport.errors import MissingPackageError
from maniport.files import written_whole
from maniport.optional import parquet_writer, pyarrow
from maniport.telling.facts import Facts
from maniport.telling.renderings import as_numbers
from maniport.wording import as_text

Row = Mapping[str, Any]

DONE, FAILED = "done", "failed"
"""What became of a pair."""

FIRST = ("recording", "robot", "state", "reason", "warnings", "warning_keys", "folder", "status", "verdict")
"""Columns that every table has, before those of the measures."""

TABLES = TABLE, PARQUET = "table.csv", "table.parquet"

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A cell that begins so is computed by spreadsheets."""

SETTINGS = ("title", "status", "verdict", "warnings", "notes", "run")
"""Parts of a summary that are no measures."""


def row_of(facts: Facts, recording: str, robot: str, folder: str) -> dict[str, Any]:
    """The row of a pair that is done: all numbers of its summary, but for those in lists."""
    numbers = as_numbers(facts)
    verdict = facts.verdict
    return {
        **_begun(recording, robot, DONE),
        "warnings": "\n".join(facts.warnings),
        "warning_keys": " ".join(facts.warning_keys),
        "folder": folder,
        "status": "" if verdict is None else verdict.status,
        "verdict": "" if verdict is None else verdict.title,
        **dict(_leaves({key: value for key, value in numbers.items() if key not in SETTINGS})),
    }


def failed_row(recording: str, robot: str, reason: str) -> dict[str, Any]:
    """The row of a pair of which nothing came."""
    return {**_begun(recording, robot, FAILED), "reason": as_text(reason)}


def _begun(recording: str, robot: str, state: str) -> dict[str, Any]:
    return {**dict.fromkeys(FIRST, ""), "recording": recording, "robot": robot, "state": state}


def _leaves(numbers: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, float | None]]:
    for key, value in numbers.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{key}.")
        elif value is None or isinstance(value, bool | int | float):
            yield before + key, value if value is None else float(value)


def is_row(found: Any) -> bool:
    """Whether something that was read is the row of a pair that is done."""
    if not isinstance(found, dict) or found.get("state") != DONE:
        return False
    texts = all(isinstance(found.get(name), str) for name in FIRST)
    return texts and all(isinstance(value, int | float | None) for key, value in found.items() if key not in FIRST)


def columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """The rows side by side: the columns that all tables have, then the measures; None where a row has none."""
    names = dict.fromkeys((*FIRST, *(name for row in rows for name in row)))
    return {name: [row.get(name) for row in rows] for name in names}


def _cell(value: Any) -> Any:
    """A value as CSV has it: before a text that spreadsheets would take for a formula there is an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def write_tables(folder: Path, rows: Sequence[Row]) -> tuple[str, ...]:
    """Write the table as CSV, and as Parquet where pyarrow is there; return the names of the files."""
    found = columns(rows)
    stream = StringIO(newline="")
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(found)
    lines.writerows([_cell(value) for value in line] for line in zip(*found.values(), strict=True))
    with written_whole(folder / TABLE) as temporary:
        temporary.write_text(stream.getvalue(), encoding="utf-8", newline="")
    try:
        arrow, parquet = pyarrow(), parquet_writer()
    except MissingPackageError:
        (folder / PARQUET).unlink(missing_ok=True)  # an earlier one tells of something else
        return (TABLE,)
    kinds = dict.fromkeys(FIRST, arrow.string())
    arrays = [arrow.array(values, type=kinds.get(name, arrow.float64())) for name, values in found.items()]
    with written_whole(folder / PARQUET) as temporary:
        parquet.write_table(arrow.table(arrays, names=list(found)), temporary, compression="zstd")
    return TABLES
