"""Motions of the person: a recording that plays, and one that is made of what is played."""

import time as clock
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm
from maniport.errors import ManiportError
from maniport.mocap import synthetic_recording
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


class Recorder:
    """Records joint positions of the person while it is switched on; switched off, it writes them to a folder."""

    def __init__(self, teacher: Arm, folder: Path | None = None):
        self._teacher, self._folder = teacher, folder or Path.cwd()
        self._time: list[float] = []
        self._joints: list[Array] = []

    def take(self, on: bool, joints: Array, seconds: float, longest: float = 600.0) -> str:
        """Take joint positions (dof,), `seconds` after the last ones; return a message, mostly none."""
        if on and (not self._time or self._time[-1] < longest):
            if not self._time or seconds > 0.0:
                self._time.append(self._time[-1] + seconds if self._time else 0.0)
                self._joints.append(joints)
            return f"recording, {self._time[-1]:.0f} s" if len(self._time) % 30 == 1 else ""
        return self._write() if self._time and not on else ""

    def _write(self, min_count: int = 10) -> str:
        time, joints = np.array(self._time), np.array(self._joints)
        self._time, self._joints = [], []
        if len(time) < min_count:
            return f"nothing was written: a recording has at least {min_count} frames"
        file = self._folder / f"played-{clock.strftime('%Y%m%d-%H%M%S')}.npz"
        try:
            synthetic_recording(self._teacher, joints, time, file.name).save(file)
        except (ManiportError, OSError) as error:
            return f"nothing was written: {' '.join(str(error).split())}"
        return f"{time[-1]:.1f} s written: `maniport transfer {file.name}`"
