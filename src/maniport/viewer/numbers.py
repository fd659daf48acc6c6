"""The numbers of the panel: the distance with its last seconds, and tables."""

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from maniport.evaluation.baselines import LOOKUP
from maniport.mocap.arm_ik import GROUP
from maniport.report.metrics import in_axes
from maniport.report.roles import ACHIEVED, PERSON, TARGET, Role
from maniport.spd.ellipsoid import lengths, volume
from maniport.util.validation import Array
from maniport.viewer.maps import LiveMap
from maniport.viewer.state import Frame, ViewState

MEMORY = 10.0  # Seconds of the past that the curve shows


def _named(role: Role) -> str:
    return f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'


LEGEND = "".join(map(_named, (PERSON, TARGET, ACHIEVED)))  # The colors of the ellipsoids


class History:
    """Distances of the last seconds."""

    def __init__(self) -> None:
        self._distances: deque[tuple[float, float]] = deque()
        self._now = 0.0

    def add(self, seconds: float, distance: float) -> None:
        """Add a distance, some time after the last one [s]."""
        self._now += seconds
        self._distances.append((self._now, distance))
        while self._distances[0][0] < self._now - MEMORY:
            self._distances.popleft()

    def curve(self, width: int = 280, height: int = 44) -> str:
        """Draw them as SVG [pixels]; one point a pixel, since the curve is sent often."""
        top = max(1.0, max(distance for _, distance in self._distances))
        points = {round(width * (1 - (self._now - t) / MEMORY)): height * (1 - d / top) for t, d in self._distances}
        line = " ".join(f"{x},{y:.1f}" for x, y in points.items())
        return (
            f'<svg width="100%" height="{height}" viewBox="0 0 {width} {height}" preserveAspectRatio="none" role="img" '
            f'aria-label="distance in the last {MEMORY:.0f} seconds"><polyline points="{line}" fill="none" '
            f'stroke="{ACHIEVED.color}" stroke-width="2" vector-effect="non-scaling-stroke"/></svg>'
            f'<div style="font-size: 0.75em; opacity: 0.7">last {MEMORY:.0f} s, from 0 to {top:.2g}</div>'
        )


def headlines(frames: Sequence[Frame], histories: Sequence[History]) -> str:
    """The distance of each arm, large, with its last seconds, and the legend."""
    lines = [_headline(*parts) for parts in zip(_sides(frames), frames, histories, strict=True)]
    return f'<div style="padding: 0 0.6em">{"".join(lines)}<div>{LEGEND}</div></div>'


def _headline(side: str, frame: Frame, history: History) -> str:
    error = "" if frame.position_error is None else f"; position error {1e3 * frame.position_error:.1f} mm"
    joints = ", ".join(frame.at_limit)
    limits = f'<div style="font-weight: bold">at its limit: {joints}</div>' if joints else ""
    return (
        f'<div style="font-size: 2.2em; line-height: 1.1">{frame.distance:.2f}</div>'
        f"<div>{side}distance of achieved and target: {in_axes(frame.distance)}{error}</div>"
        f"{history.curve()}{limits}"
    )


def ellipsoid_table(frames: Sequence[Frame]) -> str:
    """The three ellipsoids of each arm as a table."""
    rows = ["| | longest | shortest | volume | condition |", "|---|---|---|---|---|"]
    for side, frame in zip(_sides(frames), frames, strict=True):
        ellipsoids = (frame.demonstrated_ellipsoid, frame.target_ellipsoid, frame.achieved_ellipsoid)
        for role, ellipsoid in zip((PERSON, TARGET, ACHIEVED), ellipsoids, strict=True):
            rows.append(f"| {side}{role.name} | {_row(ellipsoid)} |")
    return "\n".join([*rows, "", "Semi-axes in m/s per rad/s."])


def _row(ellipsoid: Array) -> str:
    semi_axes = lengths(ellipsoid)
    with np.errstate(divide="ignore"):
        condition = float((semi_axes[-1] / semi_axes[0]) ** 2)
    shown = f"{condition:.3g}" if condition < 1e6 else "flat"
    return f"{semi_axes[-1]:.2f} | {semi_axes[0]:.2f} | {float(volume(ellipsoid)):.2f} | {shown}"


def method_table(frames: Sequence[Frame], state: ViewState, method: str, rate: float) -> str:
    """The feasibility gaps of each method's targets, and how the fits stopped."""
    maps = [side.refitting.maps for side in state.sides]
    gaps = [side.gaps(frame.demonstrated_ellipsoid) for side, frame in zip(state.sides, frames, strict=True)]
    sides = _sides(frames)
    rows = [
        f"| method | {' | '.join(f'{side}feasibility gap' for side in sides)} | fit |",
        "|---" * (len(maps) + 2) + "|",
    ]
    for name in state.methods:
        label = f"**{name}**" if name == method else name
        cells = " | ".join(_gap(name, own, found) for own, found in zip(maps, gaps, strict=True))
        seconds = sum(own[name].seconds for own in maps if name in own)
        rows.append(f"| {label} | {cells} | {f'{1e3 * seconds:.0f} ms' if seconds else '—'} |")
    notes = []
    for side, own, frame in zip(sides, maps, frames, strict=True):
        fit = (own[method].ending, *own[method].notes) if method in own else ()
        notes += [f"*{side}{note}*\n" for note in (*fit, frame.note) if note]
    busy = "; fitting …" if any(side.refitting.busy for side in state.sides) else ""
    meaning = "Feasibility gap: distance from the target to the nearest ellipsoid that was found for the robot."
    return "\n".join([*rows, "", meaning, "", *notes, f"{rate:.0f} frames a second{busy}"])


def _gap(name: str, maps: Mapping[str, LiveMap], gaps: Mapping[str, float | None]) -> str:
    if name not in maps:
        return "fitting …"
    gap = gaps.get(name)
    # targets that the robot made once have no gap, wherever it was then: the figure would say nothing
    return "—" if name == LOOKUP or gap is None else f"{gap:.2f}"


def _sides(frames: Sequence[Frame]) -> tuple[str, ...]:
    """The side of each arm, as a prefix; nothing where there is one."""
    return ("",) if len(frames) == 1 else tuple(f"{side}: " for side in GROUP)
