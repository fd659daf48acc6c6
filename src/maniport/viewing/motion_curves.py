"""How well a robot follows, and its joints within their limits, over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_finite
from maniport.viewing.style import COLORS, check_time, column_figure, with_breaks


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
    times = check_time(time)
    curves = [("distance of\nellipsoids", _like(times, distance, "distance"), COLORS[1])]
    if position_error is not None:
        errors = 1e3 * _like(times, position_error, "position_error")
        curves.append(("hand beside\nits path [mm]", errors, COLORS[2]))
    if not joints or set(joints) - set(limits):
        raise InvalidInputError(f"limits must name every joint; found joints {list(joints)}, limits {list(limits)}")
    count = len(curves) + len(joints)
    figure = column_figure(0.35 + 0.62 * count)
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for panel, (label, values, color) in zip(panels, curves, strict=False):
        panel.plot(*_broken(times, values), color=color, lw=1.0)
        panel.set_ylabel(label, fontsize=6)
        panel.set_ylim(bottom=0.0)
    for panel, (name, positions) in zip(panels[len(curves) :], joints.items(), strict=True):
        low, high = limits[name]
        panel.plot(*_broken(times, _like(times, positions, f"joints[{name!r}]")), color=COLORS[0], lw=1.0)
        margin = 0.08 * (high - low) if np.isfinite(high - low) else 0.1
        if np.isfinite(high - low):
            panel.set_ylim(low - margin, high + margin)
            for edge, beyond in ((low, low - margin), (high, high + margin)):
                panel.axhspan(edge, beyond, color="0.85", lw=0)
        short = name if len(name) <= 14 else "…" + name[-13:]
        panel.set_ylabel(f"{short}\n[{(units or {}).get(name, 'rad')}]", fontsize=6)
    panels[-1].set_xlabel("time [s]", fontsize=7)
    for panel in panels:
        panel.tick_params(labelsize=6)
        panel.grid(alpha=0.25, lw=0.5)
        panel.margins(x=0.01)
    figure.align_ylabels(panels)
    return figure


def _like(time: Array, values: ArrayLike, name: str) -> Array:
    array = as_finite(values, name)
    if array.shape != time.shape:
        raise InvalidInputError(f"{name} must have shape {time.shape} as time; found {array.shape}")
    return array


def _broken(time: Array, values: Array) -> tuple[Array, Array]:
    times, column = with_breaks(time, values[:, None])
    return times, column[:, 0]
