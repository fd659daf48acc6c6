"""A page that can be sent: what was done, what came out, and the motion itself, to look at without a network.

It takes facts, and values and arrays to look at (`maniport.telling.page.content`), and gives one HTML file. The
scripts and the style sheet in ``assets`` are part of the file; they draw with WebGL and SVG and load nothing.
"""

import base64
import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files

from maniport.atomic_io import written_whole
from maniport.errors import InvalidInputError
from maniport.telling.facts import Facts
from maniport.telling.page import elements
from maniport.telling.page.content import Body, Cloud, DomainMap, Line, Motion, Panel, Part, Picture
from maniport.telling.page.encoding import MAX_FRAMES, as_json
from maniport.telling.page.profiles import domain_map, ellipsoid_panels
from maniport.telling.page.states import STATES
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

SCRIPTS = (
    "geometry.js", "surface.js", "scene.js", "exports.js", "curves.js", "strips.js", "states.js", "map.js", "player.js",
    "page.js", "print.js",
)  # fmt: skip

FOLDED = "Method and data"
"""Title above folded sections."""

MAP = "Domains and profiles"
"""Title of the map of a motion."""

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
    """Write facts, with what there is to look at, to an HTML file, whole or not at all."""
    text = as_html(facts, shown)
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def as_html(facts: Facts, shown: Shown | None = None) -> str:
    """Return the page as text; the same content gives the same text."""
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
    places: list[tuple[str, str]] = []
    notes = "" if facts.verdict is None else elements.warnings(facts, folded=True)
    sections = []
    for k, section in enumerate(facts.sections):
        place, parts = f"section-{k}", shown.get(section.key or section.title, ())
        if section.folded and FOLDED not in dict(places):
            places.append((FOLDED, "folded"))
            sections.append(f'<h2 id="folded">{FOLDED}</h2>')
        places += [(section.title, place)] if k and section.title and not section.folded else []
        for number, part in enumerate((one for one in parts if isinstance(one, Motion)), len(motions)):
            places += _groups(part, number)
        before = len(motions)
        above, below = _shown(parts, motions, fitting, notes)
        notes = notes if len(motions) == before else ""
        sections.append(elements.section(section, place, above, below))
    body = "\n".join([elements.header(facts, places), "<main>", *filter(None, [notes]), *sections, "</main>"])
    if not motions:  # there is no moment to go to
        body = re.sub(r'<a href="#t=[^"]*">(.*?)</a>', r"\1", body)
    data = "\n".join(
        f'<script type="application/json" id="motion-{k}">'
        f"{as_json(motion, fitting.frames, surfaces=fitting.surfaces)}</script>"
        for k, motion in enumerate(motions)
    )
    return document(facts.title, body, _script(), data=data, end=KEYS if motions else "")


def document(title: str, body: str, script: str, style: str = "", data: str = "", end: str = "") -> str:
    """Return an HTML file that loads nothing, in the style of all pages."""
    style = _colors() + _asset("page.css") + style
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
<title>{escape(title)}</title>
<style>{style}</style>
</head>
<body>
{body}
<footer>maniport {__version__}. This file works without a network.{end}</footer>
{data}
<script>{script}</script>
</body>
</html>
"""


def _groups(motion: Motion, number: int) -> list[tuple[str, str]]:
    """Name the groups of a motion's panels, and its map, with the places that its scripts give them."""
    titles = [*motion.panels, *([MAP] if motion.map is not None else [])]
    short = {title.partition(" of ")[0]: f"motion-{number}-{k}" for k, title in reversed([*enumerate(titles)])}
    return list(reversed(short.items()))


def _shown(parts: Sequence[Motion | Picture], motions: list[Motion], fitting: Fitting, notes: str) -> tuple[str, str]:
    """Write what there is to look at: what stands at the head of a section, and what at its end."""
    above, below = [], []
    for part in parts:
        if isinstance(part, Motion):
            said = _note(part, fitting)
            note = f'<p class="meaning">{escape(said)}</p>' if said else ""
            above.append(f'<div class="motion" data-source="motion-{len(motions)}">{note}{notes}</div>')
            motions.append(part)
            notes = ""
    pictures = [part for part in parts if isinstance(part, Picture)]
    fallback = "\n".join(elements.picture(one) for one in pictures if one.still and fitting.pictures)
    if above:
        missing = "The moving pictures and curves need scripts, which are part of this file."
        above.append(f'<noscript><p class="failure">{missing}</p><div class="pictures">{fallback}</div></noscript>')
    lasting = [one for one in pictures if not one.still]
    if lasting and fitting.pictures:
        below.append('<div class="pictures">' + "\n".join(map(elements.picture, lasting)) + "</div>")
    elif lasting:
        below.append('<p class="meaning">This file would be too large with its pictures; they are left out.</p>')
    return "\n".join(above), "\n".join(below)


def _note(motion: Motion, fitting: Fitting) -> str:
    """Say what a motion shows, and what is left out of it here."""
    sentences = [motion.note] if motion.note else []
    if len(motion.time) > fitting.frames:
        sentences.append(f"{fitting.frames} of {len(motion.time)} moments are shown.")
    if not fitting.surfaces and any(body.parts for body in motion.bodies):
        sentences.append("Drawn as skeletons: with surfaces this file would be too large.")
    return " ".join(sentences)


@cache
def _asset(name: str) -> str:
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")


def _colors() -> str:
    """Style of roles: their colours, for light and for dark ground, and how one of them is hidden."""
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


@cache
def _script() -> str:
    """All scripts in one scope of their own."""
    return '(() => {\n"use strict";\n' + "\n".join(_asset(name) for name in SCRIPTS) + "})();\n"


def _hash(text: str) -> str:
    """Name a script or a style sheet for the page's security policy, which lets no other run."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
