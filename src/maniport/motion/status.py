"""Status of each waypoint of a motion, from good to bad."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from maniport.util.validation import Array

Status = Literal[
    "followed",
    "nearly followed",
    "ellipsoid missed",
    "position missed",
    "joint limit",
    "velocity limit",
    "QP failed; last safe configuration held",
]
"""All statuses, from good to bad.

A point is followed when d ≤ 0.1, and nearly followed when d ≤ 0.4; with a path, the position error must also be within
the tolerance (1 mm by default). Otherwise the point is missed. The status then names a velocity or joint limit, if a
joint has reached one since the point before; else what is missed, the position or the ellipsoid, position first.
Ellipsoid and position together have more constraints than a 7-joint arm has degrees of freedom: a missed ellipsoid may
be feasible at another position. Where lines of force or speed are targets, the ellipsoid does not count.
"""
REACHED: tuple[Status, ...] = ("followed", "nearly followed")
"""Statuses of points that are not missed."""
ENOUGH_DISTANCE = 0.1
NEAR_DISTANCE = 0.4
"""Largest distance of a followed and of a nearly followed ellipsoid: one axis 5 % and 22 % too long."""
ENOUGH_METRES = 1e-3
FAR = 3.0  # Position errors of so many times the tolerance of the 95th percentile are large


def statuses_of(
    time: Array,
    distance: Array,
    off_path: NDArray[np.bool_],
    control_time: Array,
    held_steps: NDArray[np.bool_],
    stopped_steps: NDArray[np.bool_],
    fast_steps: NDArray[np.bool_],
) -> tuple[Status, ...]:
    """Status at each time (n,), by control steps (m,) that were held, at a joint limit or at a velocity limit."""
    ends = np.searchsorted(
        control_time, time + 1e-9 * (control_time[-1] - control_time[0]), side="right"
    )
    ends[-1] = len(control_time)
    held = _since_before(held_steps, ends)
    at_stop = _since_before(stopped_steps, ends)
    at_speed = _since_before(fast_steps, ends)
    missed = (distance > NEAR_DISTANCE) | off_path
    words = np.full(len(time), "followed", dtype=object)
    words[distance > ENOUGH_DISTANCE] = "nearly followed"
    words[distance > NEAR_DISTANCE] = "ellipsoid missed"
    words[off_path] = "position missed"
    words[missed & at_stop] = "joint limit"
    words[missed & at_speed] = "velocity limit"
    words[held] = "QP failed; last safe configuration held"
    return tuple(words)


def _since_before(steps: NDArray[np.bool_], ends: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether any step (m,) of each interval is true; intervals (n,) end before the step `ends`."""
    counts = np.concatenate([[0], np.cumsum(steps)])
    return np.asarray(np.diff(counts[ends], prepend=0) > 0)
