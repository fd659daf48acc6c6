"""The table of a batch, a row for each pair of recording and robot: as CSV, as Parquet, and as a page."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from io import StringIO
from pathlib import Path
from typing import Any

from maniport.errors import MissingPackageError, printable
from maniport.report.describe.motions import STATISTICS
from maniport.report.render import PAGE as REPORT
from maniport.report.render import as_numbers
from maniport.report.values import SUFFIXES, Report
from maniport.util.atomic_io import write_text, written_whole
from maniport.util.files import spreadsheet_cell
from maniport.util.optional import parquet_writer, pyarrow

Row = Mapping[str, Any]

TEXTS = (
    "recording",
    "robot",
    "state",
    "reason",
    "warnings",
    "warning_keys",
    "folder",
    "status",
    "verdict",
)
COMPUTING = "computing_s"  # Processor time of a pair [s], the one column in which two runs of the same batch differ
NUMBERS = {"median": "median", "p95": "95th percentile", "max": "max"}  # Of statistics
PARTS = "upper arm", "forearm", "hand"

CAPABILITIES = (
    *(f"motion.force.{name}" for name in ("robot.median", "robot.p5", "position_only.median")),
    *(f"motion.velocity.{name}" for name in ("robot.median", "robot.p5", "position_only.median")),
)
METRICS = (
    *CAPABILITIES,
    *(f"motion.{key}{SUFFIXES.get(unit, '')}.{value}" for key, (_, unit, _) in STATISTICS.items()
      if key != "relative_position_error" for value in NUMBERS),
    *(f"motion.mean_distance.{part}" for part in ("mean", "infeasible", "path", "motion")),
    *(f"motion.limits.used.{limit}.share" for limit in ("position", "velocity", "acceleration", "jerk")),
    *(f"motion.collisions.{name}" for name in ("checked", "share", "clearance_mm")),
    *(f"motion.{name}" for name in ("pointwise_ratio", "waypoints.missed", "waypoints.count",
                                    "duration_s.robot", "duration_s.person")),
    *(f"placement.{name}" for name in ("scale", "yaw_deg", "base_orientation.tilt_deg", "base_orientation.heading_deg",
                                       "points_out_of_reach", "farthest_out_of_reach_mm")),
    *(f"adapter.{name}" for name in ("cost", "iterations", "converged")),
    *(f"adapter.report.{name}" for name in ("gap", "gap_p95", "rank_correlation", "near_singular")),
    "person.frames",
    *(f"person.segment_lengths_m.{part}" for part in PARTS),
    *(f"person.residual_deg.{part}.{value}" for part in PARTS for value in NUMBERS),
    "recording.frames", "recording.duration_s", "recording.rate_hz",
)  # fmt: skip
"""Numbers of a summary by their path in it. The list is fixed, so that all batches have the same columns; numbers by
joint, marker or method are in the summaries alone."""

COLUMNS = (*TEXTS, COMPUTING, *METRICS)

TABLES, PAGE = ("table.csv", "table.parquet"), "index.html"


def row_of(
    report: Report, recording: str, robot: str, folder: str, arms: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the row of a pair that is done; of several arms with names, the largest of each number."""
    numbers, row = (
        as_numbers(report),
        failed_row(recording, robot, "") | {"state": "done", "folder": folder},
    )
    row |= {"warnings": "\n".join(report.warnings), "warning_keys": " ".join(report.warning_keys)}
    row |= {"status": report.status, "verdict": report.outcome}
    for name in METRICS:
        of_all = name.replace("motion.", "arms.")
        values = [
            _number(numbers, key) for key in (name, of_all, *(f"{arm}_{name}" for arm in arms))
        ]
        row[name] = max((value for value in values if value is not None), default=None)
    return row


def failed_row(recording: str, robot: str, reason: str) -> dict[str, Any]:
    """Return the row of a pair that failed."""
    names = {"recording": recording, "robot": robot, "state": "failed", "reason": printable(reason)}
    return dict.fromkeys(COLUMNS) | dict.fromkeys(TEXTS, "") | names


def _number(numbers: Any, name: str) -> float | None:
    """Return a number of a summary by its path, None where there is none."""
    for key in name.split("."):
        numbers = numbers.get(key) if isinstance(numbers, Mapping) else None
    return float(numbers) if isinstance(numbers, bool | int | float) else None


def is_row(row: Any) -> bool:
    """Return whether JSON that was read is the row of a pair that is done."""
    if not isinstance(row, dict) or row.keys() != set(COLUMNS) or row["state"] != "done":
        return False
    return all(
        isinstance(value, str if name in TEXTS else int | float | None)
        for name, value in row.items()
    )


def failures(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return the pairs that failed, grouped by recording and reason: ``recording``, ``robots``, ``reason``."""
    robots = dict[tuple[str, str], list[str]]()
    for row in rows:
        if row["state"] == "failed":
            robots.setdefault((row["recording"], row["reason"]), []).append(row["robot"])
    return [
        {"recording": name, "robots": some, "reason": reason}
        for (name, reason), some in robots.items()
    ]


def write_tables(folder: Path, rows: Sequence[Row]) -> tuple[str, ...]:
    """Write the table as CSV, and as Parquet where pyarrow is installed; return the names of the files."""
    table, parquet = (folder / name for name in TABLES)
    stream = StringIO(newline="")
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(COLUMNS)
    lines.writerows([spreadsheet_cell(row[name]) for name in COLUMNS] for row in rows)
    write_text(table, stream.getvalue())
    try:
        arrow, writer = pyarrow(), parquet_writer()
    except MissingPackageError:
        parquet.unlink(missing_ok=True)  # an earlier one has the rows of an earlier run
        return TABLES[:1]
    kinds = dict.fromkeys(TEXTS, arrow.string())
    schema = arrow.schema([(name, kinds.get(name, arrow.float64())) for name in COLUMNS])
    with written_whole(parquet) as temporary:
        writer.write_table(
            arrow.Table.from_pylist(list(rows), schema), temporary, compression="zstd"
        )
    return TABLES


PAGE_METRICS = (
    ("motion.force.robot.median", "Force where the person is strong [N]", 0),
    ("motion.force.position_only.median", "Positions only [N]", 0),
    ("motion.velocity.robot.median", "Speed where the person is fast [m/s]", 2),
    ("motion.velocity.position_only.median", "Positions only [m/s]", 2),
    *((f"motion.distance.{value}", f"Ellipsoid distance, {name}", 2) for value, name in NUMBERS.items()),
    *((f"motion.position_error_mm.{value}", f"Position error, {name} [mm]", 1) for value, name in NUMBERS.items()),
    ("motion.feasibility_gap.median", "Distance to the feasible set, median", 2),
    ("motion.duration_s.robot", "Duration [s]", 1),
    (COMPUTING, "Computing time [s]", 1),
)  # fmt: skip
"""Metrics that the page shows: column, name, and decimals."""


def write_overview(
    path: Path, rows: Sequence[Row], count: int, tables: Sequence[str], pages: bool
) -> None:
    """Write the page; `count`: pairs of the batch, `tables`: names of the tables, `pages`: each pair has a report."""
    from jinja2 import Environment, PackageLoader  # slow to load, and not needed by workers

    from maniport.report.page import document

    done = [row for row in rows if row["state"] != "failed"]
    warned = dict[str, list[Row]]()
    for row in done:
        for warning in filter(None, row["warnings"].split("\n")):
            warned.setdefault(warning, []).append(row)
    recordings, robots = (len({row[name] for row in rows}) for name in ("recording", "robot"))
    title = f"{recordings} recording{'s'[: recordings != 1]} on {robots} robot{'s'[: robots != 1]}"
    environment = Environment(
        loader=PackageLoader(__package__, "assets"), autoescape=True, trim_blocks=True
    )
    body = environment.get_template("overview.html").render(
        title=title,
        rows=rows,
        done=len(done),
        failed=len(rows) - len(done),
        count=count,
        tables=tables,
        file=REPORT if pages else "summary.md",
        metrics=PAGE_METRICS,
        failures=failures(rows),
        warnings=sorted(warned.items(), key=lambda item: -len(item[1])),
    )
    assets = files(__package__).joinpath("assets")
    script, style = (
        assets.joinpath(f"overview.{kind}").read_text(encoding="utf-8") for kind in ("js", "css")
    )
    write_text(path, document(title, body, script, style))
