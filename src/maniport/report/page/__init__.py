"""A page with the report of a result, its motion and its curves, as one HTML file that loads nothing.

Jinja templates in ``templates`` lay out a `Report`; scripts in ``assets`` draw an `Animation` with WebGL and SVG.
"""

import base64
import hashlib
import os
import re
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

import jinja2
from markupsafe import Markup, escape

from maniport.errors import InvalidInputError
from maniport.report.page.content import ROLES, STATES, Animation, as_json, kept_rows
from maniport.report.values import TIME_COLUMN, Report
from maniport.util.atomic_io import write_text
from maniport.version import __version__

CAPABILITIES = ("force", "velocity")
"""Keys of the metrics of force and speed, whose values are levels of several motions."""

CARDS = (*CAPABILITIES, "distance", "position_error", "orientation_error", "limits", "collisions")
"""Keys of the metrics of a summary that are on cards."""

SCRIPTS = (
    "geometry",
    "surface",
    "scene",
    "curves",
    "arrows",
    "strips",
    "states",
    "player",
    "page",
    "print",
)


def write_page(
    path: str | os.PathLike[str],
    report: Report,
    animation: Animation | None = None,
    folder: str = "",
) -> None:
    """Write a report, with an animation in its first section, to an HTML file, whole or not at all.

    `folder` is where the results are, for the command of the next step.
    """
    write_text(path, as_html(report, animation, folder=folder))


def as_html(
    report: Report,
    animation: Animation | None = None,
    largest: int = 6_000_000,
    folder: str = "",
) -> str:
    """Return the page as text, with fewer times of the animation where it would be too large [bytes] otherwise."""
    for frames in (1500, 750, 375, 150):
        text = _page(report, animation, frames, folder)
        size = len(text.encode())
        if size < largest:
            return text
    raise InvalidInputError(
        f"a page must stay below {largest / 1e6:g} MB; found {size / 1e6:.1f} MB"
    )


def document(
    title: str, body: str, script: str, style: str = "", data: str = "", end: str = ""
) -> str:
    """Return an HTML file that loads nothing, in the style of all pages."""
    colors = (
        templates().get_template("colors.css").render(roles=ROLES.values(), states=STATES.values())
    )
    style = colors + _asset("page.css") + style
    values = {
        "script": script,
        "style": style,
        "script_hash": _source(script),
        "style_hash": _source(style),
        "title": title,
        "body": body,
        "data": data,
        "end": end,
        "version": __version__,
    }
    return templates().get_template("document.html").render(**values)


def _source(text: str) -> str:
    """Return the name of a script or a style sheet for the security policy of the page, which allows no other."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"


def _page(report: Report, animation: Animation | None, frames: int, folder: str) -> str:
    """Render the page with at most so many times of the animation."""
    data = ""
    note = ""
    end = ""
    menu = []
    if animation is not None:
        for i, title in enumerate(animation.panels):
            menu.append((title, f"motion-{i}"))  # the scripts give these ids
        note = animation.note
        end = " Keys: space to play, ← and → to step."
        count = len(kept_rows(animation.time, frames, report.times))
        if count < len(animation.time):
            note += f" {count} of {len(animation.time)} times are included."
        motion = as_json(animation, frames, report.times)
        data = f'<script type="application/json" id="motion">{motion}</script>'
    for k, section in enumerate(report.sections):
        if k and section.title and not section.folded:
            menu.append((section.title, f"section-{k}"))
    if any(section.folded for section in report.sections):
        menu.append(("Details", "folded"))
    values = {
        "report": report,
        "capabilities": CAPABILITIES,
        "cards": CARDS,
        "menu": menu,
        "moves": animation is not None,
        "note": note,
        "time_column": TIME_COLUMN,
        "command": report.command_for(folder),
    }
    body = templates().get_template("report.html").render(**values)
    scripts = "\n".join(_asset(f"{name}.js") for name in SCRIPTS)
    script = f'(() => {{\n"use strict";\n{scripts}}})();\n'  # all in one scope
    return document(report.title, body, script, data=data, end=end)


@cache
def templates() -> jinja2.Environment:
    """Return the templates of pages."""
    loader = jinja2.FunctionLoader(
        lambda name: files(__package__).joinpath("templates", name).read_text("utf-8")
    )
    environment = jinja2.Environment(
        loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["linked"] = _linked
    environment.filters["exact"] = _exact
    environment.filters["digits"] = _digits
    return environment


def _linked(text: str, moves: bool, times: Sequence[float] = ()) -> Markup:
    """Escape a text, "84 %" in one line; its times become links where the page has a motion.

    A link leads to the exact one of `times` [s] that is written rounded, in their order.
    """
    safe = str(escape(re.sub(r"(?<=\d) (?=%)", "\xa0", text)))
    if not moves:
        return Markup(safe)
    left = list(times)

    def link(match: re.Match[str]) -> str:
        written = match[1]
        exact = next((time for time in left if f"{time:.1f}" == written), None)
        if exact is None:
            return f'<a href="#t={written}">{match[0]}</a>'
        left.remove(exact)
        return f'<a href="#t={_exact(exact)}">{match[0]}</a>'

    return Markup(re.sub(r"\bat (-?\d+\.\d) s\b", link, safe))


def _exact(time: float) -> str:
    """Write a time [s] for a link: to a microsecond, finer than any recording."""
    return f"{time:.6f}"


def _digits(value: float) -> str:
    """Write a number with three digits that count, without a power of ten."""
    return f"{float(f'{value:.3g}'):g}"


@cache
def _asset(name: str) -> str:
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")
