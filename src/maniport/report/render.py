"""Renderings of a report: Markdown, the text on a terminal, and numbers for JSON."""

import json
import math
import os
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from maniport.errors import printable
from maniport.report.values import (
    SUFFIXES,
    Metric,
    Report,
    Section,
    Statistics,
    Table,
    Value,
    sentence,
)
from maniport.util.atomic_io import write_text

SUMMARY = "summary.json"
PAGE = "report.html"
"""Files of a run: its report as numbers, and the page. A folder with both holds results."""

ENDINGS = (".png", ".svg")  # Formats of the files of a figure

# Begins HTML tags, entities, links, headings and quotations in Markdown, and escapes of such signs.
_MARKUP = re.compile(r"\\(?=[!-/:-@[-`{-~])|<(?=[A-Za-z/!?])|&(?=#?\w+;)|\](?=[(\[:])|^[#>]")


def escaped(text: str) -> str:
    r"""Return text, such as a name from a file, that Markdown shows as it is: without HTML, links and headings."""
    return _MARKUP.sub(r"\\\g<0>", printable(text))


def as_markdown(report: Report, details: bool = False, folder: str = "") -> str:
    """Render a `Report` as Markdown: the summary and warnings first, then the sections.

    Parameters
    ----------
    report : Report
    details : bool
        Whether sections that pages fold are rendered, too.
    folder : str
        Where the results are, for the command of the next step; without it there is none.

    Returns
    -------
    str
    """
    is_summary = bool(report.outcome) and not details
    paragraphs = [f"# {escaped(report.title)}", escaped(report.lead)]
    if report.outcome:
        paragraphs += _outcome_paragraphs(report, folder)
    if report.warnings:
        warnings = [f"- {escaped(text)}" for text in report.warnings]
        paragraphs += ["## Warnings", "\n".join(warnings)]

    sections = report.sections
    if is_summary:
        sections = _summary_sections(report)
    for section in sections:
        paragraphs += _section_paragraphs(section)
    if is_summary:
        paragraphs.append(f"All metrics, settings and notes: {SUMMARY} and {PAGE}.")
    return "\n\n".join(filter(None, paragraphs)) + "\n"


def _outcome_paragraphs(report: Report, folder: str) -> list[str]:
    advice = escaped(report.advice)
    command = printable(report.command_for(folder))
    if command:
        advice += f" `{command}`"
    return [
        f"## {escaped(report.outcome)}",
        escaped(report.status_text),
        escaped(report.cause),
        advice,
    ]


def _summary_sections(report: Report) -> tuple[Section, ...]:
    """Return the sections that are not folded, after one with the main metrics of the folded ones."""
    sections = [section for section in report.sections if not section.folded]
    visible: list[Metric] = []
    for section in sections:
        visible.extend(section.metrics)
    hidden = tuple(metric for metric in report.main_metrics if metric not in visible)
    title = "Arms" if hidden else ""
    return (Section(title, hidden), *sections)


def _section_paragraphs(section: Section) -> list[str]:
    paragraphs = [printable(text) for text in section.text.split("\n")]
    paragraphs.append(_tables(section.statistics()))
    paragraphs.append("\n".join(map(_line, section.lines)))
    paragraphs.append(_tables(section.tables))
    if section.title and any(paragraphs):
        paragraphs.insert(0, f"## {escaped(section.title)}")
    return paragraphs


def _line(metric: Metric) -> str:
    text = escaped(metric.text)
    if metric.label and metric.severity == "info":
        text = sentence(f"{escaped(metric.label)}: {text}")
        if metric.description:
            text = f"{text} {escaped(metric.description)}"
        else:
            text = text.rstrip(".")  # what ends here may be a path
    return f"- {text}"


def _tables(tables: Iterable[Table]) -> str:
    return "\n\n".join(map(_table, tables))


def _table(table: Table) -> str:
    lines = [_row(table.columns), _row(["---"] * len(table.columns))]
    for row in table.rows:
        lines.append(_row(row))
    text = "\n".join(lines)
    if table.caption:
        text = f"{escaped(table.caption)}\n\n{text}"
    return text


def _row(texts: Sequence[str]) -> str:
    cells = [escaped(text).replace("|", r"\|") for text in texts]
    return f"| {' | '.join(cells)} |"


def as_numbers(report: Report, folder: str = "") -> dict[str, Value]:
    """Return a `Report` for programs, ready for JSON: sections by key, units in the names, and the warnings.

    Parameters
    ----------
    report : Report
    folder : str
        As in `as_markdown`.

    Returns
    -------
    dict
    """
    result: dict[str, Value] = {"title": report.title}
    if report.outcome:
        result["status"] = report.status or None
        result["summary"] = {
            "title": report.outcome,
            "text": report.cause,
            "advice": report.advice,
            "command": report.command_for(folder),
            "reasons": report.warning_keys if report.status else (),
        }
    warnings = [{"key": metric.key, "text": metric.text} for metric in report.warning_metrics]
    notes = [metric.text for metric in report.metrics if metric.severity == "note"]
    result["warnings"] = warnings
    result["notes"] = list(dict.fromkeys(notes))

    for section in report.sections:
        entries = _entries(section)
        place = result
        if entries and section.key:
            known = result.setdefault(section.key, {})
            assert isinstance(known, dict)
            place = known
        place.update(entries)
    return {name: plain(value) for name, value in result.items()}


def _entries(section: Section) -> dict[str, Value]:
    """Return the values of the metrics and tables of a section by their names in JSON."""
    entries = {}
    for metric in section.metrics:
        is_shown = metric.severity == "info" or metric.value is not None
        if metric.key and is_shown:
            entries[metric.key + SUFFIXES.get(metric.unit, "")] = metric.value
    for table in section.tables:
        if table.key:
            entries[table.key] = table.value
    return entries


def plain(value: Value) -> Value:
    """Return a value as JSON has it; nan and infinity become None."""
    if isinstance(value, Statistics):
        return plain(value.numbers)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def as_terminal(
    report: Report, folder: str, width: int = 80, table_only: bool = False, most_warnings: int = 3
) -> str:
    """Render the summary of a result for a terminal: outcome, main metrics, warnings and files."""
    table = _terminal_table(report.main_metrics, width)
    if table_only:
        return "\n".join(table)

    lines = _wrapped(f"Result: {report.outcome[:1].lower()}{report.outcome[1:]}", width)
    lines += _wrapped(report.status_text, width)
    lines += table
    lines += _wrapped(report.cause, width)
    for text in report.warnings[:most_warnings]:
        lines += _wrapped(f"! {text}", width)
    more = len(report.warnings) - most_warnings
    if more > 0:
        noun = "warnings"
        if more == 1:
            noun = "warning"
        lines += _wrapped(f"! {more} more {noun} in summary.md", width)
    lines += _wrapped(report.advice, width)
    return "\n".join([*lines, *_terminal_files(report, folder)])


def _terminal_table(metrics: Sequence[Metric], width: int) -> list[str]:
    """Return the lines of metrics, with columns for statistics."""
    column = max((len(metric.heading) for metric in metrics), default=0)
    lines = []
    has_head = False
    for metric in metrics:
        if metric.statistics is not None:
            if not has_head:
                lines.append(f"  {'':<{column}}{'median':>9}{'95th':>9}{'max':>9}")
                has_head = True
            median, p95, maximum, time = metric.statistics.cells
            text = f"{median:>9}{p95:>9}{maximum:>9}  ({time} s)"
        else:
            text = f"  {metric.text}"
            if len(text) + column + 2 > width:  # too long for a line: without the last remark
                text = re.sub(r" \([^()]*\)$", "", text)
        lines.append(f"  {metric.heading:<{column}}{text}")
    return lines


def _terminal_files(report: Report, folder: str) -> list[str]:
    """Return a line for the next command and for each file that a user opens."""
    lines = []
    command = printable(report.command_for(folder))
    if command:
        lines.append(f"{'Next':<8} {command}")
    lines.append(f"{'Report':<8} {Path(folder, PAGE)}")
    joints = Path(folder, "joints.csv")
    if joints.exists():
        lines.append(f"{'Motion':<8} {joints}")
    lines.append(f"{'Details':<8} {Path(folder, 'summary.md')}")
    return lines


def _wrapped(text: str, width: int) -> list[str]:
    """Return the lines of a text; those of a warning are indented."""
    together = re.sub(r"(?<=\d) (?=%)", "\xa0", printable(text))  # "84 %" in one line
    indent = "  " if text.startswith("!") else ""
    lines = textwrap.wrap(together, width, subsequent_indent=indent)
    return [line.replace("\xa0", " ") for line in lines]


def write_report(path: str | os.PathLike[str], report: Report, folder: str = "") -> None:
    """Write a report to a ``.json`` file, or as Markdown, whole or not at all; `folder` as in `as_markdown`."""
    if Path(path).suffix == ".json":
        numbers = as_numbers(report, folder)
        text = json.dumps(numbers, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    else:
        text = as_markdown(report, folder=folder)
    write_text(path, text)
