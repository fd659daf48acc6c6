"""What the person's arm in the live view did, as a recording that every other command takes."""

import time as clock
from pathlib import Path

import numpy as np

from maniport.bodies import Arm
from maniport.demonstrations import performed
from maniport.errors import ManiportError
from maniport.validation import Array

FEWEST = 10
"""Pictures that make a recording."""
LONGEST = 600.0
"""A recording ends after so many seconds; it would fill the memory, forgotten."""


class Recorder:
    """Notes the person's joint positions while it is switched on, and writes them when it is switched off.

    Parameters
    ----------
    teacher : Arm
        The person's arm.
    folder : path, optional
        Where recordings are written. Default: where the program was started.
    """

    def __init__(self, teacher: Arm, folder: Path | None = None):
        self._teacher, self._folder = teacher, folder or Path.cwd()
        self._time: list[float] = []
        self._joints: list[Array] = []

    def take(self, on: bool, joints: Array, seconds: float) -> str:
        """Note joint positions (dof,), `seconds` after the last ones; return what to say, mostly nothing."""
        if on and (not self._time or self._time[-1] < LONGEST):
            if not self._time or seconds > 0.0:
                self._time.append(self._time[-1] + seconds if self._time else 0.0)
                self._joints.append(joints)
            return f"recording, {self._time[-1]:.0f} s" if len(self._time) % 30 == 1 else ""
        return self._write() if self._time and not on else ""

    def _write(self) -> str:
        time, joints = np.array(self._time), np.array(self._joints)
        self._time, self._joints = [], []
        if len(time) < FEWEST:
            return f"nothing was written: a recording has at least {FEWEST} pictures"
        file = self._folder / f"played-{clock.strftime('%Y%m%d-%H%M%S')}.npz"
        try:
            performed(self._teacher, joints, time, file.name).save(file)
        except (ManiportError, OSError) as error:
            return f"nothing was written: {' '.join(str(error).split())}"
        return f"{time[-1]:.1f} s written: `maniport transfer {file.name}`"
