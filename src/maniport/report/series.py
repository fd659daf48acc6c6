"""Semi-axes and axes of profiles over time, and gaps in time."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.spd.ellipsoid import axis_over_time, lengths, volume
from maniport.util.validation import SPD_TOLERANCE, Array


class ProfileCurves(NamedTuple):
    """Numbers of n ellipsoids."""

    semi_axes: Array  # (n, d) ascending
    longest: Array  # (n, d) unit vectors
    shortest: Array  # (n, d) unit vectors
    volume: Array  # (n,)
    condition: Array  # (n,)


def profile_curves(profiles: Mapping[str, Array]) -> dict[str, ProfileCurves]:
    """Return numbers of profiles, shapes (n, d, d); the directions agree in sign with those of the first."""
    curves: dict[str, ProfileCurves] = {}
    for name, points in profiles.items():
        semi_axes, like = lengths(points), next(iter(curves.values()), None)
        longest = axis_over_time(points, -1, None if like is None else like.longest)
        shortest = axis_over_time(points, 0, None if like is None else like.shortest)
        flat = semi_axes[:, 0] ** 2 <= SPD_TOLERANCE * np.trace(points, axis1=1, axis2=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.where(flat, np.nan, (semi_axes[:, -1] / semi_axes[:, 0]) ** 2)
        curves[name] = ProfileCurves(semi_axes, longest, shortest, np.where(flat, np.nan, volume(points)), condition)
    return curves


def is_gap(steps: Array) -> NDArray[np.bool_]:
    """Return which time steps are more than three times the median, so that a line breaks there."""
    return np.asarray(steps > 3.0 * np.median(steps)) if len(steps) else np.zeros(0, dtype=bool)
