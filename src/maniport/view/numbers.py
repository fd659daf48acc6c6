"""What the panel says in numbers: one distance with its last seconds, and tables for who wants more."""

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from maniport.demonstrations.both_arms import EACH
from maniport.evaluation.baselines import LOOKUP
from maniport.spd.ellipsoid import lengths, volume
from maniport.telling.facts import in_axes
from maniport.telling.roles import ACHIEVED, PERSON, TARGET, Role
from maniport.validation import Array
from maniport.view.maps import LiveMap
from maniport.view.pair import LivePair
from maniport.view.picture import Picture
from maniport.view.state import LiveState

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


def headlines(pictures: Sequence[Picture], courses: Sequence[Course]) -> str:
    """Say the distance of each arm, large, with its last seconds, and which colour is whose."""
    told = [headline(*one) for one in zip(_whose(pictures), pictures, courses, strict=True)]
    return f'<div style="padding: 0 0.6em">{"".join(told)}<div>{LEGEND}</div></div>'


def headline(whose: str, picture: Picture, course: Course) -> str:
    """Say one distance, large, with its last seconds."""
    tip = "" if picture.position_error is None else f"; tip {1e3 * picture.position_error:.1f} mm off"
    joints = ", ".join(picture.at_limit)
    held = f'<div style="font-weight: bold">at its limit: {joints}</div>' if joints else ""
    return (
        f'<div style="font-size: 2.2em; line-height: 1.1">{picture.distance:.2f}</div>'
        f"<div>{whose}distance of achieved and target: {in_axes(picture.distance)}{tip}</div>"
        f"{course.drawn()}{held}"
    )


def of_ellipsoids(pictures: Sequence[Picture]) -> str:
    """Write the three ellipsoids of each arm as a table."""
    three = {
        whose + role.name: ellipsoid
        for whose, one in zip(_whose(pictures), pictures, strict=True)
        for role, ellipsoid in (
            (PERSON, one.demonstrated_ellipsoid), (TARGET, one.target_ellipsoid), (ACHIEVED, one.achieved_ellipsoid)
        )
    }  # fmt: skip
    head = ("| | longest | shortest | volume | condition |", "|---|---|---|---|---|")
    rows = (f"| {name} | {_row(ellipsoid)} |" for name, ellipsoid in three.items())
    return "\n".join((*head, *rows, "", "Semi-axes in m/s per rad/s."))


def of_methods(pictures: Sequence[Picture], state: LiveState | LivePair, method: str, rate: float) -> str:
    """Write how near each method's targets are to what each arm of the robot can make."""
    each = [one.refitting.maps for one in state.each]
    gaps = [one.gaps(picture.demonstrated_ellipsoid) for one, picture in zip(state.each, pictures, strict=True)]
    whose = _whose(pictures)
    lines = [
        f"| method | {' | '.join(f'{one}feasibility gap' for one in whose)} | fit |",
        "|---" * (len(each) + 2) + "|",
    ]
    for name in state.methods:
        label = f"**{name}**" if name == method else name
        here = [_gap(name, maps, found) for maps, found in zip(each, gaps, strict=True)]
        seconds = sum(maps[name].seconds for maps in each if name in maps)
        lines.append(f"| {label} | {' | '.join(here)} | {f'{1e3 * seconds:.0f} ms' if seconds else '—'} |")
    lines += ["", "Feasibility gap: distance from the target to the nearest ellipsoid that was found for the robot."]
    told = []
    for prefix, maps, picture in zip(whose, each, pictures, strict=True):
        chosen = maps.get(method)
        words = (picture.note,) if chosen is None else (chosen.ending, *chosen.notes, picture.note)
        told += [f"*{prefix}{text}*\n" for text in words if text]
    busy = any(one.refitting.busy for one in state.each)
    lines += ["", *told, f"{rate:.0f} pictures a second" + ("; fitting …" if busy else "")]
    return "\n".join(lines)


def _gap(name: str, maps: Mapping[str, LiveMap], gaps: Mapping[str, float | None]) -> str:
    """Say how near a method's target is."""
    if name not in maps:
        return "fitting …"
    gap = gaps.get(name)
    # what the robot made once has no gap, wherever that was: the figure would say nothing
    return "—" if name == LOOKUP or gap is None else f"{gap:.2f}"


def _whose(pictures: Sequence[Picture]) -> tuple[str, ...]:
    """Which arm each picture is of, before other words; nothing where there is one."""
    return ("",) if len(pictures) == 1 else tuple(f"{side}: " for side in EACH)


def _row(ellipsoid: Array) -> str:
    semi_axes = lengths(ellipsoid)
    with np.errstate(divide="ignore"):
        condition = float((semi_axes[-1] / semi_axes[0]) ** 2)
    told = f"{condition:.3g}" if condition < 1e6 else "flat"
    return f"{semi_axes[-1]:.2f} | {semi_axes[0]:.2f} | {float(volume(ellipsoid)):.2f} | {told}"
