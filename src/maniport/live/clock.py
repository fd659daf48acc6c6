"""The time that a live robot moves by: this machine's clock, or simulated time."""

from collections.abc import Callable

from maniport.errors import InvalidInputError
from maniport.util.validation import LATEST, as_number

COMPUTING_TIME = 0.002
"""Longest computing time of a step that does not shorten the next one [s].

The median is 0.3 ms. After a longer step two commands may leave at almost the same time, and the robot must not move in
between for the whole time from the beginning of one step to that of the next.
"""


class MotionClock:
    """Measure the time for which the robot may move."""

    def __init__(self, read: Callable[[], float] | None):
        if read is not None and not callable(read):
            raise InvalidInputError(f"clock must be a function without arguments, or None; found {read!r:.80}")
        self._read = read
        self.now, self._moved = -float("inf"), -float("inf")
        self.state_time, self._offset = 0.0, 0.0

    def read(self) -> float:
        """Read this machine's clock [s]; raise InvalidInputError where it is simulated or returns no finite number."""
        if self._read is None:
            raise InvalidInputError("time is required where clock is None: the times of frames count")
        return as_number(self._read(), "the time that clock returns [s]", minimum=-LATEST, maximum=LATEST)

    def begin_step(self, frame_time: float | None) -> float:
        """Begin a step; return the time since the last one for which the robot may move [s]."""
        simulated = self._read is None
        now = frame_time if frame_time is not None and simulated else self.read()
        if self.now == -float("inf"):
            self._moved, self.state_time = now, now if frame_time is None else frame_time
            self._offset = self.state_time - now
        self.now = max(self.now, now)
        elapsed = max(self.now - self._moved, 0.0)
        self._moved = max(self._moved, self.now)
        self.state_time = now if simulated else self.state_time + elapsed
        return elapsed

    def end_step(self, rested: bool) -> None:
        """End a step in which the robot moved or rested, and whose command leaves now."""
        if rested:  # the time that long steps took from the motion does not matter at rest
            self.state_time = max(self.state_time, self.now + self._offset)
        if self._read is not None:
            self._moved = max(self._moved, self.read() - COMPUTING_TIME)
