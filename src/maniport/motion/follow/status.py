"""Status of each point of a motion, from good to bad."""

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
NEAR_STOP = 1e-3  # How close to a position limit counts as there [rad or m]
NEAR_SPEED = 0.999  # Share of a velocity limit that counts as there


def statuses_of(
    time: Array,
    distance: Array,
    position_error: Array | None,
    control_time: Array,
    held: NDArray[np.bool_],
    stops: NDArray[np.bool_],
    speeding: NDArray[np.bool_],
    tolerance: float = ENOUGH_METRES,
) -> tuple[str, ...]:
    """One of `STATUSES` for each time; `stops` (m, dof) and `speeding` (m - 1, dof): joints at their limits."""
    off_path = np.zeros(len(time), bool) if position_error is None else np.asarray(position_error > tolerance)
    words = np.full(len(time), FOLLOWED, dtype=object)
    words[distance > ENOUGH_DISTANCE] = NEARLY_FOLLOWED
    words[distance > NEAR_DISTANCE] = ELLIPSOID
    words[off_path] = PATH
    missed = np.asarray((distance > NEAR_DISTANCE) | off_path)
    words[missed & _since_last(np.asarray(stops.any(axis=1)), control_time, time)] = JOINT_LIMIT
    moving = np.concatenate([[False], speeding.any(axis=1)])
    words[missed & _since_last(moving, control_time, time)] = VELOCITY_LIMIT
    words[_since_last(held, control_time, time)] = HELD
    return tuple(words)


def _since_last(happened: NDArray[np.bool_], control_time: Array, time: Array) -> NDArray[np.bool_]:
    """Whether something happened at a control step after the time before and until each time, shape (n,)."""
    slack = 1e-9 * (control_time[-1] - control_time[0])
    ends = np.searchsorted(control_time, time + slack, side="right")
    ends[-1] = len(control_time)
    total = np.concatenate([[0], np.cumsum(happened)])
    before = np.concatenate([[0], total[ends][:-1]])
    return np.asarray(total[ends] > before)
