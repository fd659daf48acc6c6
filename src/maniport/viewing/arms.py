"""Arms as skeletons in space, with the ellipsoids of their hands."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axes
from maniport.validation import Array, as_count, as_finite, as_number, as_positive_semidefinite
from maniport.viewing.style import COLORS, COLUMN, UNIT, check_names, column_figure

FAINTEST = 0.25
"""Opacity of the first posture; the last one has full."""


def arms(
    skeletons: Mapping[str, ArrayLike],
    ellipsoids: Mapping[str, ArrayLike],
    count: int = 5,
    size: float = 0.25,
    unit: str = UNIT,
) -> Figure:
    """Draw arms side by side, each in several postures, with an ellipsoid at the hand.

    All panels have the same scale in metres, so that the arms can be compared. Later postures are darker.

    Parameters
    ----------
    skeletons : mapping of str to array_like, shape (n, k, 3)
        For each arm the corners of its polyline from base to hand, in n postures [m]; see `Arm.skeleton`.
    ellipsoids : mapping of str to array_like, shape (n, 3, 3)
        Under the same names; semi-axes in `unit`.
    count : int
        How many postures to draw, at most; evenly over their order.
    size : float
        Length [m] at which a semi-axis of one `unit` is drawn.
    unit : str
        Of the semi-axes.
    """
    as_number(size, "size", above=0.0)
    most = as_count(count, "count")
    drawn = {
        name: _postures(name, lines, ellipsoids, most) for name, lines in check_names(skeletons, "skeletons").items()
    }
    reach = max(_half_width(corners, shells, size) for corners, shells in drawn.values())
    width = 1.0 / len(drawn)
    height = COLUMN * width * 0.95 + 0.25
    figure = column_figure(height)
    figure.set_layout_engine("none")  # it does not know how far the labels of axes in space reach
    for place, (color, (name, (corners, shells))) in enumerate(zip(COLORS, drawn.items(), strict=False)):
        box = (place * width, 0.2 / height, 0.94 * width, 1.0 - 0.25 / height)
        panel: Any = figure.add_axes(box, projection="3d")
        opacities = np.linspace(FAINTEST, 1.0, len(corners)) if len(corners) > 1 else np.ones(1)
        for line, shell, opacity in zip(corners, shells, opacities, strict=True):
            panel.plot(*line.T, color="0.2", alpha=opacity, lw=1.3, marker="o", ms=1.8, solid_joinstyle="round")
            panel.plot_surface(
                *_shell(line[-1], shell, size), color=color, alpha=0.2 + 0.3 * opacity, lw=0, rstride=1, cstride=1
            )
        _dress(panel, name, _middle(corners, shells, size), reach)
    figure.text(0.5, 0.02, f"semi-axes of 1 {unit} are drawn {size:g} m long", fontsize=6, ha="center", va="bottom")
    return figure


def _postures(name: str, lines: ArrayLike, ellipsoids: Mapping[str, ArrayLike], count: int) -> tuple[Array, Array]:
    """Check one arm's polylines and ellipsoids and select the postures to draw."""
    corners = as_finite(lines, f"skeletons[{name!r}]")
    if corners.ndim != 3 or corners.shape[-1] != 3 or corners.shape[1] < 2 or not len(corners):
        raise InvalidInputError(f"skeletons[{name!r}] must have shape (n, k, 3) with k ≥ 2; found {corners.shape}")
    if name not in ellipsoids:
        raise InvalidInputError(f"ellipsoids must have the names of skeletons; {name!r} is missing")
    shells = as_positive_semidefinite(ellipsoids[name], f"ellipsoids[{name!r}]", 3)
    if shells.ndim != 3 or len(shells) != len(corners):
        raise InvalidInputError(
            f"ellipsoids[{name!r}] must have shape ({len(corners)}, 3, 3), one for each posture; found {shells.shape}"
        )
    chosen = np.unique(np.linspace(0, len(corners) - 1, min(count, len(corners))).round().astype(int))
    return corners[chosen], shells[chosen]


def _bounds(corners: Array, shells: Array, size: float) -> tuple[Array, Array]:
    """Lower and upper corner of the box around skeletons and ellipsoids, shapes (3,)."""
    halves = size * np.sqrt(np.diagonal(shells, axis1=1, axis2=2))
    hands = corners[:, -1]
    points = np.concatenate([corners.reshape(-1, 3), hands - halves, hands + halves])
    return points.min(axis=0), points.max(axis=0)


def _middle(corners: Array, shells: Array, size: float) -> Array:
    low, high = _bounds(corners, shells, size)
    return (low + high) / 2


def _half_width(corners: Array, shells: Array, size: float) -> float:
    return float(np.ptp(_bounds(corners, shells, size), axis=0).max()) / 2


def _shell(center: Array, matrix: Array, size: float) -> Array:
    """Surface of an ellipsoid, shape (3, 13, 19)."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 13), np.linspace(0, 2 * np.pi, 19), indexing="ij")
    sphere = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
    semi_axes, directions = axes(matrix)
    return np.asarray(center[:, None, None] + size * np.einsum("ij,jkl->ikl", directions * semi_axes, sphere))


def _dress(panel: Any, name: str, middle: Array, reach: float) -> None:
    """Name the panel and its axes, and give every axis the same length."""
    panel.set_title(name, fontsize=7, y=1.02, pad=0)
    panel.set_box_aspect((1, 1, 1))
    for axis, letter, center in zip((panel.xaxis, panel.yaxis, panel.zaxis), "xyz", middle, strict=True):
        getattr(panel, f"set_{letter}lim")(center - 1.05 * reach, center + 1.05 * reach)
        axis.set_label_text(f"{letter} [m]", fontsize=6)
        axis.labelpad = -11 if letter == "z" else -10
        axis.set_tick_params(labelsize=5, pad=-4)
        axis.set_major_locator(MaxNLocator(3))
    panel.view_init(elev=22, azim=-55)
