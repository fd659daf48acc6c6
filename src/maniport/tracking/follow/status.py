"""How a motion is judged point by point: in words, from good to bad."""

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array

FOLLOWED = "followed"
ELLIPSOID, PATH = "ellipsoid out of reach", "path out of reach"
JOINT_LIMIT, VELOCITY_LIMIT = "joint limit", "velocity limit"
HELD = "QP failed: held last safe configuration"
STATUSES = (FOLLOWED, ELLIPSOID, PATH, JOINT_LIMIT, VELOCITY_LIMIT, HELD)
"""All statuses, from good to bad.

A time is followed when d ≤ 0.1 and, with a path, the tip is within its tolerance, 1 mm where none is given. Where it is
not and a joint has come to a velocity or joint limit since the time before, that is the status; otherwise what is out
of reach from there, with the position going first. Ellipsoid and position together ask more of a 7-joint arm than it
has: with a path, an ellipsoid "out of reach" may well be one that the arm can make elsewhere.
"""

ENOUGH_DISTANCE = 0.1
ENOUGH_METRES = 1e-3
NEAR_STOP = 1e-3
"""How close to a position limit counts as there [rad or m]."""
NEAR_SPEED = 0.999
"""Share of a velocity limit that counts as there."""


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
    words[distance > ENOUGH_DISTANCE] = ELLIPSOID
    words[off_path] = PATH
    missed = np.asarray((distance > ENOUGH_DISTANCE) | off_path)
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
