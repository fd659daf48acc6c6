"""The loop of the door: a frame comes in, the robot's joint positions go out."""

import select
import socket
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from maniport.errors import InvalidInputError, ManiportError
from maniport.live.door.histogram import Histogram
from maniport.live.door.openings import Line
from maniport.live.door.wire import Frame, answer, hello, read_frame, refusal
from maniport.live.moment import HOLDING, LAGGING, REACHING

TICK = 0.01
"""Between two steps of a robot that goes on by itself [s]."""
LATE = 2.0
"""A frame that does not come for so many times the time between the last two is late: the robot goes on by itself."""
LONGEST_PATIENCE = 0.1
"""It does so after this time at the latest [s]."""
LEAP = 0.1
"""A sender's clock that gains more than this on the clock here leaps; its next frame counts as measured now [s]."""
SHORTEST_STEP = 1e-3
"""Least time between two frames where the sender's clock leaps [s]."""
LONGEST_BRAKING = 5.0
"""Of the robot at the end [s]: what does not rest by then never will."""


class Opening(Protocol):
    """Where lines come in and answers go out: `maniport.live.door.openings`."""

    about: dict[str, Any]
    lost: int

    def fileno(self) -> int:
        """What to wait for."""
        ...

    def receive(self) -> list[Line] | None:
        """The lines that are there; None when there will be no more."""
        ...

    def send(self, text: bytes, receiver: Any = None) -> bool:
        """Answer a sender, or who gets all; whether somebody still reads."""
        ...

    def blocked(self) -> list[int]:
        """What must be ready for writing before an answer can go on."""
        ...

    def go_on(self) -> bool:
        """Send what waits as far as it is taken; whether somebody still reads."""
        ...


class Bell:
    """What ends the loop from outside: a signal, or another thread."""

    def __init__(self) -> None:
        self._inside, self._outside = socket.socketpair()

    def fileno(self) -> int:
        """What to wait for."""
        return self._inside.fileno()

    def ring(self) -> None:
        """End the loop as soon as it waits."""
        self._outside.send(b"!")

    def close(self) -> None:
        """Ring no more."""
        self._inside.close()
        self._outside.close()


@dataclass
class Summary:
    """What went through the door.

    Attributes
    ----------
    worked, skipped, refused : int
        Frames that were answered, frames that a newer one overtook, lines that were no frames.
    alone, held, lagging, lost : int
        Answers without a frame, answers with which the robot held or braked, or lagged, and answers that nobody took.
    times : Histogram
        From the arrival of each frame to its answer [s].
    lag : Histogram
        Distance of the end effector from where the path has the person's hand now [m], while the person is followed.
    """

    worked: int = 0
    skipped: int = 0
    refused: int = 0
    alone: int = 0
    held: int = 0
    lagging: int = 0
    lost: int = 0
    times: Histogram = field(default_factory=Histogram)
    lag: Histogram = field(default_factory=Histogram)

    def __str__(self) -> str:
        said = f"{self.worked} frames answered, {self.skipped} skipped since newer ones waited, {self.refused} refused"
        if self.lost:
            said += f", {self.lost} answers lost since nobody read them"
        if not self.worked:
            return said
        middle, most, largest = (
            1e3 * t for t in (self.times.quantile(0.5), self.times.quantile(0.999), self.times.largest)
        )
        held, lagging = (count / (self.worked + self.alone) for count in (self.held, self.lagging))
        took = f"{middle:.2f} ms (median), {most:.2f} ms (99.9 %), {largest:.2f} ms (largest)"
        said = f"{said}; {took}; held {held:.1%}, lagged {lagging:.1%}"
        if np.isnan(self.lag.largest):
            return said
        lag = f"median {1e3 * self.lag.quantile(0.5):.1f} mm, 95th percentile {1e3 * self.lag.quantile(0.95):.0f} mm"
        lag = f"{lag}, max {1e3 * self.lag.largest:.0f} mm at {self.lag.largest_at:.2f} s"
        return f"{said}; lag of the end effector: {lag}"


def serve(
    live: Any, opening: Opening, bell: Bell, every: bool = False, clock: Callable[[], float] = time.monotonic
) -> Summary:
    """Answer frames until there are no more, nobody reads on, or the bell rings; the robot is then brought to rest."""
    serving = _Serving(live, opening, bell, every, clock)
    serving.run()
    return serving.summary


class _Serving:
    """What the loop knows from one frame to the next.

    The times of frames that the robot gets differ from the sender's by an offset. It changes where a sender's clock
    leaps, and where a sender begins again with earlier times while the robot rests.
    """

    def __init__(self, live: Any, opening: Opening, bell: Bell, every: bool, clock: Callable[[], float]):
        self.summary = Summary()
        self._live, self._opening, self._bell, self._every, self._clock = live, opening, bell, every, clock
        self._count, self._skipped = 0, 0
        self._lines, self._received = deque[Line](), 0.0
        """Lines that wait to be read, and when they came, by the clock [s]."""
        self._next: tuple[Frame, Line] | None = None
        """The frame that is processed next."""
        self._due = 0.0
        """When that is to be done, by the clock [s]."""
        self._sender: Any = None
        self._newest = -np.inf
        """Time of the last frame by its sender [s]."""
        self._offset, self._frame_time, self._framed = 0.0, -np.inf, 0.0
        """What is added to it, that of the last frame that the robot got, and when that was, by the clock [s]."""
        self._arrived, self._stepped = 0.0, 0.0
        """When the last frame came, and the robot moved last, by the clock [s]."""
        self._patience = LONGEST_PATIENCE
        self._rests, self._read = True, True

    def run(self) -> None:
        """Go on until it ends."""
        self._send(self._hello())
        while self._read:
            waiting = self._lines or self._next is not None
            sources: list[Any] = [self._bell] if waiting else [self._bell, self._opening]
            ready, free, _ = select.select(sources, self._opening.blocked(), [], self._pause())
            if self._bell in ready:
                break
            if free:
                self._read = self._opening.go_on()
            if self._opening in ready:
                lines = self._opening.receive()
                if lines is None:
                    break
                self._lines.extend(lines)
                self._received = self._clock()
            self._process()
        self._come_to_rest()

    def _process(self) -> None:
        """Process lines as far as it is time for them."""
        while self._read:
            held_back = self._every and self._next is not None
            if self._lines and not held_back:
                self._read_line(self._lines.popleft())
            now = self._clock()
            late = self._late() <= now
            if self._next is not None and (self._every or late or not self._lines) and self._due <= now:
                self._answer_next(now)
            elif late:
                self._go_on()
            elif not self._lines or (self._every and self._next is not None):
                return

    def _hello(self) -> bytes:
        arm = self._live.robot
        start = dict(zip(arm.joint_names, self._live.joint_positions.tolist(), strict=True))
        return hello(self._live.points, start, arm.joint_units, **self._opening.about)

    def _send(self, text: bytes, receiver: Any = None) -> None:
        """Send an answer. Where every frame is answered, wait until it is taken or the bell rings."""
        self._read = self._opening.send(text, receiver) and self._read
        while self._every and self._read and (blocked := self._opening.blocked()):
            if select.select([self._bell.fileno()], blocked, [])[0]:
                break
            self._read = self._opening.go_on()
        self.summary.lost = self._opening.lost

    def _late(self) -> float:
        """When the robot brakes by itself, by the clock [s]."""
        return np.inf if self._rests else max(self._arrived + self._patience, self._stepped + TICK)

    def _pause(self) -> float | None:
        """How long to wait for lines [s]; None for ever."""
        due = self._late() if self._next is None else min(self._late(), self._due)
        return None if due == np.inf else max(due - self._clock(), 0.0)

    def _read_line(self, line: Line) -> None:
        """Read a line; its frame is the next one, instead of one that was not processed yet."""
        self._count += 1
        try:
            frame = read_frame(line.text, self._live.points)
            if frame is None:
                self._send(self._hello(), line.sender)
                return
            self._accept(frame, self._clock())
        except InvalidInputError as error:
            self._refuse(error, line)
            return
        self._skipped += self._next is not None
        self._next = frame, line

    def _accept(self, frame: Frame, now: float) -> None:
        """Raise unless a frame comes after the one before; where the sender's clock leaps, it was measured now."""
        behind, passed = frame.t <= self._newest, max(now - self._framed, SHORTEST_STEP)
        gain = frame.t + self._offset - self._frame_time
        if (behind and self._rests and not self._every) or passed + LEAP < gain < np.inf:
            self._offset, gain = self._frame_time + passed - frame.t, passed
        elif behind:
            raise InvalidInputError(f"t must increase; found {frame.t!r} s after {self._newest!r} s")
        # none waits for longer than a leap, and one that is later than a leap begins a new count
        self._due = max(self._due + gain, now - LEAP) if self._every and gain < np.inf else now
        self._patience = min(LATE * abs(frame.t - self._newest), LONGEST_PATIENCE)
        self._newest, self._arrived = frame.t, now

    def _refuse(self, error: Exception, line: Line) -> None:
        self.summary.refused += 1
        self._send(refusal(error, self._count), line.sender)

    def _answer_next(self, now: float) -> None:
        """Process the next frame."""
        assert self._next is not None
        (frame, line), self._next = self._next, None
        self._sender = line.sender
        try:
            self._step(frame)
        except ManiportError as error:
            self._newest = self._frame_time - self._offset
            self._refuse(error, line)
            return
        self._frame_time, self._framed = frame.t + self._offset, now
        self.summary.worked += 1
        self.summary.times.add(self._clock() - (now if self._every else self._received))

    def _go_on(self) -> None:
        """Let the robot brake."""
        self._step(None)
        self.summary.alone += 1

    def _step(self, frame: Frame | None) -> None:
        """Move the robot, and send its state."""
        found = self._live.step(None) if frame is None else self._live.step(frame.points, frame.t + self._offset)
        self._stepped, self._rests = self._clock(), not found.joint_velocities.any()
        self.summary.held += found.state == HOLDING
        self.summary.lagging += found.state == LAGGING
        self.summary.skipped += self._skipped
        if found.tip_error is not None and found.state not in (REACHING, HOLDING):
            self.summary.lag.add(found.tip_error, found.time)
        joints = dict(zip(self._live.robot.joint_names, found.joint_positions.tolist(), strict=True))
        said = found.state, joints, found.distance, found.tip_error, self._skipped
        self._skipped = 0
        self._send(answer(found.time, None if frame is None else frame.t, *said), self._sender)

    def _come_to_rest(self) -> None:
        """Let the robot brake until it rests."""
        end = self._clock() + LONGEST_BRAKING
        while self._read and not self._rests and self._clock() < end:
            time.sleep(max(self._stepped + TICK - self._clock(), 0.0))
            self._go_on()
