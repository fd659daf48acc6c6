"""The look that figures share, and curves over time."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.report.page.content import Panel, is_gap
from maniport.report.roles import ACHIEVED, OTHERS, PERSON, ROLES, TARGET
from maniport.spd.ellipsoid import lengths
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_positive_semidefinite, as_times, require_shape

COLORS = (PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)

UNIT = "m/s per rad/s"  # Unit of the semi-axes of velocity ellipsoids J Jᵀ of revolute joints

LINE_STYLES = ("-", "--", ":")

TEXT = 7.0  # Size of letters [pt], in a figure that is printed as wide as it is made

COLUMN = 3.5  # Width of a figure [in]: one column of a two-column paper


def curves(
    time: ArrayLike, profiles: Mapping[str, ArrayLike], unit: str = UNIT, roles: Mapping[str, str] | None = None
) -> Figure:
    """Draw the semi-axes of profiles (n, d, d) over time [s], and their condition number."""
    times = as_times(time)
    checked = check_profiles(profiles, len(times))
    d = next(iter(checked.values())).shape[-1]
    figure = column_figure(3.0)
    upper, lower = axes = list(figure.subplots(2, 1, sharex=True))
    handles = []
    for color, (name, points) in zip(colors_of(checked, roles), checked.items(), strict=True):
        semi_axes = lengths(points)[:, ::-1]
        flat = semi_axes[:, -1] ** 2 <= SPD_TOLERANCE * np.trace(points, axis1=1, axis2=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.where(flat, np.nan, (semi_axes[:, 0] / semi_axes[:, -1]) ** 2)
        for column, style in zip(semi_axes.T, LINE_STYLES, strict=False):
            upper.plot(*with_breaks(times, column), color=color, ls=style, lw=1.0)
        lower.plot(*with_breaks(times, condition), color=color, lw=1.0)
        handles.append(Line2D([], [], color=color, lw=1.0, label=name))
    upper.set(ylim=(0.0, None))
    upper.set_title(f"semi-axes [{unit}]", fontsize=TEXT, loc="left", pad=3)
    lower.set_title("condition number, (longest / shortest)²", fontsize=TEXT, loc="left", pad=3)
    logarithmic(lower)
    names = ("longest", "middle", "shortest") if d == 3 else ("longest", "shortest")
    styles = [Line2D([], [], color="0.3", ls=s, lw=1.0, label=n) for s, n in zip(LINE_STYLES, names, strict=False)]
    upper.legend(handles=styles, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize=TEXT,
                 frameon=False, borderaxespad=0.0)  # fmt: skip
    dress_over_time(axes)
    legend(figure, handles)
    return laid_out(figure)


def panel_figure(time: Array, panels: Sequence[Panel], columns: int = 1) -> Figure:
    """Draw panels of a page: lines over time [s], with limits shaded."""
    count = -(-len(panels) // columns)
    figure = column_figure(0.4 + 0.62 * count, columns)
    grid = figure.subplots(count, columns, sharex=True, squeeze=False)
    axes = list(grid.ravel())
    for one, panel in zip(axes, panels, strict=False):
        for line in panel.lines:
            look = {"color": ROLES[line.role].color, "ls": LINE_STYLES[line.style], "lw": 3.0 if line.wide else 1.0}
            one.plot(*with_breaks(time, line.values), alpha=0.35 if line.wide else 1.0, label=line.name, **look)
        one.set_title(f"{panel.title} [{panel.unit}]" if panel.unit else panel.title, fontsize=TEXT, loc="left", pad=2)
        if panel.limits is not None and panel.span is not None:
            for ends in zip(panel.limits, panel.span, strict=True):
                one.axhspan(*ends, color="0.85", lw=0)
            one.set_ylim(*panel.span)
        elif panel.logarithmic:
            logarithmic(one)
    for one in axes[len(panels) :]:
        one.set_visible(False)
    for column in grid.T:
        dress_over_time([one for one in column if one.get_visible()])
    return laid_out(figure)


def colors_of(names: Iterable[str], roles: Mapping[str, str] | None) -> list[str]:
    """Return the color of each name: of its role, else the next that no role has taken."""
    given = {name: ROLES[as_choice(role, "role", tuple(ROLES))].color for name, role in (roles or {}).items()}
    free = iter([color for color in COLORS if color not in given.values()])
    return [given[name] if name in given else next(free) for name in names]


def column_figure(height: float, columns: int = 1, layout: Any = "constrained") -> Figure:
    """Return an empty figure of column width; `height` in inches."""
    return Figure(figsize=(columns * COLUMN, height), dpi=300, layout=layout)


def laid_out(figure: Figure) -> Figure:
    """Compute the layout once, so that all files of the figure are alike."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    return figure


def logarithmic(panel: Axes) -> None:
    """Use a logarithmic axis with few, plain numbers."""
    if not any(np.nanmax(line.get_ydata(), initial=0.0) > 0.0 for line in panel.lines):
        return  # of flat ellipsoids there is nothing to draw
    panel.set_yscale("log")
    low, high = panel.get_ylim()
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)))
    panel.yaxis.set_major_formatter("{x:g}")
    panel.yaxis.set_minor_formatter(NullFormatter())


def dress_over_time(panels: Sequence[Axes]) -> None:
    """Label the time below the last of stacked panels."""
    panels[-1].set_xlabel("time [s]", fontsize=TEXT)
    panels[-1].xaxis.set_tick_params(labelbottom=True)
    for panel in panels:
        panel.tick_params(labelsize=TEXT, length=2)
        panel.grid(alpha=0.25, lw=0.5)
        panel.margins(x=0.01)


def check_profiles(profiles: Mapping[str, ArrayLike], count: int | None = None) -> dict[str, Array]:
    """Check named profiles (n, d, d) of equal length; d is 2 or 3, the same in all."""
    checked: dict[str, Array] = {}
    for name, profile in check_names(profiles, "profiles").items():
        where = f"profiles[{name!r}]"
        points = as_positive_semidefinite(profile, where)
        count, d = len(points) if count is None else count, points.shape[-1]
        require_shape(points, where, (count, "d", "d"))
        if d not in (2, 3) or any(d != other.shape[-1] for other in checked.values()):
            raise InvalidInputError(f"profiles must all hold 2×2 or all 3×3 matrices; found {d}×{d} in {where}")
        checked[name] = points
    return checked


def check_names(sets: Mapping[str, ArrayLike], argument: str) -> Mapping[str, ArrayLike]:
    """Require one to seven named arrays: there are seven colors."""
    if not isinstance(sets, Mapping) or not 1 <= len(sets) <= len(COLORS):
        found = len(sets) if isinstance(sets, Mapping) else type(sets).__name__
        raise InvalidInputError(f"{argument} must be a mapping of 1 to {len(COLORS)} names to arrays; found {found}")
    return sets


def with_breaks(time: Array, values: Array) -> tuple[Array, Array]:
    """Insert nan at gaps in time, so that lines break there."""
    jumps = np.flatnonzero(is_gap(np.diff(time))) + 1
    return np.insert(time, jumps, time[jumps - 1]), np.insert(values, jumps, np.nan, axis=0)


def legend(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put named lines or patches above all panels."""
    letters = [len(str(handle.get_label())) for handle in handles]
    columns = len(handles) if sum(letters) < 45 else 2 if max(letters) < 30 else 1
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False)
