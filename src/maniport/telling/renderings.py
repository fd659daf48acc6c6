"""Renderings of facts: Markdown, which terminals lay out, numbers for JSON, and small tables for notebooks."""

import json
import math
import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from maniport.atomic_io import written_whole
from maniport.errors import printable
from maniport.telling.answer import Answer
from maniport.telling.facts import INFO, SUFFIXES, WARNING, Fact, Facts, Section, Table, facts_of, sentence

LABEL = "text-align:left;font-weight:normal;opacity:.7;padding:.1em 1.2em .1em 0;vertical-align:top;white-space:nowrap"
VALUE = "text-align:left;padding:.1em 1.2em .1em 0;vertical-align:top;white-space:pre-wrap"
GRID = "border-collapse:collapse;margin:.3em 0"

FIGURES = 3
"""So many figures stand in the last lines of a terminal."""

PADDING = 3
"""Columns of a terminal between those of a table."""

SUMMARY, PAGE = "summary.json", "report.html"
"""Files of a run: the facts to compute with, and the page to look at. A folder with both holds results."""

ENDINGS = (".png", ".svg")
"""What is written of a figure: for the screen, and for a paper."""


_MARKUP = re.compile(r"\\(?=[!-/:-@[-`{-~])|<(?=[A-Za-z/!?])|&(?=#?\w+;)|\](?=[(\[:])|^[#>]")
"""Begins HTML tags, entities, links, headings and quotations in Markdown, and escapes of such signs."""


def escaped(text: str) -> str:
    r"""Return text, such as a name from a file, that Markdown shows as it is: without HTML, links and headings."""
    return _MARKUP.sub(r"\\\g<0>", printable(text))


def files_of(*names: str) -> tuple[str, ...]:
    """Names of the files of figures that are saved without an ending."""
    return tuple(f"{name}{ending}" for name in names for ending in ENDINGS)


def as_markdown(facts: Facts, level: int = 1) -> str:
    """Write facts as a page to read: the verdict and warnings first, then every section.

    Parameters
    ----------
    facts : Facts
    level : int
        Of the heading.

    Returns
    -------
    str

    See Also
    --------
    as_html, as_numbers
    """
    lines = [f"{'#' * level} {escaped(facts.title)}", "", *([escaped(facts.lead), ""] if facts.lead else [])]
    lines += [] if facts.verdict is None else _verdict(facts.verdict, level + 1)
    if facts.warnings:
        lines += [f"{'#' * (level + 1)} Warnings", "", *(f"- {escaped(text)}" for text in facts.warnings), ""]
    for section in facts.sections:
        lines += _section(section, level + 1)
    return "\n".join(lines)


def as_numbers(facts: Facts) -> dict[str, Any]:
    """Return what machines read of facts, ready for JSON: sections by key, units in the names, and the sentences.

    Parameters
    ----------
    facts : Facts

    Returns
    -------
    dict

    See Also
    --------
    as_markdown, as_html
    """
    numbers: dict[str, Any] = {"title": facts.title}
    if facts.verdict is not None:
        verdict = asdict(facts.verdict)
        numbers |= {"status": verdict.pop("status") or None, "verdict": verdict}
    numbers["warnings"] = [{"key": fact.key, "text": fact.text} for fact in facts.warning_facts]
    numbers["notes"] = list(facts.notes)
    for section in facts.sections:
        shown = [fact for fact in section.facts if fact.key and (fact.severity != WARNING or fact.value is not None)]
        entries = {fact.key + SUFFIXES.get(fact.unit, ""): fact.value for fact in shown}
        entries |= {table.key: table.value for table in section.tables if table.key}
        if entries and section.key:
            numbers.setdefault(section.key, {}).update(entries)
        else:
            numbers |= entries
    return dict(plain(numbers))


def as_json(facts: Facts) -> str:
    """Write what machines read of facts as a JSON file's text."""
    return json.dumps(as_numbers(facts), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def as_answer(verdict: Answer, folder: str, width: int = 80) -> str:
    """Write the last lines that a terminal shows: verdict, three figures, what to try next, where to look."""
    names = max(len(card.name) for card in verdict.cards[:FIGURES])
    return "\n".join(
        [
            *textwrap.wrap(printable(verdict.title), width),
            *textwrap.wrap(verdict.status_text, width),
            *textwrap.wrap(printable(verdict.text), width),
            *(f"  {card.name:<{names}}  {card.text}" for card in verdict.cards[:FIGURES]),
            *([f"next: {printable(verdict.typed(folder))}"] if verdict.command else []),
            f"open {Path(folder, PAGE)}",
        ]
    )


def write_facts(path: str | os.PathLike[str], facts: Facts) -> None:
    """Write facts to a ``.json`` file, or as Markdown, whole or not at all."""
    text = as_json(facts) if Path(path).suffix == ".json" else as_markdown(facts)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def plain(value: Any) -> Any:
    """Return the same as numbers, texts, lists and mappings that JSON knows; nan and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_html(thing: Any) -> str:
    """Write what a notebook shows of an object: a piece of HTML without colours of its own, which loads nothing.

    Parameters
    ----------
    thing : Facts or any object of maniport

    Returns
    -------
    str

    See Also
    --------
    as_markdown, as_numbers
    """
    facts = thing if isinstance(thing, Facts) else facts_of(thing)
    heading = f"<b>{escape(type(thing).__name__)}</b> {escape(facts.title)}"
    parts = [heading, *(f"<div>{escape(text)}</div>" for text in ([facts.lead] if facts.lead else []))]
    if facts.verdict is not None:
        texts = " ".join(filter(None, (facts.verdict.status_text, facts.verdict.text)))
        parts.append(f"<div><b>{escape(facts.verdict.title)}</b> {escape(texts)}</div>")
    if facts.warnings:
        rows = [("warnings" if k == 0 else "", text) for k, text in enumerate(facts.warnings)]
        parts.append(_grid((), rows))
    for section in facts.sections:
        shown = [fact for fact in section.facts if fact.text and fact.severity != WARNING]
        parts += [_grid((), [(fact.name, fact.text) for fact in shown])] if shown else []
        parts += [_grid(table.columns, table.rows) for table in section.tables]
    return f'<div style="margin:.3em 0">{"".join(parts)}</div>'


def _verdict(verdict: Answer, level: int) -> list[str]:
    cards = [f"- {sentence(escaped(f'{card.name}: {card.text}'))}" for card in verdict.cards]
    texts = [escaped(text) for text in (verdict.status_text, verdict.text, verdict.doubts)]
    advice = escaped(verdict.advice) + (f" `{printable(verdict.typed())}`" if verdict.command else "")
    paragraphs = [line for one in (*texts, advice) if one for line in (one, "")]
    return [f"{'#' * level} {escaped(verdict.title)}", "", *paragraphs, *cards, ""]


def _section(section: Section, level: int) -> list[str]:
    shown = [fact for fact in section.facts if fact.text and fact.severity != WARNING]
    if not (shown or section.tables or section.text):
        return []
    lines = [f"{'#' * level} {escaped(section.title)}", ""] if section.title else []
    lines += [line for one in section.text.split("\n") if one for line in (printable(one), "")]
    lines += [*map(_line, shown), *([""] if shown else [])]
    return [*lines, *(line for table in section.tables for line in (*_table(table), ""))]


def narrowed(facts: Facts, width: int) -> Facts:
    """The same facts with tables that terminals of `width` columns show without cutting words."""
    sections = (
        replace(section, tables=tuple(part for table in section.tables for part in _parts(table, width)))
        for section in facts.sections
    )
    return replace(facts, sections=tuple(sections))


def _parts(table: Table, width: int) -> list[Table]:
    columns = list(zip(table.columns, *table.rows, strict=True))
    groups: list[list[int]] = [[]]
    for i in range(1, len(columns)):
        if groups[-1] and not _fit([columns[k] for k in (0, *groups[-1], i)], width):
            groups.append([])
        groups[-1].append(i)
    if len(groups) == 1:
        return [table]
    return [
        Table(
            tuple(table.columns[i] for i in (0, *group)),
            tuple(tuple(row[i] for i in (0, *group)) for row in table.rows),
            "" if k else table.caption,
        )
        for k, group in enumerate(groups)
    ]


def _fit(columns: Sequence[Sequence[str]], width: int) -> bool:
    """Whether all words are whole where the widest columns are made narrower until the table fits, as terminals do."""
    whole = [max(map(len, column)) for column in columns]
    words = [max(len(word) for cell in column for word in (cell.split() or [""])) for column in columns]
    room, level = width - PADDING * len(columns), max(whole)
    while level > 1 and sum(min(one, level) for one in whole) > room:
        level -= 1
    return max(words) <= level


def _line(fact: Fact) -> str:
    if fact.severity != INFO or not fact.name:
        return f"- {escaped(fact.text)}"
    return f"- {sentence(escaped(f'{fact.name}: {fact.text}'))}" + (f" {escaped(fact.meaning)}" if fact.meaning else "")


def _table(table: Table) -> list[str]:
    caption = [escaped(table.caption), ""] if table.caption else []
    return [*caption, _cells(table.columns), _cells(["---"] * len(table.columns)), *map(_cells, table.rows)]


def _cells(texts: Sequence[str]) -> str:
    return f"| {' | '.join(escaped(text).replace('|', chr(92) + '|') for text in texts)} |"


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    names = "".join(f'<th style="{LABEL}">{escape(name)}</th>' for name in head)
    body = "".join(f"<tr>{_label_and_values(row)}</tr>" for row in rows)
    return f'<table style="{GRID}">{f"<thead><tr>{names}</tr></thead>" if head else ""}<tbody>{body}</tbody></table>'


def _label_and_values(row: Sequence[str]) -> str:
    first, *others = row
    cells = "".join(f'<td style="{VALUE}">{escape(text)}</td>' for text in others)
    return f'<th style="{LABEL}">{escape(first)}</th>{cells}'
