"""What the panel says in numbers: one distance with its last seconds, and tables for who wants more."""

from collections import deque

import numpy as np

from maniport.evaluation.rows import LOOKUP
from maniport.spd.ellipsoid import lengths, volume
from maniport.telling.facts import in_axes
from maniport.telling.roles import ACHIEVED, PERSON, TARGET, Role
from maniport.validation import Array
from maniport.view.state import LiveState, Picture

MEMORY = 10.0
"""Seconds of the past that the curve shows."""
WIDTH, HEIGHT = 280, 44
"""Of the curve [pixels]."""
TOP = 1.0
"""Distance at the upper edge of the curve, as long as none is larger."""


def _named(role: Role) -> str:
    return f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'


LEGEND = "".join(map(_named, (PERSON, TARGET, ACHIEVED)))
"""Which colour is whose ellipsoid."""


class Course:
    """Distances of the last seconds."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque()
        self._now = 0.0

    def add(self, seconds: float, distance: float) -> None:
        """Note a distance, some time after the last one [s]."""
        self._now += seconds
        self._seen.append((self._now, distance))
        while self._seen[0][0] < self._now - MEMORY:
            self._seen.popleft()

    def drawn(self) -> str:
        """Draw them as an SVG picture of fixed size."""
        top = max(TOP, max(d for _, d in self._seen))
        # one point for a pixel: a curve of sixty points a second would be long to send
        heights = {round(WIDTH * (1 - (self._now - t) / MEMORY)): HEIGHT * (1 - d / top) for t, d in self._seen}
        line = " ".join(f"{x},{y:.1f}" for x, y in heights.items())
        return (
            f'<svg width="100%" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none" role="img" '
            f'aria-label="distance in the last {MEMORY:.0f} seconds"><polyline points="{line}" fill="none" '
            f'stroke="{ACHIEVED.color}" stroke-width="2" vector-effect="non-scaling-stroke"/></svg>'
            f'<div style="font-size: 0.75em; opacity: 0.7">last {MEMORY:.0f} s, from 0 to {top:.2g}</div>'
        )


def headline(picture: Picture, course: Course) -> str:
    """Say the one distance, large, with its last seconds."""
    tip = "" if picture.position_error is None else f"; tip {1e3 * picture.position_error:.1f} mm off"
    joints = ", ".join(picture.at_limit)
    held = f'<div style="font-weight: bold">at its limit: {joints}</div>' if joints else ""
    return (
        f'<div style="padding: 0 0.6em"><div style="font-size: 2.2em; line-height: 1.1">{picture.distance:.2f}</div>'
        f"<div>distance of achieved and target: {in_axes(picture.distance)}{tip}</div>"
        f"{course.drawn()}{held}<div>{LEGEND}</div></div>"
    )


def of_ellipsoids(picture: Picture) -> str:
    """Write the three ellipsoids as a table."""
    three = {
        PERSON.name: picture.demonstrated_ellipsoid,
        TARGET.name: picture.target_ellipsoid,
        ACHIEVED.name: picture.achieved_ellipsoid,
    }
    head = ("| | longest | shortest | volume | condition |", "|---|---|---|---|---|")
    rows = (f"| {name} | {_row(ellipsoid)} |" for name, ellipsoid in three.items())
    return "\n".join((*head, *rows, "", "Semi-axes in m/s per rad/s."))


def of_methods(picture: Picture, state: LiveState, method: str, rate: float) -> str:
    """Write how near each method's target is to what the robot can make."""
    maps, gaps = state.refitting.maps, state.gaps(picture.demonstrated_ellipsoid)
    lines = ["| method | feasibility gap | fit |", "|---|---|---|"]
    for name in state.methods:
        label = f"**{name}**" if name == method else name
        if name not in maps:
            lines.append(f"| {label} | fitting … | |")
            continue
        # what the robot made once has no gap, wherever that was: the figure would say nothing
        here = "—" if name == LOOKUP or gaps[name] is None else f"{gaps[name]:.2f}"
        spent = f"{1e3 * maps[name].seconds:.0f} ms" if maps[name].seconds else "—"
        lines.append(f"| {label} | {here} | {spent} |")
    lines += ["", "Feasibility gap: distance from the target to the nearest ellipsoid that was found for the robot."]
    chosen = maps.get(method)
    told = () if chosen is None else (chosen.ending, *chosen.notes)
    lines += ["", *(f"*{text}*\n" for text in (*told, picture.note) if text)]
    lines.append(f"{rate:.0f} pictures a second" + ("; fitting …" if state.refitting.busy else ""))
    return "\n".join(lines)


def _row(ellipsoid: Array) -> str:
    semi_axes = lengths(ellipsoid)
    with np.errstate(divide="ignore"):
        condition = float((semi_axes[-1] / semi_axes[0]) ** 2)
    told = f"{condition:.3g}" if condition < 1e6 else "flat"
    return f"{semi_axes[-1]:.2f} | {semi_axes[0]:.2f} | {float(volume(ellipsoid)):.2f} | {told}"
