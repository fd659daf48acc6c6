"""Status of each waypoint of a motion, from good to bad."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.util.validation import Array

FOLLOWED, NEARLY_FOLLOWED = "followed", "nearly followed"
ELLIPSOID, PATH = "ellipsoid missed", "position missed"
JOINT_LIMIT, VELOCITY_LIMIT = "joint limit", "velocity limit"
HELD = "QP failed; last safe configuration held"
STATUSES = (FOLLOWED, NEARLY_FOLLOWED, ELLIPSOID, PATH, JOINT_LIMIT, VELOCITY_LIMIT, HELD)
"""All statuses, from good to bad.

A point is followed when d ≤ 0.1, and nearly followed when d ≤ 0.4; with a path, the position error must also be within
the tolerance (1 mm by default). Otherwise the point is missed. The status then names a velocity or joint limit, if a
joint has reached one since the point before; else what is missed, the position or the ellipsoid, position first.
Ellipsoid and position together have more constraints than a 7-joint arm has degrees of freedom: a missed ellipsoid may
be feasible at another position.
"""
REACHED = (FOLLOWED, NEARLY_FOLLOWED)  # Statuses of points that are not missed
ENOUGH_DISTANCE, NEAR_DISTANCE = 0.1, 0.4
"""Largest distance of a followed and of a nearly followed ellipsoid: one axis 5 % and 22 % too long."""
ENOUGH_METRES = 1e-3
FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large


def statuses_of(
    time: Array, distance: Array, off_path: NDArray[np.bool_], control_time: Array, *steps: NDArray[Any]
) -> tuple[str, ...]:
    """Status at each time (n,); `steps` (m,) are control steps that were held, at a joint limit or a velocity limit."""
    ends = np.searchsorted(control_time, time + 1e-9 * (control_time[-1] - control_time[0]), side="right")
    ends[-1] = len(control_time)
    held, at_stop, at_speed = (  # since the time before
        np.diff(np.concatenate([[0], np.cumsum(happened)])[ends], prepend=0) > 0 for happened in steps
    )
    missed = (distance > NEAR_DISTANCE) | off_path
    words = np.full(len(time), FOLLOWED, dtype=object)
    words[distance > ENOUGH_DISTANCE] = NEARLY_FOLLOWED
    words[distance > NEAR_DISTANCE] = ELLIPSOID
    words[off_path] = PATH
    words[missed & at_stop] = JOINT_LIMIT
    words[missed & at_speed] = VELOCITY_LIMIT
    words[held] = HELD
    return tuple(words)
