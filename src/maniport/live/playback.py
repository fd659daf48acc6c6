"""The clock of a recording: where it is, whether it runs, and the joint positions at that time."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_finite, as_number, as_times


class Playback:
    """Plays joint positions over time, again and again.

    Parameters
    ----------
    time : array_like, shape (n,)
        Increasing [s]; n ≥ 2.
    joints : array_like, shape (n, dof)
        Joint positions [rad or m]; straight lines in between.

    Attributes
    ----------
    duration : float
        From the first to the last time [s].
    position : float
        Where it is, between zero and `duration` [s].
    """

    def __init__(self, time: ArrayLike, joints: ArrayLike):
        times, path = as_times(time, fewest=2), as_finite(joints, "joints")
        if path.ndim != 2 or len(path) != len(times):
            raise InvalidInputError(f"joints must have shape ({len(times)}, dof), as many as times; found {path.shape}")
        self._time, self._path = times - times[0], path
        self.duration = float(self._time[-1])
        self.position = 0.0

    def advance(self, seconds: float) -> None:
        """Move on, from the end to the start again; backwards where `seconds` is negative."""
        self.position = float((self.position + as_number(seconds, "seconds")) % self.duration)

    def seek(self, position: float) -> None:
        """Go to a time [s]; beyond the ends, to the end."""
        self.position = min(max(as_number(position, "position"), 0.0), self.duration)

    def joints(self) -> Array:
        """Joint positions at this time, shape (dof,)."""
        return np.array([np.interp(self.position, self._time, column) for column in self._path.T])
