"""Rows of ellipsoids along a motion: before and after the transfer, or over those that they should become."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.telling.figures.style import (
    TEXT,
    UNIT,
    check_profiles,
    colors_of,
    column_figure,
    is_gap,
    laid_out,
    legend_of_names,
)
from maniport.telling.roles import PERSON, REFERENCE, TARGET
from maniport.validation import Array, as_count

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
    roles : mapping of str to str, optional
        Whose each is, by its name: person, target, achieved or reference, which have their colours.
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
    colors = [color for color, _ in colors_of(drawn, roles)]
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for row, (points, fill) in enumerate(zip(drawn.values(), fills, strict=True)):
            _row_of_ellipses(panel, points[:, plane][:, :, plane], pitch, -row * pitch, colors[row], fill)
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
    _scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    legend_of_names(figure, [_filled(name, *look) for name, *look in zip(drawn, colors, fills, strict=True)])
    return laid_out(figure)


def ellipsoid_views(
    teacher: ArrayLike,
    adapted: ArrayLike,
    truth: ArrayLike,
    names: Sequence[str] = NAMES,
    count: int = 9,
    unit: str = UNIT,
) -> Figure:
    """Draw what the teacher shows, and below it what the adapter makes of it, each under what the student should make.

    Each view shows the shadow of the ellipsoid xᵀ M⁻¹ x = 1 on its plane, as `ellipsoids` does. Where a map is right,
    the dashed outlines of the truth lie on those of the lower row.

    Parameters
    ----------
    teacher, adapted, truth : array_like, shape (n, 3, 3)
        In the same order; semi-axes in `unit`.
    names : sequence of three str
        For the legend.
    count : int
        How many ellipsoids to draw a row, at most; evenly over their order.
    unit : str
        For the scale bar.
    """
    if len(tuple(names)) != 3 or len(set(names)) != 3:
        raise InvalidInputError(f"names must be three different words; found {names!r}")
    sets = dict(zip(names, (teacher, adapted, truth), strict=True))
    _, checked = check_profiles(np.arange(len(np.atleast_1d(teacher))), sets)
    if next(iter(checked.values())).shape[-1] != 3:
        raise InvalidInputError("ellipsoids must be 3×3 to be seen from two sides; found 2×2")
    total = len(next(iter(checked.values())))
    chosen = np.unique(np.linspace(0, total - 1, min(as_count(count, "count"), total)).round().astype(int))
    first, second, third = (points[chosen] for points in checked.values())
    reach = float(np.sqrt(max(np.diagonal(x, axis1=1, axis2=2).max() for x in (first, second, third))))
    if reach == 0:
        raise InvalidInputError("teacher, adapted or truth must have an ellipsoid of positive size; all are zero")
    pitch = 2.15 * reach
    places = max(len(chosen), 6)  # room for the words above a row of few ellipsoids
    figure = column_figure(0.55 + 2 * (2 * 3.2 / places + 0.3))
    panels = figure.subplots(2, 1, sharex=True)
    for panel, (view, plane) in zip(panels, VIEWS[3].items(), strict=True):
        for height, points, color, fill in (
            (0.0, first, PERSON.color, DARKEST),
            (-pitch, second, TARGET.color, PALEST),
        ):
            _row_of_ellipses(panel, _shadow(points, plane), pitch, height, color, fill)
            _dashed_row(panel, _shadow(third, plane), pitch, height, REFERENCE.color)
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), ylim=(-1.5 * pitch, 0.5 * pitch))
        panel.set_yticks([0.0, -pitch], ["before", "after"])
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
        panel.tick_params(axis="y", length=0)
    every = -(-len(chosen) // 15)  # more labels would run into each other
    panels[-1].set_xticks(np.arange(0, len(chosen), every) * pitch, [str(i + 1) for i in chosen[::every]])
    panels[-1].set_xlabel("number of the ellipsoid", fontsize=TEXT)
    _scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    before, after, goal = checked
    truth_line = Line2D([], [], color=REFERENCE.color, lw=1.1, ls=DASHES, label=goal)
    legend_of_names(figure, [_filled(before, PERSON.color, DARKEST), _filled(after, TARGET.color, PALEST), truth_line])
    return laid_out(figure)


def _frames(time: Array, count: int) -> NDArray[np.intp]:
    """Indices of at most `count` frames, the first and the last among them, evenly in time without its gaps."""
    steps = np.diff(time)
    recorded = np.append(0.0, np.cumsum(np.where(is_gap(steps), 0.0, steps)))
    evenly = np.linspace(0.0, recorded[-1], min(count, len(time)))
    frames = np.unique(np.argmin(np.abs(recorded[:, None] - evenly), axis=0))
    frames[-1] = len(time) - 1
    return frames


def _filled(name: str, color: str, fill: float) -> Patch:
    """Make a patch for the legend that looks like the ellipses of a row."""
    return Patch(facecolor=(color, fill), edgecolor=color, linewidth=0.9, label=name)


def _row_of_ellipses(panel: Axes, blocks: Array, pitch: float, height: float, color: str, fill: float) -> None:
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


def _scale_bar(panel: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    height = 0.62 * pitch
    panel.plot([right - length, right], [height, height], color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    panel.text(right - length - 0.1 * pitch, height, f"{length:g} {unit}", fontsize=TEXT, ha="right", va="center")


def _dashed_row(panel: Axes, blocks: Array, pitch: float, height: float, color: str) -> None:
    """Draw 2×2 matrices as dashed outlines in a row, so that what lies below them is seen."""
    semi_axes, directions = axes(blocks)
    for k, (minor, major) in enumerate(semi_axes):
        angle = float(np.degrees(np.arctan2(*directions[k, ::-1, 1])))
        outline = Ellipse((k * pitch, height), 2 * major, 2 * minor, angle=angle)
        outline.set(facecolor="none", edgecolor=color, linewidth=1.1, linestyle=DASHES)
        panel.add_patch(outline)


def _shadow(points: Array, plane: list[int]) -> Array:
    return np.asarray(points[:, plane][:, :, plane])
