"""Over time: the numbers of a profile, how well a robot follows, and its joints within their limits."""

from collections.abc import Mapping

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
    """Draw semi-axes, directions of the major and the minor axis, volume and condition number over time.

    Directions are shown as the components of a unit vector, whose sign is kept continuous along the motion (an axis
    has none of its own) and agrees between the profiles. Where two axes have almost equal lengths there is no
    direction, and the line breaks; so do all lines where time jumps.

    Parameters
    ----------
    time, profiles, unit, roles
        As in `ellipsoids`.
    """
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
    """Draw the distance of target and achieved ellipsoids, the hand's error, and every joint between its limits.

    Parameters
    ----------
    time : array_like, shape (n,)
        Ascending [s].
    distance : array_like, shape (n,)
        Affine-invariant distance.
    joints : mapping of str to array_like, shape (n,)
        Joint positions [rad or m].
    limits : mapping of str to (float, float)
        Under the same names; grey beyond them.
    position_error : array_like, shape (n,), optional
        Distance of the tip from its path [m]; drawn in millimetres.
    units : mapping of str to str, optional
        Units of the joints, rad by default.
    """
    times = as_times(time)
    curves = [("distance of target and achieved ellipsoids", _like(times, distance, "distance"), ACHIEVED.color)]
    if position_error is not None:
        curves.append(
            ("tip beside its path [mm]", 1e3 * _like(times, position_error, "position_error"), ACHIEVED.color)
        )
    if not joints or set(joints) - set(limits):
        raise InvalidInputError(f"limits must name every joint; found joints {list(joints)}, limits {list(limits)}")
    count = len(curves) + len(joints)
    figure = column_figure(0.4 + 0.62 * count)
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for panel, (title, values, color) in zip(panels, curves, strict=False):
        panel.plot(*with_breaks(times, values), color=color, lw=1.0)
        panel.set_title(title, fontsize=TEXT, loc="left", pad=2)
        panel.set_ylim(bottom=0.0)
    for panel, (name, positions) in zip(panels[len(curves) :], joints.items(), strict=True):
        panel.plot(*with_breaks(times, _like(times, positions, f"joints[{name!r}]")), color=ACHIEVED.color, lw=1.0)
        panel.set_title(f"{name} [{(units or {}).get(name, 'rad')}]", fontsize=TEXT, loc="left", pad=2)
        if np.all(np.isfinite(limits[name])):
            _between(panel, *limits[name])
    dress_over_time(list(panels))
    return laid_out(figure)


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
