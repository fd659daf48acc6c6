"""The table of a batch, a row for each pair of recording and robot: as CSV, as Parquet, and as a page."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from maniport.errors import MissingPackageError, counted, printable
from maniport.report.describe.motions import STATISTICS
from maniport.report.render import PAGE as REPORT
from maniport.report.render import as_numbers
from maniport.report.values import SUFFIXES, Report
from maniport.util.atomic_io import write_text, written_whole
from maniport.util.files import spreadsheet_cell
from maniport.util.optional import parquet_writer, pyarrow

Row = dict[str, Any]
"""Values of a pair by the names of the columns: texts, and numbers, which may be None."""

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


def _metrics() -> tuple[str, ...]:
    """Return the numbers of a summary that are columns, by their path in it."""
    names = []
    for kind in ("force", "velocity"):
        for value in ("robot.median", "robot.p5", "position_only.median"):
            names.append(f"motion.{kind}.{value}")
    for key, (_, unit, _) in STATISTICS.items():
        if key != "relative_position_error":
            names += _each(f"motion.{key}{SUFFIXES.get(unit, '')}", NUMBERS)
    names += _each("motion.mean_distance", ("mean", "infeasible", "path", "motion"))
    for limit in ("position", "velocity", "acceleration", "jerk"):
        names.append(f"motion.limits.used.{limit}.share")
    names += _each("motion.collisions", ("checked", "share", "clearance_mm"))
    names += ["motion.pointwise_ratio", "motion.waypoints.missed", "motion.waypoints.count"]
    names += _each("motion.duration_s", ("robot", "person"))
    names += _each("placement", ("scale", "yaw_deg"))
    names += _each("placement.base_orientation", ("tilt_deg", "heading_deg"))
    names += _each("placement", ("points_out_of_reach", "farthest_out_of_reach_mm"))
    names += _each("adapter", ("cost", "iterations", "converged"))
    names += _each("adapter.report", ("gap", "gap_p95", "rank_correlation", "near_singular"))
    names.append("person.frames")
    names += _each("person.segment_lengths_m", PARTS)
    for part in PARTS:
        names += _each(f"person.residual_deg.{part}", NUMBERS)
    names += _each("recording", ("frames", "duration_s", "rate_hz"))
    return tuple(names)


def _each(path: str, names: Iterable[str]) -> list[str]:
    """Return the paths of several numbers in one section."""
    return [f"{path}.{name}" for name in names]


METRICS = _metrics()
"""Numbers of a summary by their path in it. The list is fixed, so that all batches have the same columns; numbers by
joint, marker or method are in the summaries alone."""

COLUMNS = (*TEXTS, COMPUTING, *METRICS)

TABLES = ("table.csv", "table.parquet")
PAGE = "index.html"


def row_of(
    report: Report, recording: str, robot: str, folder: str, arms: Sequence[str] = ()
) -> Row:
    """Return the row of a pair that is done; of several arms with names, the largest of each number."""
    numbers = as_numbers(report)
    row = failed_row(recording, robot, "")
    row["state"] = "done"
    row["folder"] = folder
    row["warnings"] = "\n".join(report.warnings)
    row["warning_keys"] = " ".join(report.warning_keys)
    row["status"] = report.status
    row["verdict"] = report.outcome
    for name in METRICS:
        paths = [name, name.replace("motion.", "arms."), *(f"{arm}_{name}" for arm in arms)]
        values = [_number(numbers, path) for path in paths]
        row[name] = max((value for value in values if value is not None), default=None)
    return row


def failed_row(recording: str, robot: str, reason: str) -> Row:
    """Return the row of a pair that failed."""
    row: Row = dict.fromkeys(COLUMNS)
    row |= dict.fromkeys(TEXTS, "")
    row["recording"] = recording
    row["robot"] = robot
    row["state"] = "failed"
    row["reason"] = printable(reason)
    return row


def _number(numbers: object, path: str) -> float | None:
    """Return a number of a summary by its path, None where there is none."""
    for key in path.split("."):
        if not isinstance(numbers, Mapping):
            return None
        numbers = numbers.get(key)
    if isinstance(numbers, bool | int | float):
        return float(numbers)
    return None


def is_row(row: object) -> bool:
    """Return whether JSON that was read is the row of a pair that is done."""
    if not isinstance(row, dict) or row.keys() != set(COLUMNS) or row["state"] != "done":
        return False
    for name, value in row.items():
        if name in TEXTS and not isinstance(value, str):
            return False
        if name not in TEXTS and not isinstance(value, int | float | None):
            return False
    return True


class Failure(TypedDict):
    """Pairs of one recording that failed for the same reason."""

    recording: str
    robots: list[str]
    reason: str


def failures(rows: Iterable[Row]) -> list[Failure]:
    """Return the pairs that failed, grouped by recording and reason."""
    groups = dict[tuple[str, str], Failure]()
    for row in rows:
        if row["state"] != "failed":
            continue
        key = row["recording"], row["reason"]
        if key not in groups:
            groups[key] = Failure(recording=key[0], robots=[], reason=key[1])
        groups[key]["robots"].append(row["robot"])
    return list(groups.values())


def write_tables(folder: Path, rows: Sequence[Row]) -> tuple[str, ...]:
    """Write the table as CSV, and as Parquet where pyarrow is installed; return the names of the files."""
    stream = StringIO(newline="")
    lines = csv.writer(stream, lineterminator="\n")
    lines.writerow(COLUMNS)
    for row in rows:
        lines.writerow([spreadsheet_cell(row[name]) for name in COLUMNS])
    write_text(folder / TABLES[0], stream.getvalue())

    parquet = folder / TABLES[1]
    try:
        arrow = pyarrow()
        writer = parquet_writer()
    except MissingPackageError:
        parquet.unlink(missing_ok=True)  # an earlier one has the rows of an earlier run
        return TABLES[:1]
    kinds = dict.fromkeys(COLUMNS, arrow.float64()) | dict.fromkeys(TEXTS, arrow.string())
    table = arrow.Table.from_pylist(list(rows), arrow.schema(kinds))
    with written_whole(parquet) as temporary:
        writer.write_table(table, temporary, compression="zstd")
    return TABLES


class PageMetric(NamedTuple):
    """A column of the page."""

    column: str  # of the table
    name: str  # that the page shows
    decimals: int


def _page_metrics() -> tuple[PageMetric, ...]:
    """Return the metrics that the page shows."""
    metrics = [
        PageMetric("motion.force.robot.median", "Force where the person is strong [N]", 0),
        PageMetric("motion.force.position_only.median", "Positions only [N]", 0),
        PageMetric("motion.velocity.robot.median", "Speed where the person is fast [m/s]", 2),
        PageMetric("motion.velocity.position_only.median", "Positions only [m/s]", 2),
    ]
    for value, name in NUMBERS.items():
        metrics.append(PageMetric(f"motion.distance.{value}", f"Ellipsoid distance, {name}", 2))
    for value, name in NUMBERS.items():
        column = f"motion.position_error_mm.{value}"
        metrics.append(PageMetric(column, f"Position error, {name} [mm]", 1))
    gap = "motion.feasibility_gap.median"
    metrics.append(PageMetric(gap, "Distance to the feasible set, median", 2))
    metrics.append(PageMetric("motion.duration_s.robot", "Duration [s]", 1))
    metrics.append(PageMetric(COMPUTING, "Computing time [s]", 1))
    return tuple(metrics)


PAGE_METRICS = _page_metrics()


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

    recordings = counted(len({row["recording"] for row in rows}), "recording")
    robots = counted(len({row["robot"] for row in rows}), "robot")
    title = f"{recordings} on {robots}"
    environment = Environment(
        loader=PackageLoader(__package__, "assets"), autoescape=True, trim_blocks=True
    )
    file = "summary.md"
    if pages:
        file = REPORT
    body = environment.get_template("overview.html").render(
        title=title,
        rows=rows,
        done=len(done),
        failed=len(rows) - len(done),
        count=count,
        tables=tables,
        file=file,
        metrics=PAGE_METRICS,
        failures=failures(rows),
        warnings=sorted(warned.items(), key=lambda item: -len(item[1])),
    )
    assets = files(__package__).joinpath("assets")
    script = assets.joinpath("overview.js").read_text(encoding="utf-8")
    style = assets.joinpath("overview.css").read_text(encoding="utf-8")
    write_text(path, document(title, body, script, style))
