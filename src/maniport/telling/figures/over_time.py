"""Over time: the numbers of a profile, how well a robot follows, and its joints within their limits."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import ScaledTranslation
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.telling.course import courses
from maniport.telling.figures.style import (
    LINE_STYLES,
    TEXT,
    UNIT,
    check_profiles,
    colors_of,
    column_figure,
    dress_over_time,
    laid_out,
    legend_of_names,
    line_widths,
    with_breaks,
)
from maniport.telling.roles import ACHIEVED
from maniport.validation import Array, as_finite, as_times, require_shape

NUMBERS = 0.4
"""Room for the numbers left of a panel [in]: five digits."""


def curves(
    time: ArrayLike, profiles: Mapping[str, ArrayLike], unit: str = UNIT, roles: Mapping[str, str] | None = None
) -> Figure:
    """Draw semi-axes, directions of the major and the minor axis, volume and condition number over time."""
    times = as_times(time)
    checked = check_profiles(profiles, len(times))
    d = next(iter(checked.values())).shape[-1]
    figure = column_figure(6.3)
    panels = figure.subplots(5, 1, sharex=True)
    order = ("major", "middle", "minor") if d == 3 else ("major", "minor")
    titles = ("semi-axes", "direction of the major axis", "direction of the minor axis")
    widths = line_widths(len(checked))
    colors = [color for color, _ in colors_of(checked, roles)]
    for color, width, one in zip(colors, widths, courses(checked).values(), strict=True):
        drawn = one.semi_axes[:, ::-1], one.longest, one.shortest, one.volume[:, None], one.condition[:, None]
        for panel, values in zip(panels, drawn, strict=True):
            _lines(panel, times, values, color, width)
    for panel, title, names in zip(panels, titles, (order, "xyz"[:d], "xyz"[:d]), strict=False):
        panel.set_title(title, fontsize=TEXT, loc="left", pad=3)
        _legend_of_line_styles(panel, names)
    panels[0].set_ylabel(f"length\n[{unit}]", fontsize=TEXT)
    panels[0].set_ylim(bottom=0)
    for panel in panels[1:3]:
        panel.set(ylim=(-1.05, 1.05), yticks=[-1, 0, 1])
        panel.set_ylabel("component", fontsize=TEXT)
    _logarithmic(panels[3], "volume" if d == 3 else "area", f"[({unit}){'³' if d == 3 else '²'}]")
    _logarithmic(panels[4], "condition number", "(major / minor)²")
    dress_over_time(panels)
    # left of the longest number: Figure.align_ylabels finds this place too, but doubles the time to draw
    beside = ScaledTranslation(-NUMBERS, 0.0, figure.dpi_scale_trans)
    for panel in panels:
        panel.yaxis.set_label_coords(0.0, 0.5, panel.transAxes + beside)
    handles = [Line2D([], [], color=c, lw=w, label=name) for c, w, name in zip(colors, widths, checked, strict=True)]
    legend_of_names(figure, handles)
    return laid_out(figure)


def motion(
    time: ArrayLike,
    distance: ArrayLike,
    joints: Mapping[str, ArrayLike],
    limits: Mapping[str, tuple[float, float]],
    position_error: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the distance of target and achieved ellipsoids, the hand's error, and every joint between its limits."""
    return motions(time, {"": (distance, joints, limits, position_error, units)})


def motions(time: ArrayLike, arms: Mapping[str, tuple[Any, ...]]) -> Figure:
    """Draw the same of several arms, each in a column."""
    times = as_times(time)
    columns = [_rows(times, name, *arm) for name, arm in arms.items()]
    count = max(map(len, columns))
    figure = column_figure(0.4 + 0.62 * count, len(columns))
    panels = figure.subplots(count, len(columns), sharex=True, squeeze=False)
    for column, rows in zip(panels.T, columns, strict=True):
        for panel, (title, values, limits) in zip(column, rows, strict=False):
            panel.plot(*with_breaks(times, values), color=ACHIEVED.color, lw=1.0)
            panel.set_title(title, fontsize=TEXT, loc="left", pad=2)
            if limits is None:
                panel.set_ylim(bottom=0.0)
            elif np.all(np.isfinite(limits)):
                _between(panel, *limits)
        for panel in column[len(rows) :]:
            panel.set_visible(False)
        column[len(rows) - 1].xaxis.set_tick_params(labelbottom=True)
        dress_over_time(list(column[: len(rows)]))
    for beside, alike in zip(panels, zip(*columns, strict=False), strict=False):
        if all(limits is None for _, _, limits in alike):
            top = max(panel.get_ylim()[1] for panel in beside)
            for panel in beside:
                panel.set_ylim(0.0, top)
    return laid_out(figure)


def _rows(
    time: Array,
    name: str,
    distance: ArrayLike,
    joints: Mapping[str, ArrayLike],
    limits: Mapping[str, tuple[float, float]],
    position_error: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> list[tuple[str, Array, tuple[float, float] | None]]:
    """Titles, values and, of joints, limits of what is drawn of an arm."""
    if not joints or set(joints) - set(limits):
        raise InvalidInputError(f"limits must name every joint; found joints {list(joints)}, limits {list(limits)}")
    whose = f"{name}: " if name else ""
    title = f"{whose}distance of target and achieved ellipsoids"
    rows: list[tuple[str, Array, tuple[float, float] | None]] = [(title, _like(time, distance, "distance"), None)]
    if position_error is not None:
        error = 1e3 * _like(time, position_error, "position_error")
        rows.append((f"{whose}tip beside its path [mm]", error, None))
    for joint, positions in joints.items():
        unit, factor = (units or {}).get(joint, "rad"), 1.0
        if unit == "rad":
            unit, factor = "°", 180.0 / np.pi
        low, high = limits[joint]
        values = factor * _like(time, positions, f"joints[{joint!r}]")
        rows.append((f"{joint} [{unit}]", values, (factor * low, factor * high)))
    return rows


def _lines(panel: Axes, time: Array, values: Array, color: str, width: float) -> None:
    """Draw the columns of values in one colour and several line styles, broken where time jumps."""
    times, broken = with_breaks(time, values)
    for column, style in zip(broken.T, LINE_STYLES, strict=False):
        panel.plot(times, column, color=color, ls=style, lw=width)


def _legend_of_line_styles(panel: Axes, names: tuple[str, ...] | str) -> None:
    handles = [Line2D([], [], color="0.3", ls=s, lw=1.0, label=n) for s, n in zip(LINE_STYLES, names, strict=False)]
    panel.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=TEXT, frameon=False,
        borderaxespad=0.0, handlelength=2.0, columnspacing=1.0,
    )  # fmt: skip


def _logarithmic(panel: Axes, title: str, label: str) -> None:
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.yaxis.set_minor_formatter(NullFormatter())
    panel.set_title(title, fontsize=TEXT, loc="left", pad=3)
    panel.set_ylabel(label, fontsize=TEXT)


def _between(panel: Axes, low: float, high: float) -> None:
    """Show a joint's limits, grey beyond them, with their numbers."""
    margin = 0.12 * (high - low)
    panel.set_ylim(low - margin, high + margin)
    for edge, beyond in ((low, low - margin), (high, high + margin)):
        panel.axhspan(edge, beyond, color="0.85", lw=0)
    decimals = max(0, 1 - int(np.floor(np.log10(high - low))))
    panel.set_yticks([low, (low + high) / 2, high])
    panel.yaxis.set_major_formatter(f"{{x:z.{decimals}f}}")


def _like(time: Array, values: ArrayLike, name: str) -> Array:
    array = as_finite(values, name)
    require_shape(array, name, time.shape, " as time")
    return array
