"""Rows of ellipsoids along a motion: what it looks like before and after the transfer."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Patch
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.telling.figures.style import (
    COLORS,
    TEXT,
    UNIT,
    check_profiles,
    column_figure,
    is_gap,
    laid_out,
    legend_of_names,
)
from maniport.validation import Array, as_count

DARKEST, PALEST = 0.45, 0.1
"""Opacities that the first and the last row are filled with, so that they differ in grey too."""

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
) -> Figure:
    """Draw ellipsoids sampled along time, one row for each profile, seen from above and from the front.

    The view along an axis shows the shadow of the ellipsoid xᵀ M⁻¹ x = 1 on the plane of the other two: the ellipse
    of the 2×2 block of M that belongs to them. All ellipsoids have the same scale. For d = 2 there is one view.

    Parameters
    ----------
    time : array_like, shape (n,)
        Ascending [s]; may have gaps.
    profiles : mapping of str to array_like, shape (n, d, d)
        Ellipsoids, d = 2 or 3, of semi-axes in `unit`.
    count : int
        How many ellipsoids to draw a row, at most; they lie evenly in time, gaps left out.
    unit : str
        Of the semi-axes, for the scale bar.
    axis : str
        Name of what `time` is, where it is something else.
    """
    times, checked = check_profiles(time, profiles)
    frames = _frames(times, as_count(count, "count"))
    drawn = {name: points[frames] for name, points in checked.items()}
    d = next(iter(drawn.values())).shape[-1]
    views = VIEWS[d]
    reach = max(float(np.sqrt(np.diagonal(points, axis1=1, axis2=2).max())) for points in drawn.values())
    if reach == 0:
        raise InvalidInputError("profiles must have an ellipsoid of positive size to draw; all are zero")
    pitch = 2.15 * reach
    places = max(len(frames), 6)  # room for the words above a row of few ellipsoids
    row_height = 3.2 / places
    figure = column_figure(0.55 + len(views) * (len(drawn) * row_height + 0.25))
    panels = figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0]
    fills = np.linspace(DARKEST, PALEST, len(drawn)) if len(drawn) > 1 else np.array([DARKEST])
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for row, (points, fill) in enumerate(zip(drawn.values(), fills, strict=True)):
            row_of_ellipses(panel, points[:, plane][:, :, plane], pitch, -row * pitch, COLORS[row], fill)
        panel.set(aspect="equal", yticks=[], xlim=(-0.5 * pitch, (places - 0.5) * pitch))
        panel.set_ylim(-(len(drawn) - 0.5) * pitch, 0.5 * pitch)
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
    decimals = max(0, 1 - int(np.floor(np.log10(np.ptp(times) / len(frames) or 1.0))))
    every = -(-len(frames) // 15)  # more labels would run into each other
    ticks = np.arange(0, len(frames), every)
    panels[-1].set_xticks(ticks * pitch, [f"{t:.{decimals}f}" for t in times[frames[ticks]]])
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    legend_of_names(figure, [filled(name, *look) for name, *look in zip(drawn, COLORS, fills, strict=False)])
    return laid_out(figure)


def _frames(time: Array, count: int) -> NDArray[np.intp]:
    """Indices of at most `count` frames, the first and the last among them, evenly in time without its gaps."""
    steps = np.diff(time)
    recorded = np.append(0.0, np.cumsum(np.where(is_gap(steps), 0.0, steps)))
    wanted = np.linspace(0.0, recorded[-1], min(count, len(time)))
    frames = np.unique(np.argmin(np.abs(recorded[:, None] - wanted), axis=0))
    frames[-1] = len(time) - 1
    return frames


def filled(name: str, color: str, fill: float) -> Patch:
    """Make a patch for the legend that looks like the ellipses of a row."""
    return Patch(facecolor=(color, fill), edgecolor=color, linewidth=0.9, label=name)


def row_of_ellipses(panel: Axes, blocks: Array, pitch: float, height: float, color: str, fill: float) -> None:
    """Draw 2×2 matrices as ellipses in a row, filled with some opacity, each with a stroke along its major axis."""
    semi_axes, directions = axes(blocks)
    for k in range(len(blocks)):
        center = np.array([k * pitch, height])
        major = directions[k, :, 1]
        angle = float(np.degrees(np.arctan2(major[1], major[0])))
        outline = Ellipse(tuple(center), 2 * semi_axes[k, 1], 2 * semi_axes[k, 0], angle=angle)
        outline.set(facecolor=(color, fill), edgecolor=color, linewidth=0.9)
        panel.add_patch(outline)
        ends = np.stack([center - semi_axes[k, 1] * major, center + semi_axes[k, 1] * major])
        panel.plot(*ends.T, color=color, lw=0.5)


def scale_bar(panel: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    height = 0.62 * pitch
    panel.plot([right - length, right], [height, height], color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    panel.text(right - length - 0.1 * pitch, height, f"{length:g} {unit}", fontsize=TEXT, ha="right", va="center")
