"""Arms as skeletons in space, with the ellipsoids of their hands."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.subsample import evenly_spaced
from maniport.telling.course import as_skeletons
from maniport.telling.figures.style import COLUMN, TEXT, UNIT, check_names, colors_of, column_figure
from maniport.validation import Array, as_count, as_number, as_positive_semidefinite, require_shape

SMALL = 6.0
"""Size of the numbers along the axes [pt], for which there is little room."""

LINE = 0.14
"""Height of a line of words [in]."""

LEFT, RIGHT, TOP, BOTTOM = 0.04, 0.33, 0.16, 0.26
"""Room around the cube of a panel for its name and its axes' labels [in]."""

FILLING = 1.15
"""Zoom at which the cube fills its box."""

FAINTEST = 0.25
"""Opacity of the first posture; the last one has full."""


def arms(
    skeletons: Mapping[str, ArrayLike],
    ellipsoids: Mapping[str, ArrayLike],
    count: int = 5,
    size: float = 0.25,
    unit: str = UNIT,
    note: str = "",
    roles: Mapping[str, str] | None = None,
    within: Mapping[str, str] | None = None,
) -> Figure:
    """Draw arms side by side, each in several postures, with an ellipsoid at the hand."""
    as_number(size, "size", above=0.0)
    most = as_count(count, "count")
    drawn = {
        name: _postures(name, lines, ellipsoids, most) for name, lines in check_names(skeletons, "skeletons").items()
    }
    homes = {name: (within or {}).get(name, name) for name in drawn}
    found = [(homes[name], _bounds(*posture, size)) for name, posture in drawn.items()]
    bounds = {home: _around([box for where, box in found if where == home]) for home in homes.values()}
    reach = max(float(np.ptp(box, axis=0).max()) / 2 for box in bounds.values())
    words = [f"semi-axes of 1 {unit} are drawn {size:g} m long", *([note] if note else [])]
    figure, made = _panels(len(bounds), len(words))
    panels = dict(zip(bounds, made, strict=True))
    for (color, _), (name, (corners, shells)) in zip(colors_of(drawn, roles), drawn.items(), strict=True):
        panel = panels[homes[name]]
        opacities = np.linspace(FAINTEST, 1.0, len(corners)) if len(corners) > 1 else np.ones(1)
        for line, shell, opacity in zip(corners, shells, opacities, strict=True):
            panel.plot(*line.T, color="0.2", alpha=opacity, lw=1.3, marker="o", ms=1.8, solid_joinstyle="round")
            look: Any = {"color": color, "alpha": 0.2 + 0.3 * opacity, "lw": 0, "rasterized": True}
            panel.plot_surface(*_shell(line[-1], shell, size), **look, rstride=1, cstride=1)
    for home, panel in panels.items():
        _dress(panel, home, np.mean(bounds[home], axis=0), reach, steps=3 if len(panels) < 3 else 2)
    figure.text(0.5, 0.03 / figure.get_figheight(), "\n".join(words), fontsize=TEXT, ha="center", va="bottom")
    return figure


def _panels(count: int, lines: int) -> tuple[Figure, list[Any]]:
    """Make panels in space, at most three beside one another, above some lines of words."""
    columns = min(count, 3)
    rows = -(-count // columns)
    width = COLUMN / columns
    side = width - LEFT - RIGHT
    height = rows * (TOP + side + BOTTOM) + LINE * lines + 0.03
    figure = column_figure(height)
    figure.set_layout_engine("none")
    panels = []
    for place in range(count):
        row, column = divmod(place, columns)
        low = height - (row + 1) * (TOP + side) - row * BOTTOM
        box = ((column * width + LEFT) / COLUMN, low / height, side / COLUMN, side / height)
        panels.append(figure.add_axes(box, projection="3d"))
    return figure, panels


def _postures(name: str, lines: ArrayLike, ellipsoids: Mapping[str, ArrayLike], count: int) -> tuple[Array, Array]:
    """Check one arm's polylines and ellipsoids and select the postures to draw."""
    corners = as_skeletons(lines, f"skeletons[{name!r}]")
    if name not in ellipsoids:
        raise InvalidInputError(f"ellipsoids must have the names of skeletons; {name!r} is missing")
    shells = as_positive_semidefinite(ellipsoids[name], f"ellipsoids[{name!r}]", 3)
    require_shape(shells, f"ellipsoids[{name!r}]", (len(corners), 3, 3), ", one for each posture")
    chosen = evenly_spaced(len(corners), count)
    return corners[chosen], shells[chosen]


def _bounds(corners: Array, shells: Array, size: float) -> tuple[Array, Array]:
    """Lower and upper corner of the box around skeletons and ellipsoids, shapes (3,)."""
    halves = size * np.sqrt(np.diagonal(shells, axis1=1, axis2=2))
    hands = corners[:, -1]
    points = np.concatenate([corners.reshape(-1, 3), hands - halves, hands + halves])
    return points.min(axis=0), points.max(axis=0)


def _around(boxes: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Lower and upper corner of the box around several."""
    lows, highs = zip(*boxes, strict=True)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _shell(center: Array, matrix: Array, size: float) -> Array:
    """Surface of an ellipsoid, shape (3, 13, 19)."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij")
    sphere = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
    semi_axes, directions = axes(matrix)
    return np.asarray(center[:, None, None] + size * np.einsum("ij,jkl->ikl", directions * semi_axes, sphere))


def _dress(panel: Any, name: str, middle: Array, reach: float, steps: int) -> None:
    """Name the panel and its axes, and give every axis the same length."""
    panel.set_title(name, fontsize=TEXT, pad=0).set_y(1.0)  # set_title puts it into the cube
    panel.set_box_aspect((1, 1, 1), zoom=FILLING)
    for axis, letter, center in zip((panel.xaxis, panel.yaxis, panel.zaxis), "xyz", middle, strict=True):
        getattr(panel, f"set_{letter}lim")(center - 1.05 * reach, center + 1.05 * reach)
        axis.set_label_text(f"{letter} [m]", fontsize=TEXT)
        axis.labelpad = -9.3 if letter == "z" else -9
        axis.set_tick_params(labelsize=SMALL, pad=-3.2 if letter == "z" else -4)
        ticks = MaxNLocator(steps).tick_values(center - reach, center + reach)
        axis.set_ticks(ticks[np.abs(ticks - center) < 0.9 * reach])  # near the corners those of two axes would meet
        axis._axinfo["grid"].update(linewidth=0.4)
    panel.view_init(elev=22, azim=-55)
