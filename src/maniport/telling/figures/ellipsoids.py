"""Rows of ellipsoids along a motion."""

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
from maniport.telling.figures.curves import TEXT, UNIT, check_profiles, colors_of, column_figure, laid_out, legend
from maniport.telling.roles import PERSON, REFERENCE, TARGET
from maniport.telling.series import is_gap
from maniport.validation import Array, as_count, as_times

DASHES = (0, (1.6, 1.1))

VIEWS = {
    2: {"in the plane (x right, y up)": [0, 1]},
    3: {"from above (x right, y up)": [0, 1], "from the front (y right, z up)": [1, 2]},
}
"""Titles of the views, and the coordinates to the right and up."""


class _Row(NamedTuple):
    """Ellipsoids (n, d, d) in a row, filled with some opacity; None draws dashed outlines over all rows."""

    name: str
    points: Array
    color: str
    fill: float | None


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
    fills = np.linspace(0.45, 0.1, len(checked)).tolist()  # rows differ in grey, too
    colors = [color for color, _ in colors_of(checked, roles)]
    rows = [_Row(*row) for row in zip(checked, (x[frames] for x in checked.values()), colors, fills, strict=True)]
    decimals = max(0, 1 - int(np.floor(np.log10(np.ptp(times) / len(frames) or 1.0))))
    return _stacked(rows, unit, [f"{t:.{decimals}f}" for t in times[frames]], axis)


def ellipsoid_views(
    teacher: ArrayLike,
    adapted: ArrayLike,
    truth: ArrayLike,
    names: Sequence[str] = ("teacher", "adapted", "truth"),
    count: int = 9,
    unit: str = UNIT,
) -> Figure:
    """Draw ellipsoids of the teacher and, below, the adapted ones, with the truth as dashed outlines."""
    if len(tuple(names)) != 3 or len(set(names)) != 3:
        raise InvalidInputError(f"names must be three different words; found {names!r}")
    checked = check_profiles(dict(zip(names, (teacher, adapted, truth), strict=True)))
    total, d, _ = next(iter(checked.values())).shape
    if d != 3:
        raise InvalidInputError("ellipsoids must be 3×3 to be seen from two sides; found 2×2")
    chosen = evenly_spaced(total, as_count(count, "count"))
    looks = (PERSON.color, 0.45), (TARGET.color, 0.1), (REFERENCE.color, None)
    rows = [_Row(name, points[chosen], *look) for (name, points), look in zip(checked.items(), looks, strict=True)]
    return _stacked(rows, unit, [str(k + 1) for k in chosen], "number of the ellipsoid")


def _stacked(rows: Sequence[_Row], unit: str, labels: Sequence[str], axis: str) -> Figure:
    """Draw rows below one another, once in each view, with one scale."""
    reach = float(np.sqrt(max(np.diagonal(row.points, axis1=1, axis2=2).max() for row in rows)))
    if reach == 0:
        raise InvalidInputError("there must be an ellipsoid of positive size to draw; all are zero")
    filled, over = [row for row in rows if row.fill is not None], [row for row in rows if row.fill is None]
    pitch, views = 2.15 * reach, VIEWS[rows[0].points.shape[-1]]
    places = max(len(labels), 6)  # space for the title of a row of few ellipsoids
    figure = column_figure(0.55 + len(views) * (len(filled) * 3.2 / places + 0.3))
    panels = list(figure.subplots(len(views), 1, sharex=True, squeeze=False)[:, 0])
    for panel, (view, plane) in zip(panels, views.items(), strict=True):
        for number, row in enumerate(filled):
            for drawn in (row, *over):
                _row(panel, drawn, drawn.points[:, plane][:, :, plane], pitch, -pitch * number)
        panel.set(aspect="equal", xlim=(-0.5 * pitch, (places - 0.5) * pitch), yticks=[])
        panel.set_ylim(-(len(filled) - 0.5) * pitch, 0.5 * pitch)
        panel.set_title(view, fontsize=TEXT, loc="left", pad=2)
        panel.spines[["left", "right", "top"]].set_visible(False)
        panel.tick_params(labelsize=TEXT, length=2)
    every = -(-len(labels) // 15)  # more labels would overlap
    panels[-1].set_xticks(np.arange(0, len(labels), every) * pitch, labels[::every])
    panels[-1].set_xlabel(axis, fontsize=TEXT)
    _scale_bar(panels[0], reach, pitch, (places - 0.5) * pitch, unit)
    handles = [Patch(facecolor=(row.color, row.fill), edgecolor=row.color, linewidth=0.9, label=row.name)
               for row in filled if row.fill is not None]  # fmt: skip
    legend(figure, [*handles, *(Line2D([], [], color=row.color, lw=1.1, ls=DASHES, label=row.name) for row in over)])
    return laid_out(figure)


def _frames(time: Array, count: int) -> NDArray[np.intp]:
    """Indices of at most `count` frames, the first and the last among them, evenly_spaced in time without its gaps."""
    steps = np.diff(time)
    recorded = np.append(0.0, np.cumsum(np.where(is_gap(steps), 0.0, steps)))
    wanted = np.linspace(0.0, recorded[-1], min(count, len(time)))
    frames = np.unique(np.argmin(np.abs(recorded[:, None] - wanted), axis=0))
    frames[-1] = len(time) - 1
    return frames


def _row(panel: Axes, row: _Row, blocks: Array, pitch: float, height: float) -> None:
    """Draw 2×2 matrices as ellipses in a row, with a stroke along the longest axis of filled ones."""
    semi_axes, directions = axes(blocks)
    for k, (minor, major) in enumerate(semi_axes):
        center, along = np.array([k * pitch, height]), directions[k, :, 1]
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        outline = Ellipse(tuple(center), 2 * major, 2 * minor, angle=angle, edgecolor=row.color)
        if row.fill is None:
            outline.set(facecolor="none", linewidth=1.1, linestyle=DASHES)
        else:
            outline.set(facecolor=(row.color, row.fill), linewidth=0.9)
            panel.plot(*np.stack([center - major * along, center + major * along]).T, color=row.color, lw=0.5)
        panel.add_patch(outline)


def _scale_bar(panel: Axes, reach: float, pitch: float, right: float, unit: str) -> None:
    """Draw a bar of round length above the right end of the first row."""
    power = 10.0 ** np.floor(np.log10(reach))
    length = power * max((m for m in (1, 2, 5) if m * power <= reach), default=1)
    height = 0.62 * pitch
    panel.plot([right - length, right], [height, height], color="black", lw=1.5, clip_on=False, solid_capstyle="butt")
    panel.text(right - length - 0.1 * pitch, height, f"{length:g} {unit}", fontsize=TEXT, ha="right", va="center")
