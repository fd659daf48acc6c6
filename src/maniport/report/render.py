"""Renderings of a report: Markdown, the text on a terminal, and numbers for JSON."""

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
from maniport.report.values import SUFFIXES, Metric, Report, Section, Table, sentence
from maniport.util.atomic_io import write_text

SUMMARY, PAGE = "summary.json", "report.html"
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
    paragraphs = [f"# {escaped(report.title)}", escaped(report.lead)]
    if report.outcome:
        command = printable(report.command_for(folder))
        if command:
            command = f" `{command}`"
        paragraphs += [
            f"## {escaped(report.outcome)}",
            escaped(report.status_text),
            escaped(report.cause),
        ]
        paragraphs.append(escaped(report.advice) + command)
    if report.warnings:
        paragraphs += ["## Warnings", "\n".join(f"- {escaped(text)}" for text in report.warnings)]
    sections = [
        section for section in report.sections if details or not (report.outcome and section.folded)
    ]
    if report.outcome and not details:
        visible = [metric for section in sections for metric in section.metrics]
        hidden = tuple(metric for metric in report.main_metrics if metric not in visible)
        sections.insert(0, Section("Arms" if hidden else "", hidden))
    for section in sections:
        tables = section.statistics(), section.tables
        before, after = ("\n\n".join(map(_table, some)) for some in tables)
        texts = [printable(text) for text in section.text.split("\n")]
        body = [*texts, before, "\n".join(map(_line, section.lines)), after]
        paragraphs += [f"## {escaped(section.title)}"] * bool(section.title and any(body)) + body
    if report.outcome and not details:
        paragraphs.append(f"All metrics, settings and notes: {SUMMARY} and {PAGE}.")
    return "\n\n".join(filter(None, paragraphs)) + "\n"


def as_numbers(report: Report, folder: str = "") -> dict[str, Any]:
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
    result: dict[str, Any] = {"title": report.title}
    if report.outcome:
        texts = {
            "title": report.outcome,
            "text": report.cause,
            "advice": report.advice,
            "command": report.command_for(folder),
        }
        reasons = report.warning_keys if report.status else ()
        result |= {"status": report.status or None, "summary": texts | {"reasons": reasons}}
    result["warnings"] = [
        {"key": metric.key, "text": metric.text} for metric in report.warning_metrics
    ]
    result["notes"] = list(
        dict.fromkeys(item.text for item in report.metrics if item.severity == "note")
    )
    for section in report.sections:
        entries = {metric.key + SUFFIXES.get(metric.unit, ""): metric.value for metric in section.metrics
                   if metric.key and (metric.severity == "info" or metric.value is not None)}  # fmt: skip
        entries |= {table.key: table.value for table in section.tables if table.key}
        place = result.setdefault(section.key, {}) if entries and section.key else result
        place.update(entries)
    return dict(plain(result))


def as_terminal(
    report: Report, folder: str, width: int = 80, table_only: bool = False, most_warnings: int = 3
) -> str:
    """Render the summary of a result for a terminal: outcome, main metrics, warnings and files."""
    metrics = report.main_metrics
    wide = max((len(metric.heading) for metric in metrics), default=0)
    table = []
    if any(metric.is_statistics for metric in metrics):
        table.append(f"  {'':<{wide}}{'median':>9}{'95th':>9}{'max':>9}")
    for metric in metrics:
        text = f"  {metric.text}"
        if metric.is_statistics:
            *numbers, time = metric.cells
            text = "".join(f"{number:>9}" for number in numbers) + f"  ({time} s)"
        elif len(text) + wide + 2 > width:  # too long for a line: without the last remark
            text = re.sub(r" \([^()]*\)$", "", text)
        table.append(f"  {metric.heading:<{wide}}{text}")
    if table_only:
        return "\n".join(table)

    def wrapped(text: str) -> list[str]:
        whole = re.sub(r"(?<=\d) (?=%)", "\xa0", printable(text))  # "84 %" in one line
        lines = textwrap.wrap(whole, width, subsequent_indent="  " if text.startswith("!") else "")
        return [line.replace("\xa0", " ") for line in lines]

    warnings = [f"! {text}" for text in report.warnings[:most_warnings]]
    if (more := len(report.warnings) - most_warnings) > 0:
        warnings.append(f"! {more} more warning{'s'[: more != 1]} in summary.md")
    before = f"Result: {report.outcome[:1].lower()}{report.outcome[1:]}", report.status_text
    after = report.cause, *warnings, report.advice
    command, joints = printable(report.command_for(folder)), Path(folder, "joints.csv")
    files = {"Next": command, "Report": Path(folder, PAGE), "Motion": joints if joints.exists() else "",
             "Details": Path(folder, "summary.md")}  # fmt: skip
    lines = [line for text in before for line in wrapped(text)] + table
    lines += [line for text in after for line in wrapped(text)]
    return "\n".join([*lines, *(f"{name:<8} {text}" for name, text in files.items() if text)])


def write_report(path: str | os.PathLike[str], report: Report, folder: str = "") -> None:
    """Write a report to a ``.json`` file, or as Markdown, whole or not at all; `folder` as in `as_markdown`."""
    text = as_markdown(report, folder=folder)
    if Path(path).suffix == ".json":
        text = (
            json.dumps(as_numbers(report, folder), indent=2, ensure_ascii=False, allow_nan=False)
            + "\n"
        )
    write_text(path, text)


def plain(value: Any) -> Any:
    """Return a value as JSON has it; nan and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _line(metric: Metric) -> str:
    text = escaped(metric.text)
    if metric.label and metric.severity == "info":
        text = sentence(f"{escaped(metric.label)}: {text}")
        # without a description no full stop at the end, which may be a path
        text = f"{text} {escaped(metric.description)}" if metric.description else text.rstrip(".")
    return f"- {text}"


def _table(table: Table) -> str:
    def line(texts: Sequence[str]) -> str:
        return f"| {' | '.join(escaped(text).replace('|', chr(92) + '|') for text in texts)} |"

    caption = f"{escaped(table.caption)}\n\n" if table.caption else ""
    return caption + "\n".join(
        [line(table.columns), line(["---"] * len(table.columns)), *map(line, table.rows)]
    )
