"""Renderings of a report: Markdown, the text on a terminal, numbers for JSON, and tables for notebooks."""

import json
import math
import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from maniport.errors import printable
from maniport.report.values import INFO, SUFFIXES, Report, Section, Table, sentence
from maniport.util.atomic_io import written_whole

SUMMARY, PAGE = "summary.json", "report.html"
"""Files of a run: its report as numbers, and the page. A folder with both holds results."""

LEARNED = "learned"
FIGURES = ("arms", "ellipsoids", "curves", "motion", LEARNED)
"""Names of the figures of a result, which `maniport figures` adds."""

ENDINGS = (".png", ".svg")  # Formats of the files of a figure

# Begins HTML tags, entities, links, headings and quotations in Markdown, and escapes of such signs.
_MARKUP = re.compile(r"\\(?=[!-/:-@[-`{-~])|<(?=[A-Za-z/!?])|&(?=#?\w+;)|\](?=[(\[:])|^[#>]")


def escaped(text: str) -> str:
    r"""Return text, such as a name from a file, that Markdown shows as it is: without HTML, links and headings."""
    return _MARKUP.sub(r"\\\g<0>", printable(text))


def files_of(*names: str) -> tuple[str, ...]:
    """Return names of the files of figures that are saved without an ending."""
    return tuple(f"{name}{ending}" for name in names for ending in ENDINGS)


def as_markdown(report: Report, details: bool = False) -> str:
    """Render a `Report` as Markdown: the summary and warnings first, then the sections.

    Parameters
    ----------
    report : Report
    details : bool
        Whether sections that pages fold are rendered, too.

    Returns
    -------
    str
    """
    lines = [f"# {escaped(report.title)}", "", *([escaped(report.lead), ""] if report.lead else [])]
    if report.outcome:
        command = f" `{printable(report.command_for())}`" if report.command else ""
        texts = [escaped(report.status_text), escaped(report.cause), escaped(report.advice) + command]
        lines += [f"## {escaped(report.outcome)}", "", *(line for text in texts if text for line in (text, ""))]
    if report.warnings:
        lines += ["## Warnings", "", *(f"- {escaped(text)}" for text in report.warnings), ""]
    if report.outcome and not details:
        visible = [metric for section in report.sections if not section.folded for metric in section.metrics]
        lines += _section(Section("Arms", tuple(metric for metric in report.main_metrics if metric not in visible)))
    for section in report.sections:
        lines += _section(section) if details or not section.folded else []
    if report.outcome and not details:
        lines += [f"All metrics, settings and notes: {SUMMARY} and {PAGE}.", ""]
    return "\n".join(lines)


def as_numbers(report: Report) -> dict[str, Any]:
    """Return a `Report` for programs, ready for JSON: sections by key, units in the names, and the warnings.

    Parameters
    ----------
    report : Report

    Returns
    -------
    dict
    """
    result: dict[str, Any] = {"title": report.title}
    if report.outcome:
        texts = {"title": report.outcome, "text": report.cause, "advice": report.advice, "command": report.command}
        reasons = report.warning_keys if report.status else ()
        result |= {"status": report.status or None, "summary": texts | {"reasons": reasons}}
    result["warnings"] = [{"key": metric.key, "text": metric.text} for metric in report.warning_metrics]
    result["notes"] = report.notes
    for section in report.sections:
        entries = {metric.key + SUFFIXES.get(metric.unit, ""): metric.value for metric in section.metrics
                   if metric.key and (not metric.is_warning or metric.value is not None)}  # fmt: skip
        entries |= {table.key: table.value for table in section.tables if table.key}
        place = result.setdefault(section.key, {}) if entries and section.key else result
        place.update(entries)
    return dict(plain(result))


def as_terminal(report: Report, folder: str, width: int = 80, table_only: bool = False, most_warnings: int = 3) -> str:
    """Render the summary of a result for a terminal: outcome, main metrics, warnings and files."""
    metrics = report.main_metrics
    wide = max((len(metric.heading) for metric in metrics), default=0)
    table = []
    if any(metric.is_statistics for metric in metrics):
        table.append(f"  {'':<{wide}}{'median':>9}{'95th':>9}{'max':>9}")
    for metric in metrics:
        text = f"  {metric.text}"
        if metric.is_statistics:
            text = "".join(f"{cell:>9}" for cell in metric.cells) + f"  ({metric.where.removeprefix('at ')})"
        elif len(text) + wide + 2 > width:  # too long for a line: without the last remark
            text = re.sub(r" \([^()]*\)$", "", text)
        table.append(f"  {metric.heading:<{wide}}{text}")
    if table_only:
        return "\n".join(table)

    def wrapped(*texts: str, **options: Any) -> list[str]:
        whole = [re.sub(r"(?<=\d) (?=%)", "\xa0", printable(text)) for text in texts if text]  # "84 %" in one line
        return [line.replace("\xa0", " ") for text in whole for line in textwrap.wrap(text, width, **options)]

    lines = wrapped(f"Result: {report.outcome[:1].lower()}{report.outcome[1:]}", report.status_text)
    lines += [*table, *wrapped(report.cause)]
    for text in report.warnings[:most_warnings]:
        lines += wrapped(f"! {text}", subsequent_indent="  ")
    if (more := len(report.warnings) - most_warnings) > 0:
        lines.append(f"! {more} more warning{'s'[: more != 1]} in summary.md")
    joints = Path(folder, "joints.csv")
    files = {
        "Next": printable(report.command_for(folder)) if report.command else "",
        "Report": str(Path(folder, PAGE)),
        "Motion": str(joints) if joints.exists() else "",
        "Details": str(Path(folder, "summary.md")),
    }
    lines += [*wrapped(report.advice), *(f"{name:<8} {text}" for name, text in files.items() if text)]
    return "\n".join(lines)


def write_report(path: str | os.PathLike[str], report: Report) -> None:
    """Write a report to a ``.json`` file, or as Markdown, whole or not at all."""
    text = as_markdown(report)
    if Path(path).suffix == ".json":
        text = json.dumps(as_numbers(report), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """Return a value as JSON has it; nan and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _section(section: Section) -> list[str]:
    """Write the metrics of a section in Markdown: statistics as a table, others as a list."""
    metrics = [metric for metric in section.metrics if metric.text and not metric.is_warning]
    if not (metrics or section.tables or section.text):
        return []
    lines = [f"## {escaped(section.title)}", ""] if section.title else []
    lines += [line for text in section.text.split("\n") if text for line in (printable(text), "")]
    rows = tuple((metric.heading, *metric.cells, metric.where) for metric in metrics if metric.is_statistics)
    statistics = Table(("", "median", "95th percentile", "max", "max at"), rows)
    texts = []
    for metric in (metric for metric in metrics if not metric.is_statistics):
        text = escaped(metric.text)
        if metric.severity == INFO and metric.label:
            text = sentence(f"{escaped(metric.label)}: {text}")  # without a full stop at its end, which may be a path
            text = f"{text} {escaped(metric.description)}" if metric.description else text.rstrip(".")
        texts.append(f"- {text}")
    lines += [*(_table(statistics) if rows else []), *texts, *([""] if texts else [])]
    return [*lines, *(line for table in section.tables for line in _table(table))]


def _table(table: Table) -> list[str]:
    def line(texts: Sequence[str]) -> str:
        return f"| {' | '.join(escaped(text).replace('|', chr(92) + '|') for text in texts)} |"

    caption = [escaped(table.caption), ""] if table.caption else []
    return [*caption, line(table.columns), line(["---"] * len(table.columns)), *map(line, table.rows), ""]
