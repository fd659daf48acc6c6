"""Several demonstrations over time, with what is learned of them and how much it may vary."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from maniport.spd.ellipsoid import lengths
from maniport.telling.figures.style import (
    TEXT,
    UNIT,
    WIDEST,
    column_figure,
    dress_over_time,
    laid_out,
    legend_of_names,
    with_breaks,
)
from maniport.telling.roles import PERSON, REFERENCE
from maniport.validation import Array

THIN = 0.5
"""Width of the line of a demonstration [pt]."""

BAND = 0.2
"""Opacity of the band."""


def learned(
    demonstrated: tuple[Array, Array, Array],
    found: tuple[Array, Array, Array],
    deviations: Array,
    odd: int | None = None,
    unit: str = UNIT,
) -> Figure:
    """Draw the semi-axes and the hand of demonstrations, thin, and of what is learned of them, wide."""
    (times, ellipsoids, hands), (time, profile, path) = demonstrated, found
    semi_axes, each = lengths(profile), lengths(ellipsoids)
    d = semi_axes.shape[1]
    names = (
        ("minor", "middle", "major") if d == 3 else ("minor", "major") if d == 2 else tuple(map(str, range(1, d + 1)))
    )
    figure = column_figure(0.5 + 0.75 * (d + 3))
    panels = list(figure.subplots(d + 3, 1, sharex=True))
    for row, panel in zip(range(d - 1, -1, -1), panels, strict=False):
        _lines(panel, times, each[..., row], time, semi_axes[:, row], odd)
        band = semi_axes[:, row, None] * np.exp(deviations[:, row, None] * np.array([-1.0, 1.0]))
        panel.fill_between(time, *band.T, color=PERSON.color, alpha=BAND, lw=0)
        panel.set_ylim(0.0, 1.05 * max(float(each[..., row].max()), float(semi_axes[:, row].max())))
        panel.set_title(f"{names[row]} semi-axis [{unit}]", fontsize=TEXT, loc="left", pad=2)
    for row, (panel, name) in enumerate(zip(panels[d:], ("x, forward", "y, left", "z, up"), strict=True)):
        _lines(panel, times, hands[..., row], time, path[:, row], odd)
        panel.set_title(f"hand, {name} [m]", fontsize=TEXT, loc="left", pad=2)
    dress_over_time(panels)
    handles = [
        Line2D([], [], color=PERSON.pale, lw=THIN, label="demonstrations"),
        *([Line2D([], [], color=REFERENCE.color, lw=THIN, ls="--", label="the odd one")] if odd is not None else []),
        Line2D([], [], color=PERSON.color, lw=WIDEST, label="learned"),
        Patch(color=PERSON.color, alpha=BAND, lw=0, label="± 1 deviation"),
    ]
    legend_of_names(figure, handles)
    return laid_out(figure)


def _lines(panel: Axes, times: Array, each: Array, time: Array, learned: Array, odd: int | None) -> None:
    for number, one in enumerate(each):
        color, style = (REFERENCE.color, "--") if number == odd else (PERSON.pale, "-")
        panel.plot(*with_breaks(times, one), color=color, ls=style, lw=THIN)
    panel.plot(*with_breaks(time, learned), color=PERSON.color, lw=WIDEST)
