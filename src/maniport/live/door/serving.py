"""The loop of the door: a frame comes in, the robot's joint positions go out."""

import select
import socket
import time as clock
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from maniport.errors import InvalidInputError, ManiportError
from maniport.live.door.openings import Line
from maniport.live.door.times import Times
from maniport.live.door.wire import Frame, answer, hello, read_frame, refusal
from maniport.live.moment import HOLDING, LAGGING
from maniport.validation import Array

TICK = 0.01
"""Between two steps of a robot that goes on by itself [s]."""
LATE = 2.0
"""A frame that does not come for so many times the time between the last two is late: the robot goes on by itself."""
LONGEST_PATIENCE = 0.1
"""It does so after this time at the latest [s]."""
LEAP = 0.1
"""A sender's clock that gains more than this on the clock here leaps; what it gains is not given to the robot [s]."""
SHORTEST_STEP = 1e-3
"""From what the robot did by itself to a frame that came late [s]."""
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
    times : Times
        From the arrival of each frame to its answer.
    """

    worked: int = 0
    skipped: int = 0
    refused: int = 0
    alone: int = 0
    held: int = 0
    lagging: int = 0
    lost: int = 0
    times: Times = field(default_factory=Times)

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
        return f"{said}; {took}; held {held:.1%}, lagged {lagging:.1%}"


def serve(live: Any, opening: Opening, bell: Bell, every: bool = False) -> Summary:
    """Answer frames until there are no more, nobody reads on, or the bell rings; the robot is then brought to rest.

    Parameters
    ----------
    live : maniport.Live
    opening : Opening
    bell : Bell
    every : bool
        Work every frame, and let their times alone count. Otherwise the clock counts: of frames that wait the newest
        is worked, and without frames the robot goes on by itself until it rests.
    """
    serving = _Serving(live, opening, bell, every)
    serving.run()
    return serving.summary


class _Serving:
    """What the loop knows from one frame to the next.

    Senders' times and those that the robot is told differ by an offset. It grows by what a frame is late, falls where a
    sender's clock leaps, and a sender that begins again when the robot rests, with earlier times, is welcome.
    """

    def __init__(self, live: Any, opening: Opening, bell: Bell, every: bool):
        self.summary = Summary()
        self._live, self._opening, self._bell, self._every = live, opening, bell, every
        self._lines, self._skipped = 0, 0
        self._sender: Any = None
        self._newest = -np.inf
        """Time of the last frame by its sender [s]."""
        self._offset, self._told = 0.0, -np.inf
        """What is added to it, and when the robot was told something last [s]."""
        self._arrived, self._stepped = 0.0, 0.0
        """When the last frame came, and the robot was told something last, by the clock [s]."""
        self._patience = LONGEST_PATIENCE
        self._rests, self._read = True, True

    def run(self) -> None:
        """Go on until it ends."""
        self._send(self._hello())
        while self._read:
            ends = self._opening.fileno(), self._bell.fileno()
            ready, free, _ = select.select(ends, self._opening.blocked(), [], self._pause())
            if self._bell.fileno() in ready:
                break
            if free:
                self._read = self._opening.go_on()
            if ready:
                began = clock.perf_counter()
                lines = self._opening.receive()
                if lines is None:
                    break
                self._take(lines, began)
            if self._due() <= clock.perf_counter():
                self._go_on()
        self._come_to_rest()

    def _hello(self) -> bytes:
        arm = self._live.robot
        start = dict(zip(arm.joint_names, self._live.joint_positions.tolist(), strict=True))
        return hello(self._live.points, start, arm.joint_units, **self._opening.about)

    def _send(self, text: bytes, receiver: Any = None) -> None:
        """Send an answer. Where all frames are worked, however late, wait until it is taken or the bell rings."""
        self._read = self._opening.send(text, receiver) and self._read
        while self._every and self._read and (blocked := self._opening.blocked()):
            if select.select([self._bell.fileno()], blocked, [])[0]:
                break
            self._read = self._opening.go_on()
        self.summary.lost = self._opening.lost

    def _due(self) -> float:
        """When the robot goes on by itself, by the clock [s]."""
        if self._every or self._rests:
            return np.inf
        return max(self._arrived + self._patience, self._stepped + TICK)

    def _pause(self) -> float | None:
        """How long to wait for lines [s]; None for ever."""
        due = self._due()
        return None if due == np.inf else max(due - clock.perf_counter(), 0.0)

    def _take(self, lines: list[Line], began: float) -> None:
        """Understand lines that came together, and work their frames, or the newest."""
        newest = None
        for line in lines:
            self._lines += 1
            try:
                frame = read_frame(line.text, self._live.points)
                if frame is None:
                    self._send(self._hello(), line.sender)
                    continue
                self._accept(frame, began)
            except InvalidInputError as error:
                self._refuse(error, line)
                continue
            if self._every:
                self._work(frame, line, began)
                began = clock.perf_counter()
            else:
                self._skipped += newest is not None
                newest = frame, line
        if newest is not None:
            self._work(*newest, began)

    def _accept(self, frame: Frame, now: float) -> None:
        """Raise unless a frame comes after the one before; one far from what the clock counts is of now."""
        behind, passed = frame.t <= self._newest, max(now - self._stepped, SHORTEST_STEP)
        ahead = frame.t + self._offset - self._told
        if not self._every and ((ahead <= 0.0 and (self._rests or not behind)) or passed + LEAP < ahead < np.inf):
            self._offset = self._told + passed - frame.t
        elif behind:
            raise InvalidInputError(f"t must increase; found {frame.t!r} s after {self._newest!r} s")
        self._patience = min(LATE * abs(frame.t - self._newest), LONGEST_PATIENCE)
        self._newest, self._arrived = frame.t, now

    def _refuse(self, error: Exception, line: Line) -> None:
        self.summary.refused += 1
        self._send(refusal(error, self._lines), line.sender)

    def _work(self, frame: Frame, line: Line, began: float) -> None:
        """Answer a frame."""
        self._sender = line.sender
        try:
            self._step(frame.t, frame.points)
        except ManiportError as error:
            self._newest = self._told - self._offset
            self._refuse(error, line)
            return
        self.summary.worked += 1
        self.summary.times.add(clock.perf_counter() - began)

    def _go_on(self) -> None:
        """Let the robot go on by itself, as if no point were seen."""
        now = clock.perf_counter()
        self._step(self._told - self._offset + (TICK if self._every else now - self._stepped), None)
        self.summary.alone += 1

    def _step(self, t: float, points: Array | None) -> None:
        """Tell the robot where points are at a time of the sender, and the answer."""
        found = self._live.step(points, t + self._offset)
        self._told, self._stepped = t + self._offset, clock.perf_counter()
        self._rests = not found.joint_velocities.any()
        self.summary.held += found.state == HOLDING
        self.summary.lagging += found.state == LAGGING
        self.summary.skipped += self._skipped
        joints = dict(zip(self._live.robot.joint_names, found.joint_positions.tolist(), strict=True))
        said = found.state, joints, found.distance, found.tip_error, self._skipped
        self._skipped = 0
        self._send(answer(t, *said), self._sender)

    def _come_to_rest(self) -> None:
        """Let the robot brake."""
        end = self._told + LONGEST_BRAKING
        while self._read and not self._rests and self._told < end:
            if not self._every:
                clock.sleep(max(self._stepped + TICK - clock.perf_counter(), 0.0))
            self._go_on()
