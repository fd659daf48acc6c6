"""What figures and the page take from a motion alike: the numbers of its ellipsoids, its gaps, an even part of it."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.spd.ellipsoid import axis_over_time, lengths, volume
from maniport.validation import SPD_TOLERANCE, Array, as_finite

GAP = 3.0
"""A step in time of more than this many median steps breaks a line."""


class Course(NamedTuple):
    """Of n ellipsoids: semi-axes (n, d) ascending, unit vectors along two of them (n, d), and numbers (n,)."""

    semi_axes: Array
    longest: Array
    shortest: Array
    volume: Array
    condition: Array


def courses(profiles: Mapping[str, Array]) -> dict[str, Course]:
    """Numbers of profiles, shapes (n, d, d); the directions agree in sign with those of the first."""
    found: dict[str, Course] = {}
    for name, points in profiles.items():
        semi_axes, like = lengths(points), next(iter(found.values()), None)
        longest = axis_over_time(points, -1, None if like is None else like.longest)
        shortest = axis_over_time(points, 0, None if like is None else like.shortest)
        flat = semi_axes[:, 0] ** 2 <= SPD_TOLERANCE * np.trace(points, axis1=1, axis2=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.where(flat, np.nan, (semi_axes[:, -1] / semi_axes[:, 0]) ** 2)
        found[name] = Course(semi_axes, longest, shortest, np.where(flat, np.nan, volume(points)), condition)
    return found


def is_gap(steps: Array) -> NDArray[np.bool_]:
    """Which steps in time are so long that something is missing; of no steps, none."""
    return np.asarray(steps > GAP * np.median(steps)) if len(steps) else np.zeros(0, dtype=bool)


def as_skeletons(value: ArrayLike, name: str) -> Array:
    """Check corners of a polyline from base to hand over time, shape (n, k, 3) [m]."""
    corners = as_finite(value, name)
    if corners.ndim != 3 or corners.shape[-1] != 3 or corners.shape[1] < 2 or not len(corners):
        raise InvalidInputError(f"{name} must have shape (n, k, 3) with k ≥ 2; found {corners.shape}")
    return corners
