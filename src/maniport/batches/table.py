"""The table of a batch: a row for each pair, with metrics by their names in `summary.json`."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from maniport.atomic_io import written_whole
from maniport.errors import MissingPackageError, as_text
from maniport.optional import parquet_writer, pyarrow
from maniport.telling.facts import Facts
from maniport.telling.renderings import as_numbers

Row = Mapping[str, Any]

DONE, FAILED = "done", "failed"
"""What became of a pair."""

TEXTS = ("recording", "robot", "state", "reason", "warnings", "warning_keys", "folder", "status", "verdict")

COMPUTING = "computing_s"
"""Processor time of a pair [s], the one column that two runs of the same batch fill differently."""

FIRST = (*TEXTS, COMPUTING)
"""Columns before those of the metrics."""

SPREAD = (".median", ".p95", ".max")

PARTS = ("upper arm", "forearm", "hand")

METRICS = (
    *(f"motion.{name}{value}" for name in ("distance", "tip_error_mm", "orientation_error_deg", "major_axis_angle_deg",
                                           "feasibility_gap", "node_floor") for value in SPREAD),
    *(f"motion.semi_axes.{axis}.median" for axis in ("major", "middle", "minor")),
    *(f"motion.mean_distance.{part}" for part in ("mean", "no_posture", "path", "way")),
    *(f"motion.limits.used.{limit}.share" for limit in ("position", "velocity", "acceleration", "jerk")),
    *(f"motion.collisions.{name}" for name in ("checked", "share", "clearance_mm")),
    *(f"motion.{name}" for name in ("over_node_floor", "points_missed", "points", "leaps.points", "duration_s",
                                    "jerk.rms", "jerk.peak")),
    *(f"placement.{name}" for name in ("scale", "yaw_deg", "mount.tilt_deg", "mount.heading_deg",
                                       "points_out_of_reach", "farthest_out_of_reach_mm")),
    *(f"adapter.{name}" for name in ("dimension", "cost_start", "cost", "iterations", "converged",
                                     "teacher_dispersion", "student_dispersion", "dispersion_ratio")),
    *(f"adapter.report.{name}" for name in ("gap", "gap_p95", "moved", "step", "structure", "turn", "singular_value",
                                            "folded")),
    "person.frames", "person.largest_joint_step_deg",
    *(f"person.segment_lengths_m.{part}" for part in PARTS),
    *(f"person.residual_deg.{part}{value}" for part in PARTS for value in SPREAD),
    "recording.frames", "recording.duration_s", "recording.rate_hz",
)  # fmt: skip
"""Numbers of a summary by their path in it. The list is fixed, so that all batches have the same columns; what depends
on names of joints, markers or methods is in the summaries alone."""

COLUMNS = (*FIRST, *METRICS)

TABLES = TABLE, PARQUET = "table.csv", "table.parquet"

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A cell that begins so is computed by spreadsheets."""


def row_of(facts: Facts, recording: str, robot: str, folder: str) -> dict[str, Any]:
    """Return the row of a pair that is done."""
    numbers = as_numbers(facts)
    summary = facts.summary
    return {
        **_empty_row(recording, robot, DONE),
        "warnings": "\n".join(facts.warnings),
        "warning_keys": " ".join(facts.warning_keys),
        "folder": folder,
        "status": "" if summary is None else summary.status,
        "verdict": "" if summary is None else summary.title,
        **{name: _number(numbers, name) for name in METRICS},
    }


def failed_row(recording: str, robot: str, reason: str) -> dict[str, Any]:
    """Return the row of a pair that failed."""
    return {**_empty_row(recording, robot, FAILED), "reason": as_text(reason)}


def _empty_row(recording: str, robot: str, state: str) -> dict[str, Any]:
    names = {"recording": recording, "robot": robot, "state": state}
    return dict.fromkeys(COLUMNS) | dict.fromkeys(TEXTS, "") | names


def _number(numbers: Any, name: str) -> float | None:
    """Return a number of a summary by its path, None where there is none."""
    for key in name.split("."):
        numbers = numbers.get(key) if isinstance(numbers, Mapping) else None
    return float(numbers) if isinstance(numbers, bool | int | float) else None


def is_row(found: Any) -> bool:
    """Return whether JSON that was read is the row of a pair that is done."""
    if not isinstance(found, dict) or found.keys() != set(COLUMNS) or found["state"] != DONE:
        return False
    texts = all(isinstance(found[name], str) for name in TEXTS)
    numbers = all(isinstance(value, int | float | None) for name, value in found.items() if name not in TEXTS)
    return texts and numbers


def failures(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return the pairs that failed, grouped by recording and reason: ``recording``, ``robots``, ``reason``."""
    robots = dict[tuple[str, str], list[str]]()
    for row in rows:
        if row["state"] == FAILED:
            robots.setdefault((row["recording"], row["reason"]), []).append(row["robot"])
    return [{"recording": name, "robots": some, "reason": reason} for (name, reason), some in robots.items()]


def _cell(value: Any) -> Any:
    """Return a value as CSV has it; an apostrophe precedes a text that spreadsheets would take for a formula."""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def write_tables(folder: Path, rows: Sequence[Row]) -> tuple[str, ...]:
    """Write the table as CSV, and as Parquet where pyarrow is installed; return the names of the files."""
    stream = StringIO(newline="")
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(COLUMNS)
    lines.writerows([_cell(row[name]) for name in COLUMNS] for row in rows)
    with written_whole(folder / TABLE) as temporary:
        temporary.write_text(stream.getvalue(), encoding="utf-8", newline="")
    try:
        arrow, parquet = pyarrow(), parquet_writer()
    except MissingPackageError:
        (folder / PARQUET).unlink(missing_ok=True)  # an earlier one has the rows of an earlier run
        return (TABLE,)
    kinds = dict.fromkeys(TEXTS, arrow.string())
    arrays = [arrow.array([row[name] for row in rows], type=kinds.get(name, arrow.float64())) for name in COLUMNS]
    with written_whole(folder / PARQUET) as temporary:
        parquet.write_table(arrow.table(arrays, names=list(COLUMNS)), temporary, compression="zstd")
    return TABLES
