"""How well a robot follows, and its joints within their limits, over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.telling.figures.style import (
    COLORS,
    TEXT,
    column_figure,
    dress_over_time,
    laid_out,
    with_breaks,
)
from maniport.validation import Array, as_finite, as_times


def motion(
    time: ArrayLike,
    distance: ArrayLike,
    joints: Mapping[str, ArrayLike],
    limits: Mapping[str, tuple[float, float]],
    position_error: ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the distance of wanted and achieved ellipsoids, the hand's error, and every joint between its limits.

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
        Distance of the hand from its path [m]; drawn in millimetres.
    units : mapping of str to str, optional
        Units of the joints, rad by default.
    """
    times = as_times(time)
    curves = [("distance of wanted and achieved ellipsoids", _like(times, distance, "distance"), COLORS[1])]
    if position_error is not None:
        curves.append(("hand beside its path [mm]", 1e3 * _like(times, position_error, "position_error"), COLORS[2]))
    if not joints or set(joints) - set(limits):
        raise InvalidInputError(f"limits must name every joint; found joints {list(joints)}, limits {list(limits)}")
    count = len(curves) + len(joints)
    figure = column_figure(0.4 + 0.62 * count)
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for panel, (title, values, color) in zip(panels, curves, strict=False):
        panel.plot(*_broken(times, values), color=color, lw=1.0)
        panel.set_title(title, fontsize=TEXT, loc="left", pad=2)
        panel.set_ylim(bottom=0.0)
    for panel, (name, positions) in zip(panels[len(curves) :], joints.items(), strict=True):
        panel.plot(*_broken(times, _like(times, positions, f"joints[{name!r}]")), color=COLORS[0], lw=1.0)
        panel.set_title(f"{name} [{(units or {}).get(name, 'rad')}]", fontsize=TEXT, loc="left", pad=2)
        if np.all(np.isfinite(limits[name])):
            _between(panel, *limits[name])
    dress_over_time(list(panels))
    return laid_out(figure)


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
    if array.shape != time.shape:
        raise InvalidInputError(f"{name} must have shape {time.shape} as time; found {array.shape}")
    return array


def _broken(time: Array, values: Array) -> tuple[Array, Array]:
    times, column = with_breaks(time, values[:, None])
    return times, column[:, 0]
