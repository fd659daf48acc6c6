"""A page with the report of a result, its motion and its curves, as one HTML file that loads nothing.

Jinja templates in ``templates`` lay out a `Report`; scripts in ``assets`` draw a `Motion` with WebGL and SVG. Nothing
is computed here.
"""

import base64
import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
from markupsafe import Markup, escape

from maniport.errors import InvalidInputError
from maniport.report.metrics import Report
from maniport.report.page.content import (
    STATES,
    Body,
    Cloud,
    DomainMap,
    Line,
    Motion,
    Panel,
    Part,
    Picture,
    as_json,
)
from maniport.report.roles import ROLES
from maniport.util.atomic_io import written_whole
from maniport.version import __version__

__all__ = [
    "Body", "Cloud", "DomainMap", "Line", "Motion", "Panel", "Part", "Picture", "as_html", "document", "write_page",
]  # fmt: skip

LARGEST = 6_000_000  # Upper bound of the size of a page [bytes]

Shown = Mapping[str, Sequence[Motion | Picture]]
"""Motions and pictures by the key (or the title) of the section that they belong to."""


def write_page(path: str | os.PathLike[str], report: Report, shown: Shown | None = None) -> None:
    """Write a report, with motions and pictures, to an HTML file, whole or not at all."""
    text = as_html(report, shown)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_html(report: Report, shown: Shown | None = None) -> str:
    """Return the page as text, with fewer times and without surfaces where it would be too large otherwise."""
    names = {section.key or section.title for section in report.sections}
    if unknown := sorted(set(shown or ()) - names):
        raise InvalidInputError(f"shown must name sections, {sorted(names)}; found {unknown}")
    for frames, surfaces in ((1500, True), (750, True), (375, True), (375, False)):
        text = _page(report, shown or {}, frames, surfaces)
        if (size := len(text.encode())) < LARGEST:
            return text
    raise InvalidInputError(
        f"a page must stay below {LARGEST / 1e6:g} MB; found {size / 1e6:.1f} MB without surfaces: "
        f"give fewer motions, pictures, panels or tables"
    )


def document(title: str, body: str, script: str, style: str = "", data: str = "", end: str = "") -> str:
    """Return an HTML file that loads nothing, in the style of all pages."""
    style = _colors() + _asset("page.css") + style
    hashes = {"script_hash": _hash(script), "style_hash": _hash(style)}
    values = {"title": title, "body": body, "script": script, "style": style, "data": data, "end": end}
    return _templates().get_template("document.html").render(**values, **hashes, version=__version__)


def _page(report: Report, shown: Shown, frames: int, surfaces: bool) -> str:
    places: list[dict[str, Any]] = []
    data: list[str] = []
    menu: list[tuple[str, str]] = []
    for k, section in enumerate(report.sections):
        content, motions = shown.get(section.key or section.title, ()), []
        if section.folded and ("Method and data", "folded") not in menu:
            menu.append(("Method and data", "folded"))
        if k and section.title and not section.folded:
            menu.append((section.title, f"section-{k}"))
        for motion in (one for one in content if isinstance(one, Motion)):
            name = f"motion-{len(data)}"
            note = _note(motion, frames, surfaces)
            motions.append({"id": name, "note": note, "first": not data and report.summary})
            menu += _groups(motion, name)
            encoded = as_json(motion, frames, surfaces=surfaces)
            data.append(f'<script type="application/json" id="{name}">{encoded}</script>')
        pictures = [one for one in content if isinstance(one, Picture)]
        places.append({"id": f"section-{k}", "section": section, "motions": motions, "pictures": pictures})
    counts = [(len(report.warnings), "warning"), (len(report.notes), "note")]
    remarks = " and ".join(f"{n} {word}{'s' if n > 1 else ''}" for n, word in counts if n)
    folded = next((place["id"] for place in places if place["section"].folded), "")
    body = (
        _templates()
        .get_template("report.html")
        .render(report=report, places=places, menu=menu, motions=len(data), remark_count=remarks, first_folded=folded)
    )
    end = " Keys: space plays, ← and → step." if data else ""
    return document(report.title, body, _script(), data="\n".join(data), end=end)


def _groups(motion: Motion, name: str) -> list[tuple[str, str]]:
    """Name the groups of a motion's panels, and its map, with the ids that the scripts give them."""
    titles = [*motion.panels, *(["Domains and profiles"] if motion.map is not None else [])]
    short = {title.partition(" of ")[0]: f"{name}-{k}" for k, title in reversed([*enumerate(titles)])}
    return list(reversed(short.items()))


def _note(motion: Motion, frames: int, surfaces: bool) -> str:
    """Describe a motion and what is omitted from it."""
    sentences = [motion.note] if motion.note else []
    if len(motion.time) > frames:
        sentences.append(f"{frames} of {len(motion.time)} times are included.")
    if not surfaces and any(body.parts for body in motion.bodies):
        sentences.append("Drawn as skeletons: with surfaces this file would be too large.")
    return " ".join(sentences)


@cache
def _templates() -> jinja2.Environment:
    loader = jinja2.FunctionLoader(lambda name: files(__package__).joinpath("templates", name).read_text("utf-8"))
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"linked": _linked, "base64": lambda data: base64.b64encode(data).decode("ascii")}
    return environment


def _linked(text: str, motions: int) -> Markup:
    """Escape a text; its times become links where the page has a motion."""
    safe = str(escape(text))
    return Markup(re.sub(r"\bat (-?\d+\.\d) s\b", r'<a href="#t=\1">\g<0></a>', safe) if motions else safe)


@cache
def _asset(name: str) -> str:
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    """Return all scripts in one scope."""
    names = ["geometry", "surface", "scene", "exports", "curves", "strips", "states", "map", "player", "page", "print"]
    return '(() => {\n"use strict";\n' + "\n".join(_asset(f"{name}.js") for name in names) + "})();\n"


def _colors() -> str:
    """Return the style of roles and states on a light and on a dark background."""
    light, dark = (
        "".join(f"--{role.name}:{getattr(role, ground)};" for role in ROLES.values())
        + "".join(f"--state{k}:{colors[number]};" for k, colors in enumerate(STATES.values()))
        for number, ground in enumerate(("color", "dark"))
    )
    rules = "".join(
        f".{name}{{color:var(--{name})}}.without-{name} :is(path.{name},.of-{name}){{display:none}}" for name in ROLES
    )
    rules += "".join(f".state{k}{{color:var(--state{k});fill:var(--state{k})}}" for k in range(len(STATES)))
    night = f"@media screen and (prefers-color-scheme:dark){{:root:not([data-print]){{{dark}}}}}"
    return f":root{{{light}}}{night}{rules}\n"


def _hash(text: str) -> str:
    """Name a script or a style sheet for the security policy of the page, which allows no other."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
