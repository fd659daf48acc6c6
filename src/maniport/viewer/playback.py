"""Playback of a recorded motion of the person."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.util.validation import Array, as_finite, as_number, as_times, require_shape


class Playback:
    """Joint positions (n, dof) at times (n,) [s], played in a loop with straight lines in between."""

    def __init__(self, time: ArrayLike, joints: ArrayLike):
        times, path = as_times(time, fewest=2), as_finite(joints, "joints")
        require_shape(path, "joints", (len(times), "dof"), ", as many as times")
        self._time, self._path = times - times[0], path
        self.duration = float(self._time[-1])
        self.position = 0.0

    def advance(self, seconds: float) -> None:
        """Move on, from the end to the start again."""
        self.position = float((self.position + as_number(seconds, "seconds")) % self.duration)

    def seek(self, position: float) -> None:
        """Go to a time [s]; beyond the ends, to the end."""
        self.position = min(max(as_number(position, "position"), 0.0), self.duration)

    def joints(self) -> Array:
        """Joint positions at this time, shape (dof,)."""
        return np.array([np.interp(self.position, self._time, column) for column in self._path.T])
