"""A page with the report of a result, its motion and its curves, as one HTML file that loads nothing.

Jinja templates in ``templates`` lay out a `Report`; scripts in ``assets`` draw an `Animation` with WebGL and SVG.
"""

import base64
import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

import jinja2
from markupsafe import Markup, escape

from maniport.errors import InvalidInputError
from maniport.report.page.content import ROLES, STATES, Animation, Image, as_json
from maniport.report.values import Report
from maniport.util.atomic_io import written_whole
from maniport.version import __version__

CARDS = ("distance", "position_error", "orientation_error", "limits", "collisions")
"""Keys of the metrics of a summary that are on cards."""

SCRIPTS = ("geometry", "surface", "scene", "exports", "curves", "strips", "states", "map", "player", "page", "print")

LARGEST = 6_000_000  # Upper bound of the size of a page [bytes]

Contents = Mapping[str, Sequence[Animation | Image]]
"""Animations and images by the key (or the title) of the section that they belong to."""


def write_page(path: str | os.PathLike[str], report: Report, contents: Contents | None = None) -> None:
    """Write a report, with animations and images, to an HTML file, whole or not at all."""
    text = as_html(report, contents)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_html(report: Report, contents: Contents | None = None) -> str:
    """Return the page as text, with fewer times and without surfaces where it would be too large otherwise."""
    names = {section.key or section.title for section in report.sections}
    if unknown := sorted(set(contents or ()) - names):
        raise InvalidInputError(f"contents must name sections, {sorted(names)}; found {unknown}")
    for frames, surfaces in ((1500, True), (750, True), (375, True), (375, False)):
        text = _page(report, contents or {}, frames, surfaces)
        if (size := len(text.encode())) < LARGEST:
            return text
    raise InvalidInputError(
        f"a page must stay below {LARGEST / 1e6:g} MB; found {size / 1e6:.1f} MB without surfaces: "
        f"give fewer animations, images, panels or tables"
    )


def document(title: str, body: str, script: str, style: str = "", data: str = "", end: str = "") -> str:
    """Return an HTML file that loads nothing, in the style of all pages."""
    colors = templates().get_template("colors.css").render(roles=ROLES.values(), states=STATES.values())
    parts = {"script": script, "style": colors + _asset("page.css") + style}
    # names of the script and the style sheet for the security policy of the page, which allows no other
    hashes = {f"{name}_hash": f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
              for name, text in parts.items()}  # fmt: skip
    values = parts | hashes | {"title": title, "body": body, "data": data, "end": end, "version": __version__}
    return templates().get_template("document.html").render(**values)


def _page(report: Report, contents: Contents, frames: int, surfaces: bool) -> str:
    """Render the page with at most so many times of each animation, with or without surfaces of arms."""
    data: list[str] = []
    motions: dict[str, list[dict[str, str]]] = {}
    menu: list[tuple[str, str]] = []
    for k, section in enumerate(report.sections):
        name = section.key or section.title
        if section.folded and ("Details", "folded") not in menu:
            menu.append(("Details", "folded"))
        if k and section.title and not section.folded:
            menu.append((section.title, f"section-{k}"))
        for animation in (item for item in contents.get(name, ()) if isinstance(item, Animation)):
            label, notes = f"motion-{len(data)}", [animation.note]
            if len(animation.time) > frames:
                notes.append(f"{frames} of {len(animation.time)} times are included.")
            if not surfaces and any(body.parts for stage in animation.stages for body in stage.bodies):
                notes.append("Drawn as skeletons: with surfaces this file would be too large.")
            motions.setdefault(name, []).append({"id": label, "note": " ".join(filter(None, notes))})
            titles = [*animation.panels, *(["Domains and profiles"] if animation.map is not None else [])]
            menu += [(title, f"{label}-{i}") for i, title in enumerate(titles)]  # the scripts give these ids
            encoded = as_json(animation, frames, surfaces=surfaces)
            data.append(f'<script type="application/json" id="{label}">{encoded}</script>')
    images = {name: [item for item in content if isinstance(item, Image)] for name, content in contents.items()}
    values = {"report": report, "cards": CARDS, "menu": menu, "count": len(data), "motions": motions, "images": images}
    body = templates().get_template("report.html").render(**values)
    end = " Keys: space to play, ← and → to step." if data else ""
    script = "\n".join(_asset(f"{name}.js") for name in SCRIPTS)
    script = f'(() => {{\n"use strict";\n{script}}})();\n'  # all in one scope
    return document(report.title, body, script, data="\n".join(data), end=end)


@cache
def templates() -> jinja2.Environment:
    """Return the templates of pages and notebooks."""
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
