"""Ellipsoids before and after the transfer, laid over those that they should become, from above and from the front."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.telling.figures.ellipsoid_rows import DARKEST, PALEST, VIEWS, filled, row_of_ellipses, scale_bar
from maniport.telling.figures.style import COLORS, TEXT, UNIT, check_profiles, column_figure, laid_out, legend_of_names
from maniport.validation import Array, as_count

DASHES = (0, (1.6, 1.1))
"""Of the truth: short enough for small ellipses."""

NAMES = ("teacher", "adapted", "truth")


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
        for height, points, color, fill in ((0.0, first, COLORS[0], DARKEST), (-pitch, second, COLORS[1], PALEST)):
            row_of_ellipses(panel, _shadow(points, plane), pitch, height, color, fill)
            _dashed_row(panel, _shadow(third, plane), pitch, height, COLORS[2])
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), ylim=(-1.5 * pitch, 0.5 * pitch))
        panel.set_yticks([0.0, -pitch], ["before", "after"])
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
        panel.tick_params(axis="y", length=0)
    every = -(-len(chosen) // 15)  # more labels would run into each other
    panels[-1].set_xticks(np.arange(0, len(chosen), every) * pitch, [str(i + 1) for i in chosen[::every]])
    panels[-1].set_xlabel("number of the ellipsoid", fontsize=TEXT)
    scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    before, after, wanted = checked
    truth_line = Line2D([], [], color=COLORS[2], lw=1.1, ls=DASHES, label=wanted)
    legend_of_names(figure, [filled(before, COLORS[0], DARKEST), filled(after, COLORS[1], PALEST), truth_line])
    return laid_out(figure)


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
