"""Targets of an arm of the robot, and their delay."""

from typing import NamedTuple

import numpy as np

from maniport.live.kernels import averaged, queued
from maniport.util.validation import Array


class Target(NamedTuple):
    """The target of an arm in the base frame."""

    ellipsoid: Array  # (d, d)
    position: Array | None  # (3,), of the end effector [m]


class TargetQueue:
    """The last targets of an arm, which the robot follows after a delay [s]; the path between two of them is linear.

    As far as later targets are available, the path is averaged from 0.05 s before each time to 0.05 s after it.
    """

    SMOOTHING = 0.05  # [s]

    def __init__(self, delay: float):
        self._delay = delay
        self._newest = Target(np.empty((0, 0)), None)
        # position and ellipsoid at each time
        self._times = np.empty(0)
        self._rows = np.empty((0, 0))

    def add(self, target: Target, now: float, anew: bool = False) -> None:
        """Add the target of a frame that comes now, by the robot's clock [s]; `anew` forgets earlier ones."""
        if anew:
            self._times = np.empty(0)
            self._rows = np.empty((0, 0))
        row = np.empty(3 + target.ellipsoid.size)
        row[:3] = 0.0 if target.position is None else target.position
        row[3:] = target.ellipsoid.ravel()
        self._times, self._rows = queued(self._times, self._rows, row, now, self._delay)
        self._newest = target

    def at(self, time: float) -> Target | None:
        """Return the target that the robot follows at a time [s]: that of the delay before, or the nearest one."""
        if len(self._times) == 0:
            return None
        row = averaged(self._times, self._rows, time - self._delay, np.zeros(1), self.SMOOTHING)[0]
        return Target(
            row[3:].reshape(self._newest.ellipsoid.shape),
            None if self._newest.position is None else row[:3],
        )

    def positions(self, time: float, later: Array) -> Array | None:
        """Return positions at times (k,) after a time [s], shape (k, 3); None without a delay or a path."""
        if self._delay == 0.0 or self._newest.position is None:
            return None
        return np.asarray(
            averaged(self._times, self._rows, time - self._delay, later, self.SMOOTHING)[:, :3]
        )
