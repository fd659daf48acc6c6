"""The numbers of a picture as a small page."""

import numpy as np

from maniport.live.state import LiveState, Picture
from maniport.spd.ellipsoid import lengths, volume
from maniport.validation import Array


def as_markdown(picture: Picture, state: LiveState, method: str, rate: float) -> str:
    """Write what a picture shows as numbers: three ellipsoids, how near they are, and the other methods."""
    three = {
        "person": picture.teacher_ellipsoid,
        "wanted": picture.wanted_ellipsoid,
        "robot": picture.student_ellipsoid,
    }
    lines = [
        f"**Robot to wanted: distance {picture.distance:.2f}**"
        + ("" if picture.position_error is None else f", hand {1e3 * picture.position_error:.1f} mm off"),
        "",
        "| | longest | shortest | volume | condition |",
        "|---|---|---|---|---|",
        *(f"| {name} | {_row(ellipsoid)} |" for name, ellipsoid in three.items()),
        "",
        "Semi-axes in m/s per rad/s.",
        "",
        "| method | gap here | gap, all | fit |",
        "|---|---|---|---|",
    ]
    maps, gaps = state.refitting.maps, state.gaps(picture.teacher_ellipsoid)
    for name, one in maps.items():
        here = "none" if gaps[name] is None else f"{gaps[name]:.2f}"
        spent = f"{1e3 * one.seconds:.0f} ms" if one.seconds else "none"
        label = f"**{name}**" if name == method else name
        lines.append(f"| {label} | {here} | {one.gap:.2f} | {spent} |")
    lines += ["", "Gap: distance from the wanted ellipsoid to the nearest of the robot's samples; all: median of many."]
    chosen = maps[method]
    lines += ["", *(f"*{text}*\n" for text in (chosen.ending, *chosen.notes, picture.note) if text)]
    lines += [f"{rate:.0f} pictures a second" + ("; fitting …" if state.refitting.busy else "")]
    return "\n".join(lines)


def _row(ellipsoid: Array) -> str:
    semi_axes = lengths(ellipsoid)
    with np.errstate(divide="ignore"):
        condition = float((semi_axes[-1] / semi_axes[0]) ** 2)
    told = f"{condition:.3g}" if condition < 1e6 else "flat"
    return f"{semi_axes[-1]:.2f} | {semi_axes[0]:.2f} | {float(volume(ellipsoid)):.2f} | {told}"
