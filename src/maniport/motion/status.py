"""Status of each waypoint of a motion, from good to bad."""

import numpy as np
from numpy.typing import NDArray

from maniport.util.validation import Array

FOLLOWED, NEARLY_FOLLOWED = "followed", "nearly followed"
ELLIPSOID, PATH = "ellipsoid missed", "position missed"
JOINT_LIMIT, VELOCITY_LIMIT = "joint limit", "velocity limit"
HELD = "QP failed: held last safe configuration"
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


def statuses_of(
    time: Array,
    distance: Array,
    off_path: NDArray[np.bool_],
    control_time: Array,
    held: NDArray[np.bool_],
    at_stop: NDArray[np.bool_],
    at_speed: NDArray[np.bool_],
) -> tuple[str, ...]:
    """Status at each time (n,); the last three, (m,), are of control steps: held, and a joint at a limit."""
    slack = 1e-9 * (control_time[-1] - control_time[0])
    ends = np.searchsorted(control_time, time + slack, side="right")
    ends[-1] = len(control_time)

    def since_last(happened: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether something happened at a control step after the time before and until each time."""
        total = np.concatenate([[0], np.cumsum(happened)])[ends]
        return np.asarray(np.diff(total, prepend=0) > 0)

    words = np.full(len(time), FOLLOWED, dtype=object)
    words[distance > ENOUGH_DISTANCE] = NEARLY_FOLLOWED
    words[distance > NEAR_DISTANCE] = ELLIPSOID
    words[off_path] = PATH
    missed = (distance > NEAR_DISTANCE) | off_path
    words[missed & since_last(at_stop)] = JOINT_LIMIT
    words[missed & since_last(at_speed)] = VELOCITY_LIMIT
    words[since_last(held)] = HELD
    return tuple(words)
