"""Rows of ellipsoids along a motion: before and after the transfer, or over those that they should become."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.subsample import evenly_spaced
from maniport.telling.course import is_gap
from maniport.telling.figures.style import (
    TEXT,
    UNIT,
    check_profiles,
    colors_of,
    column_figure,
    laid_out,
    legend_of_names,
)
from maniport.telling.roles import PERSON, REFERENCE, TARGET
from maniport.validation import Array, as_count, as_times

DARKEST, PALEST = 0.45, 0.1
"""Opacities that the first and the last row are filled with, so that they differ in grey too."""

DASHES = (0, (1.6, 1.1))
"""Of the truth: short enough for small ellipses."""

NAMES = ("teacher", "adapted", "truth")

VIEWS = {
    2: {"in the plane (x right, y up)": [0, 1]},
    3: {"from above (x right, y up)": [0, 1], "from the front (y right, z up)": [1, 2]},
}
"""Titles of the views, and the coordinates that each shows to the right and up."""


def ellipsoids(
    time: ArrayLike,
    profiles: Mapping[str, ArrayLike],
    count: int = 9,
    unit: str = UNIT,
    axis: str = "time [s]",
    roles: Mapping[str, str] | None = None,
) -> Figure:
    """Draw ellipsoids sampled along time, one row for each profile, seen from above and from the front."""
    times = as_times(time)
    checked = check_profiles(profiles, len(times))
    frames = _frames(times, as_count(count, "count"))
    fills = np.linspace(DARKEST, PALEST, len(checked)) if len(checked) > 1 else np.array([DARKEST])
    colors = [color for color, _ in colors_of(checked, roles)]
    rows = [_Row(*row) for row in zip(checked, (x[frames] for x in checked.values()), colors, fills, strict=True)]
    decimals = max(0, 1 - int(np.floor(np.log10(np.ptp(times) / len(frames) or 1.0))))
    figure, panels = _stacked(rows, unit, [f"{t:.{decimals}f}" for t in times[frames]], axis)
    for panel in panels:
        panel.set_yticks([])
    legend_of_names(figure, [row.patch() for row in rows])
    return laid_out(figure)


def ellipsoid_views(
    teacher: ArrayLike,
    adapted: ArrayLike,
    truth: ArrayLike,
    names: Sequence[str] = NAMES,
    count: int = 9,
    unit: str = UNIT,
) -> Figure:
    """Draw what the teacher shows, and below it what the adapter makes of it."""
    if len(tuple(names)) != 3 or len(set(names)) != 3:
        raise InvalidInputError(f"names must be three different words; found {names!r}")
    sets = dict(zip(names, (teacher, adapted, truth), strict=True))
    checked = check_profiles(sets)
    total, d, _ = next(iter(checked.values())).shape
    if d != 3:
        raise InvalidInputError("ellipsoids must be 3×3 to be seen from two sides; found 2×2")
    chosen = evenly_spaced(total, as_count(count, "count"))
    (before, first), (after, second), (goal, third) = ((name, points[chosen]) for name, points in checked.items())
    rows = [_Row(before, first, PERSON.color, DARKEST), _Row(after, second, TARGET.color, PALEST)]
    numbers = [str(k + 1) for k in chosen]
    figure, panels = _stacked(rows, unit, numbers, "number of the ellipsoid", beside=0.3, over=third)
    for panel in panels:
        panel.set_yticks(panel.get_yticks(), ["before", "after"])
        panel.tick_params(axis="y", length=0)
    dashed = Line2D([], [], color=REFERENCE.color, lw=1.1, ls=DASHES, label=goal)
    legend_of_names(figure, [*(row.patch() for row in rows), dashed])
    return laid_out(figure)


class _Row(NamedTuple):
    """Ellipsoids (n, d, d) that stand beside one another, and how they look."""

    name: str
    points: Array
    color: str
    fill: float

    def patch(self) -> Patch:
        """Make a patch for the legend that looks like the ellipses."""
        return Patch(facecolor=(self.color, self.fill), edgecolor=self.color, linewidth=0.9, label=self.name)


def _stacked(
    rows: Sequence[_Row], unit: str, labels: Sequence[str], axis: str, beside: float = 0.25, over: Array | None = None
) -> tuple[Figure, list[Axes]]:
    """Draw rows below one another, once in each view, of one scale; `over` as dashed outlines upon every row."""
    points = [*(row.points for row in rows), *([] if over is None else [over])]
    reach = float(np.sqrt(max(np.diagonal(one, axis1=1, axis2=2).max() for one in points)))
    if reach == 0:
        raise InvalidInputError("there must be an ellipsoid of positive size to draw; all are zero")
    pitch, views = 2.15 * reach, VIEWS[points[0].shape[-1]]
    places = max(len(labels), 6)  # room for the words above a row of few ellipsoids
    figure = column_figure(0.55 + len(views) * (len(rows) * 3.2 / places + beside))
    panels = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    heights = -pitch * np.arange(len(rows))
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for row, height in zip(rows, heights, strict=True):
            _row_of_ellipses(panel, row.points[:, plane][:, :, plane], pitch, height, row.color, row.fill)
            if over is not None:
                _row_of_ellipses(panel, over[:, plane][:, :, plane], pitch, height, REFERENCE.color, None)
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), yticks=heights)
        panel.set_ylim(-(len(rows) - 0.5) * pitch, 0.5 * pitch)
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
    every = -(-len(labels) // 15)  # more labels would run into each other
    panels[-1].set_xticks(np.arange(0, len(labels), every) * pitch, labels[::every])
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    _scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    return figure, panels


def _frames(time: Array, count: int) -> NDArray[np.intp]:
    """Indices of at most `count` frames, the first and the last among them, evenly in time without its gaps."""
    steps = np.diff(time)
    recorded = np.append(0.0, np.cumsum(np.where(is_gap(steps), 0.0, steps)))
    evenly = np.linspace(0.0, recorded[-1], min(count, len(time)))
    frames = np.unique(np.argmin(np.abs(recorded[:, None] - evenly), axis=0))
    frames[-1] = len(time) - 1
    return frames


def _row_of_ellipses(panel: Axes, blocks: Array, pitch: float, height: float, color: str, fill: float | None) -> None:
    """Draw 2×2 matrices as ellipses in a row: filled with some opacity, with a stroke along the major axis of each."""
    semi_axes, directions = axes(blocks)
    for k, (minor, major) in enumerate(semi_axes):
        center, along = np.array([k * pitch, height]), directions[k, :, 1]
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        outline = Ellipse(tuple(center), 2 * major, 2 * minor, angle=angle, edgecolor=color)
        if fill is None:
            outline.set(facecolor="none", linewidth=1.1, linestyle=DASHES)
        else:
            outline.set(facecolor=(color, fill), linewidth=0.9)
            panel.plot(*np.stack([center - major * along, center + major * along]).T, color=color, lw=0.5)
        panel.add_patch(outline)


def _scale_bar(panel: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    height = 0.62 * pitch
    panel.plot([right - length, right], [height, height], color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    panel.text(right - length - 0.1 * pitch, height, f"{length:g} {unit}", fontsize=TEXT, ha="right", va="center")
