"""Lowest points of moving links."""

from typing import NamedTuple

import numpy as np

from maniport.bodies.arm import Arm
from maniport.bodies.collisions.hulls import hulls_of, parts_of
from maniport.bodies.collisions.links import Links
from maniport.errors import FileFormatError
from maniport.validation import Array


class Lowest(NamedTuple):
    """Lowest point of a link during a motion: its height in the base frame [m], and when [s]."""

    link: str
    height: float
    time: float


def lowest_points(arm: Arm, time: Array, q: Array) -> tuple[Lowest, ...]:
    """Compute the lowest point of each moving link's convex hull over a motion."""
    try:
        hulls = [hull for part in parts_of(arm) if part.joint for hull in hulls_of(arm, part)]
    except FileFormatError:
        return ()
    turns, origins = Links(arm.chain).poses(q)
    found: dict[str, Lowest] = {}
    for hull in hulls:
        heights = (turns[:, hull.joint, 2] @ hull.corners.T).min(axis=1) + origins[:, hull.joint, 2] - hull.skin
        i = int(np.argmin(heights))
        point = Lowest(hull.name, float(heights[i]), float(time[i]))
        found[hull.name] = min(found.get(hull.name, point), point, key=lambda one: one.height)
    return tuple(sorted(found.values(), key=lambda one: one.height))
