"""The overview of a batch: how all pairs came out, the best and the worst, what failed and why; one file."""

from collections.abc import Sequence
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from maniport.atomic_io import written_whole
from maniport.batches.table import COMPUTING, FAILED, Row, failures
from maniport.telling.renderings import PAGE as REPORT
from maniport.telling.write import TOLD

PAGE = "index.html"

FEW = 5
"""So many of the best and of the worst are listed."""

BINS = 24


class Measure(NamedTuple):
    """A column of the table that the overview shows."""

    column: str
    name: str
    unit: str = ""
    digits: int = 2


MEASURES = (
    Measure("motion.distance.median", "distance, median"),
    Measure("motion.distance.p95", "distance, 95 %"),
    Measure("motion.distance.max", "distance, largest"),
    Measure("motion.tip_error_mm.p95", "tip, 95 %", "mm", 1),
    Measure("motion.tip_error_mm.max", "tip, largest", "mm", 1),
    Measure("motion.feasibility_gap.median", "feasibility gap, median"),
    Measure("motion.duration_s", "duration", "s", 1),
    Measure(COMPUTING, "computing time", "s", 1),
)
"""The first is what best and worst are told by, and whose distribution is drawn."""


def write_overview(path: Path, rows: Sequence[Row], count: int, tables: Sequence[str], pages: bool) -> None:
    """Write the page; `count`: pairs of the batch, `tables`: names of the tables, `pages`: each pair has a report."""
    from maniport.telling.page import document  # slow to load, and nothing to those who only work on pairs

    read = REPORT if pages else TOLD[0]
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    done = [row for row in rows if row["state"] != FAILED]
    failed = [row for row in rows if row["state"] == FAILED]
    recordings = len({row["recording"] for row in rows})
    title = f"{recordings} recording{_s(recordings)} on {len(robots)} robot{_s(len(robots))}"
    links = ", ".join(f'<a href="{quote(name)}">{escape(name)}</a>' for name in tables)
    head = (
        f"<header><h1>{title}</h1>\n<p class=lead>{len(done)} of {count} pairs are done, {len(failed)} failed. "
        f"All measures: {links}.</p></header>"
    )
    body = "\n".join([head, "<main>", *_distribution(done, robots), *_ends(done, read), *_failures(rows),
                      *_warnings(done), *_all(rows, read), "</main>"])  # fmt: skip
    with written_whole(path) as temporary:
        text = document(title, body, _asset("overview.js"), _asset("overview.css"))
        temporary.write_text(text, encoding="utf-8")


def _s(count: int) -> str:
    return "" if count == 1 else "s"


def _distribution(done: Sequence[Row], robots: Sequence[str]) -> list[str]:
    """Draw how often which distance comes, of all robots on one scale."""
    first = MEASURES[0]
    known = [row for row in done if row.get(first.column) is not None]
    if not known:
        return []
    most = max(row[first.column] for row in known) or 1.0
    drawn = []
    for robot in robots:
        values = np.array([row[first.column] for row in known if row["robot"] == robot])
        if not len(values):
            continue
        counts, _ = np.histogram(values, BINS, (0.0, most))
        bars = "".join(
            f'<rect x="{k + 0.05:.2f}" y="{100.0 * (1.0 - count / counts.max()):.2f}" width="0.9" '
            f'height="{100.0 * count / counts.max():.2f}"/>'
            for k, count in enumerate(counts)
            if count
        )
        middle = float(np.median(values))
        line = f'<path class="median" d="M{BINS * middle / most:.3f} 0V100"/>'
        about = (
            f"{len(values)} motion{_s(len(values))}: median {middle:.2f}, from {values.min():.2f} to {values.max():.2f}"
        )
        drawn.append(
            f'<figure class="histogram"><figcaption><h3>{escape(robot)}</h3><p class="meaning">{about}</p></figcaption>'
            f'<svg viewBox="0 0 {BINS} 100" preserveAspectRatio="none" role="img" aria-label="{escape(about)}">'
            f'{bars}{line}</svg><div class="ends"><span>0</span><span>{most:.2f}</span></div></figure>'
        )
    words = "How far the achieved ellipsoids are from their targets: the median over each motion. Line: median of all."
    return [f'<section><h2>Distribution</h2>\n<p>{words}</p>\n<div class="robots">', *drawn, "</div></section>"]


def _ends(done: Sequence[Row], read: str) -> list[str]:
    """List the best and the worst."""
    first = MEASURES[0].column
    order = sorted((row for row in done if row.get(first) is not None), key=lambda row: float(row[first]))
    if len(order) < 2:
        return []
    few = min(FEW, len(order) // 2)
    parts = (("The best", order[:few]), ("The worst", order[::-1][:few]))
    lists = [f"<div><h3>{title}</h3>{_table(some, 'ends', read)}</div>" for title, some in parts]
    return ['<section><h2>Best and worst</h2>\n<div class="robots">', *lists, "</div></section>"]


def _failures(rows: Sequence[Row]) -> list[str]:
    """List failures, those of a recording with equal reasons in one line."""
    lines = "\n".join(
        f"<tr><td>{escape(one['recording'])}</td><td>{escape(', '.join(one['robots']))}</td>"
        f'<td class="reason">{escape(one["reason"])}</td></tr>'
        for one in failures(rows)
    )
    if not lines:
        return []
    head = "".join(f'<th scope="col">{name}</th>' for name in ("recording", "robots", "reason"))
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"
    return [f"<section><h2>Failures</h2>\n{_scrolling(table, 'Failures')}</section>"]


def _warnings(done: Sequence[Row]) -> list[str]:
    """What was warned of, each sentence once, with the first of the pairs."""
    said = dict[str, list[Row]]()
    for row in done:
        for warning in filter(None, row["warnings"].split("\n")):
            said.setdefault(warning, []).append(row)
    if not said:
        return []
    rows = "\n".join(
        f'<tr><td class="reason">{escape(warning)}</td><td class="number">{len(some)}</td>'
        f"<td>{escape(some[0]['recording'])} → {escape(some[0]['robot'])}</td></tr>"
        for warning, some in sorted(said.items(), key=lambda one: -len(one[1]))
    )
    head = '<th scope="col">warning</th><th scope="col" class="number">pairs</th><th scope="col">first of them</th>'
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return [f"<section><h2>Warnings</h2>\n{_scrolling(table, 'Warnings')}</section>"]


def _all(rows: Sequence[Row], read: str) -> list[str]:
    return [f"<section><h2>All pairs</h2>\n{_scrolling(_table(rows, 'pairs', read), 'All pairs')}</section>"]


def _scrolling(table: str, title: str) -> str:
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{title}">{table}</div>'


def _table(rows: Sequence[Row], kind: str, read: str) -> str:
    """A table of pairs, each with a link to what there is to read of it."""
    shown = MEASURES if kind == "pairs" else MEASURES[:1]
    names = [
        ("recording", ""),
        ("robot", ""),
        *([("state", ""), ("status", ""), ("warnings", "")] if kind == "pairs" else []),
    ]
    names += [(f"{one.name} [{one.unit}]" if one.unit else one.name, "number") for one in shown]
    head = "".join(f'<th scope="col"{_class(kind)}>{escape(name)}</th>' for name, kind in names)
    body = "\n".join(f"<tr>{_cells(row, shown, kind, read)}</tr>" for row in rows)
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>'


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def _cells(row: Row, shown: Sequence[Measure], kind: str, read: str) -> str:
    name = escape(row["recording"])
    place = quote(f"{row['folder']}/{read}")
    first = f'<a href="{place}">{name}</a>' if row["folder"] else name
    texts = [first, escape(row["robot"])]
    texts += [row["state"], row["status"], escape(row["warning_keys"])] if kind == "pairs" else []
    cells = [f"<td>{text}</td>" for text in texts]
    for one in shown:
        value = row.get(one.column)
        known = "" if value is None else f"{value:.{one.digits}f}"
        cells.append(f'<td class="number" data-value="{"" if value is None else repr(float(value))}">{known}</td>')
    return "".join(cells)


@cache
def _asset(name: str) -> str:
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")
