"""The look that the figures share, and what they all do with data over time."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.telling.course import is_gap
from maniport.telling.roles import ACHIEVED, OTHERS, OTHERS_PALE, PERSON, ROLES, TARGET
from maniport.validation import Array, as_choice, as_positive_semidefinite, require_shape

COLORS = (PERSON.color, TARGET.color, ACHIEVED.color, *OTHERS)
"""What names without a role get, in their order; the colour-blind can tell them apart."""

PALE = (PERSON.pale, TARGET.pale, ACHIEVED.pale, *OTHERS_PALE)
"""The same, lighter, for the clouds behind the lines."""

UNIT = "m/s per rad/s"
"""Of the semi-axes of velocity ellipsoids J Jᵀ of revolute joints: speed of the hand at unit joint speed."""

LINE_STYLES = ("-", "--", ":")

TEXT = 7.0
"""Size of letters [pt], in a figure that is printed as wide as it is made."""

WIDEST, THINNEST = 1.8, 0.8
"""Widths of the first and the last of several lines [pt]: equal ones show as rims, in grey as in colour."""

COLUMN = 3.5
"""Width of a figure [in]: one column of a two-column paper."""

RESOLUTION = 300
"""Of pixel files [dots per inch]."""


def colors_of(names: Iterable[str], roles: Mapping[str, str] | None) -> list[tuple[str, str]]:
    """Colour, and the pale one, of each name: those of its role, else the next that no role has taken."""
    given = {name: ROLES[as_choice(role, "role", tuple(ROLES))] for name, role in (roles or {}).items()}
    taken = {role.color for role in given.values()}
    free = iter([pair for pair in zip(COLORS, PALE, strict=True) if pair[0] not in taken])
    return [(given[name].color, given[name].pale) if name in given else next(free) for name in names]


def column_figure(height: float, columns: int = 1) -> Figure:
    """Make an empty figure of column width; `height` in inches. What is done with it ends with `laid_out`."""
    return Figure(figsize=(columns * COLUMN, height), dpi=RESOLUTION, layout="constrained")


def laid_out(figure: Figure) -> Figure:
    """Place the panels once and for all, so that all files of the figure are alike, whichever is written first."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    return figure


def line_widths(count: int) -> list[float]:
    """Widths [pt] of lines that are drawn in this order over one another; one alone is thin."""
    widths: list[float] = np.linspace(WIDEST, THINNEST, count).tolist()
    return widths if count > 1 else [THINNEST] * count


def dress_over_time(panels: Sequence[Axes]) -> None:
    """Name the time below the last of panels that stand above one another."""
    panels[-1].set_xlabel("time [s]", fontsize=TEXT)
    for panel in panels:
        panel.tick_params(labelsize=TEXT, length=2)
        panel.grid(alpha=0.25, lw=0.5)
        panel.margins(x=0.01)


def check_profiles(profiles: Mapping[str, ArrayLike], count: int | None = None) -> dict[str, Array]:
    """Check named profiles (n, d, d), of `count` ellipsoids or as many as the first; d is 2 or 3, the same in all."""
    checked: dict[str, Array] = {}
    for name, profile in check_names(profiles, "profiles").items():
        where = f"profiles[{name!r}]"
        points = as_positive_semidefinite(profile, where)
        count = len(points) if count is None else count
        require_shape(points, where, (count, "d", "d"))
        d = points.shape[-1]
        if d not in (2, 3):
            raise InvalidInputError(f"{where} must hold 2×2 or 3×3 matrices to be drawn; found {d}×{d}")
        checked[name] = points
    if len({points.shape[-1] for points in checked.values()}) > 1:
        found = ", ".join(f"{name!r} {points.shape}" for name, points in checked.items())
        raise InvalidInputError(f"profiles must have one dimension; found {found}")
    return checked


def check_names(sets: Mapping[str, ArrayLike], argument: str) -> Mapping[str, ArrayLike]:
    """Require one to seven named arrays: there are seven colours."""
    if not isinstance(sets, Mapping) or not 1 <= len(sets) <= len(COLORS):
        found = len(sets) if isinstance(sets, Mapping) else type(sets).__name__
        raise InvalidInputError(f"{argument} must be a mapping of 1 to {len(COLORS)} names to arrays; found {found}")
    return sets


def with_breaks(time: Array, values: Array) -> tuple[Array, Array]:
    """Insert nan wherever time jumps, so that a line drawn through the values breaks there."""
    jumps = np.flatnonzero(is_gap(np.diff(time))) + 1
    return np.insert(time, jumps, time[jumps - 1]), np.insert(values, jumps, np.nan, axis=0)


def legend_of_names(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put named lines or patches above all panels, where they cover no data."""
    letters = sum(len(str(handle.get_label())) for handle in handles)
    columns = len(handles) if letters < 45 else 1
    figure.legend(handles=handles, loc="outside upper center", ncols=columns, fontsize=TEXT, frameon=False)
