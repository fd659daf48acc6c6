"""The page: one HTML file that holds everything and asks nothing of any network."""

import base64
import hashlib
import os
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files

from maniport import __version__
from maniport.errors import InvalidInputError
from maniport.files import written_whole
from maniport.telling.page.content import Fact, Motion, Picture, Report, Section, Table
from maniport.telling.page.encoding import MAX_FRAMES, as_json

SCRIPTS = ("geometry.js", "surface.js", "scene.js", "curves.js", "map.js", "player.js", "page.js")

KEYS = " Keys: space plays, ← and → step."

LARGEST = 6_000_000
"""A report stays below this size [bytes]."""


@dataclass(frozen=True)
class Fitting:
    """How much of a report's content its page holds."""

    frames: int
    surfaces: bool = True
    pictures: bool = True


SMALLER = (
    Fitting(MAX_FRAMES),
    Fitting(MAX_FRAMES // 2),
    Fitting(MAX_FRAMES // 4),
    Fitting(MAX_FRAMES // 4, surfaces=False),
    Fitting(MAX_FRAMES // 4, surfaces=False, pictures=False),
)
"""What is tried in turn, until a page is small enough."""


def write_report(path: str | os.PathLike[str], content: Report) -> None:
    """Write a report to an HTML file, whole or not at all.

    Parameters
    ----------
    path : str or path-like
    content : Report

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    text = as_html(content)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_html(content: Report) -> str:
    """Return the page as text; the same content gives the same text.

    What does not fit below `LARGEST` is left out step by step: frames of motions, surfaces, pictures.

    Raises
    ------
    InvalidInputError
        When even that does not fit.
    """
    for fitting in SMALLER:
        text = _page(content, fitting)
        if (size := len(text.encode())) < LARGEST:
            return text
    raise InvalidInputError(
        f"a report must stay below {LARGEST / 1e6:g} MB; found {size / 1e6:.1f} MB without surfaces and pictures: "
        f"give fewer motions, panels or tables"
    )


def _page(content: Report, fitting: Fitting) -> str:
    motions: list[Motion] = []
    sections = "\n".join(_section(section, motions, fitting) for section in content.sections)
    data = "\n".join(
        f'<script type="application/json" id="motion-{k}">'
        f"{as_json(motion, fitting.frames, surfaces=fitting.surfaces)}</script>"
        for k, motion in enumerate(motions)
    )
    script, style = _script(), _asset("page.css")
    policy = f"default-src 'none'; img-src data:; script-src {_hash(script)}; style-src {_hash(style)}; base-uri 'none'"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}; form-action 'none'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="generator" content="maniport {__version__}">
<link rel="icon" href="data:,">
<title>{escape(content.title)}</title>
<style>{style}</style>
</head>
<body>
<header>
<h1>{escape(content.title)}</h1>
<p class="lead">{escape(content.lead)}</p>
{_warnings(content.warnings)}
</header>
<main>
{sections}
</main>
<footer>maniport {__version__}. This file works without a network.{KEYS if motions else ""}</footer>
<noscript><p class="failure">The moving pictures and curves need scripts, which are part of this file.</p></noscript>
{data}
<script>{script}</script>
</body>
</html>
"""


@cache
def _asset(name: str) -> str:
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    """All scripts in one scope of their own."""
    return '(() => {\n"use strict";\n' + "\n".join(_asset(name) for name in SCRIPTS) + "})();\n"


def _hash(text: str) -> str:
    """Name a script or a style sheet for the page's security policy, which lets no other run."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _warnings(warnings: tuple[str, ...]) -> str:
    if not warnings:
        return ""
    items = "\n".join(f"<li>{escape(text)}</li>" for text in warnings)
    return f'<section class="mind" aria-label="Warnings">\n<h2>Warnings</h2>\n<ul>\n{items}\n</ul>\n</section>'


def _section(section: Section, motions: list[Motion], fitting: Fitting) -> str:
    lines = [f"<section>\n<h2>{escape(section.title)}</h2>"]
    lines += [f"<p>{escape(paragraph)}</p>" for paragraph in section.text.split("\n") if paragraph]
    pictures = [part for part in section.parts if isinstance(part, Picture)]
    for part in section.parts:
        if isinstance(part, Motion):
            said = _note(part, fitting)
            note = f'<p class="meaning">{escape(said)}</p>' if said else ""
            lines.append(f'<div class="motion" data-source="motion-{len(motions)}">{note}</div>')
            motions.append(part)
        elif isinstance(part, Table):
            lines.append(_table(part))
        elif not isinstance(part, Picture):
            lines.append(_facts(part))
    if pictures and fitting.pictures:
        lines.append('<div class="pictures">' + "\n".join(map(_picture, pictures)) + "</div>")
    elif pictures:
        lines.append('<p class="meaning">This file would be too large with its pictures; they are left out.</p>')
    return "\n".join([*lines, "</section>"])


def _note(motion: Motion, fitting: Fitting) -> str:
    """Say what a motion shows, and what is left out of it here."""
    sentences = [motion.note] if motion.note else []
    if len(motion.time) > fitting.frames:
        sentences.append(f"{fitting.frames} of {len(motion.time)} moments are shown.")
    if not fitting.surfaces and any(body.parts for body in motion.bodies):
        sentences.append("Drawn as skeletons: with surfaces this file would be too large.")
    return " ".join(sentences)


def _table(table: Table) -> str:
    caption = f'<p class="meaning">{escape(table.caption)}</p>' if table.caption else ""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in table.columns)
    rows = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    table_of = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>"
    return f'{caption}<div class="scroll" tabindex="0" role="region" aria-label="Table">{table_of}</div>'


def _facts(facts: tuple[Fact, ...]) -> str:
    entries = []
    for fact in facts:
        meaning = f' <span class="meaning">{escape(fact.meaning)}</span>' if fact.meaning else ""
        entries.append(f"<dt>{escape(fact.name)}</dt><dd><b>{escape(fact.value)}</b>{meaning}</dd>")
    return "<dl>\n" + "\n".join(entries) + "\n</dl>"


def _picture(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode("ascii")
    return f'<img alt="{escape(picture.description)}" src="data:image/png;base64,{data}">'
