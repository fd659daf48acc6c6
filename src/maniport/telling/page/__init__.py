"""A page that can be sent: what was done, what came out, and the motion itself, to look at without a network.

It takes facts, and values and arrays to look at (`maniport.telling.page.content`), and gives one HTML file. The
scripts and the style sheet in ``assets`` are part of the file; they draw with WebGL and SVG and load nothing.
"""

import base64
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files

from maniport.errors import InvalidInputError
from maniport.files import written_whole
from maniport.telling.facts import INFO, NOTE, Fact, Facts, Section, Table
from maniport.telling.page.content import Body, Cloud, DomainMap, Line, Motion, Panel, Part, Picture
from maniport.telling.page.encoding import MAX_FRAMES, as_json
from maniport.telling.page.profiles import domain_map, ellipsoid_panels
from maniport.telling.roles import ROLES
from maniport.version import __version__

__all__ = [
    "Body",
    "Cloud",
    "DomainMap",
    "Line",
    "Motion",
    "Panel",
    "Part",
    "Picture",
    "as_html",
    "domain_map",
    "ellipsoid_panels",
    "write_page",
]

SCRIPTS = ("geometry.js", "surface.js", "scene.js", "curves.js", "map.js", "player.js", "page.js")

KEYS = " Keys: space plays, ← and → step."

LARGEST = 6_000_000
"""A page stays below this size [bytes]."""


@dataclass(frozen=True)
class Fitting:
    """How much of its content a page holds."""

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


Shown = Mapping[str, Sequence[Motion | Picture]]
"""What there is to look at, by the key (or the title) of the section that it belongs to."""


def write_page(path: str | os.PathLike[str], facts: Facts, shown: Shown | None = None) -> None:
    """Write facts, with what there is to look at, to an HTML file, whole or not at all.

    Parameters
    ----------
    path : str or path-like
    facts : Facts
    shown : mapping of str to sequence of Motion or Picture, optional
        By the key, or the title, of a section; they stand at its head.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    text = as_html(facts, shown)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_html(facts: Facts, shown: Shown | None = None) -> str:
    """Return the page as text; the same content gives the same text.

    What does not fit below `LARGEST` is left out step by step: frames of motions, surfaces, pictures.

    Raises
    ------
    InvalidInputError
        When even that does not fit, or something is shown for a section that is not there.
    """
    places = {section.key or section.title for section in facts.sections}
    if unknown := sorted(set(shown or ()) - places):
        raise InvalidInputError(f"shown must name sections, {sorted(places)}; found {unknown}")
    for fitting in SMALLER:
        text = _page(facts, shown or {}, fitting)
        if (size := len(text.encode())) < LARGEST:
            return text
    raise InvalidInputError(
        f"a page must stay below {LARGEST / 1e6:g} MB; found {size / 1e6:.1f} MB without surfaces and pictures: "
        f"give fewer motions, panels or tables"
    )


def _page(facts: Facts, shown: Shown, fitting: Fitting) -> str:
    motions: list[Motion] = []
    sections = "\n".join(
        _section(section, shown.get(section.key or section.title, ()), motions, fitting) for section in facts.sections
    )
    data = "\n".join(
        f'<script type="application/json" id="motion-{k}">'
        f"{as_json(motion, fitting.frames, surfaces=fitting.surfaces)}</script>"
        for k, motion in enumerate(motions)
    )
    script, style = _script(), _colors() + _asset("page.css")
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
<title>{escape(facts.title)}</title>
<style>{style}</style>
</head>
<body>
<header>
<h1>{escape(facts.title)}</h1>
<p class="lead">{escape(facts.lead)}</p>
{_warnings(facts.warnings)}
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


def _colors() -> str:
    """Style of roles: their colours, for light and for dark ground, and how one of them is hidden."""
    light, dark = (
        "".join(f"--{role.name}:{getattr(role, ground)};" for role in ROLES.values()) for ground in ("color", "dark")
    )
    rules = "".join(
        f".{name}{{color:var(--{name})}}.without-{name} :is(path.{name},.of-{name}){{display:none}}" for name in ROLES
    )
    return f":root{{{light}}}@media (prefers-color-scheme:dark){{:root{{{dark}}}}}{rules}\n"


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


def _section(section: Section, shown: Sequence[Motion | Picture], motions: list[Motion], fitting: Fitting) -> str:
    lines = [f"<section>\n<h2>{escape(section.title)}</h2>"]
    lines += [f"<p>{escape(paragraph)}</p>" for paragraph in section.text.split("\n") if paragraph]
    for part in shown:
        if isinstance(part, Motion):
            said = _note(part, fitting)
            note = f'<p class="meaning">{escape(said)}</p>' if said else ""
            lines.append(f'<div class="motion" data-source="motion-{len(motions)}">{note}</div>')
            motions.append(part)
    lines += [*map(_table, section.tables), _facts(section.facts)]
    pictures = [part for part in shown if isinstance(part, Picture)]
    if pictures and fitting.pictures:
        lines.append('<div class="pictures">' + "\n".join(map(_picture, pictures)) + "</div>")
    elif pictures:
        lines.append('<p class="meaning">This file would be too large with its pictures; they are left out.</p>')
    return "\n".join([*filter(None, lines), "</section>"])


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
    """Write figures as a list of names and values, notes as sentences; warnings stand at the head of the page."""
    told = [fact for fact in facts if fact.text and fact.severity == INFO]
    entries = []
    for fact in told:
        meaning = f' <span class="meaning">{escape(fact.meaning)}</span>' if fact.meaning else ""
        entries.append(f"<dt>{escape(fact.name)}</dt><dd><b>{escape(fact.text)}</b>{meaning}</dd>")
    notes = [f"<p>{escape(fact.text)}</p>" for fact in facts if fact.text and fact.severity == NOTE]
    return "\n".join([*notes, *(["<dl>\n" + "\n".join(entries) + "\n</dl>"] if entries else [])])


def _picture(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode("ascii")
    return f'<img alt="{escape(picture.description)}" src="data:image/png;base64,{data}">'
