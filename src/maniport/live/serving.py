"""The loop of a server: a frame comes in, the robot's joint positions go out."""

import math
import select
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maniport.errors import InvalidInputError, ManiportError
from maniport.live.state import errors_text
from maniport.live.transport import Datagrams, Frame, Line, Pipe, encoded, read_frame
from maniport.version import __version__

BRAKING_STEP = 0.01  # Between two steps of a robot that brakes without frames [s]
LONGEST_WAIT = 0.1  # The robot brakes after this time without a frame, or after twice the time between the last two [s]
CLOCK_JUMP = 0.1
"""A sender's clock that gains more than this on the clock here jumps; its next frame counts as measured now [s]."""


@dataclass
class Summary:
    """Counts and times of what was served."""

    answered: int = 0  # Frames that were answered
    skipped: int = 0  # Frames that a newer one overtook
    refused: int = 0  # Lines that were no frames
    lost: int = 0  # Answers that nobody read
    states: Counter[str] = field(default_factory=Counter)  # of the robot, in all answers
    times: deque[float] = field(default_factory=lambda: deque(maxlen=100_000))
    """From the arrival of each frame to its answer, of the last ones [s]."""
    errors: deque[float] = field(default_factory=lambda: deque(maxlen=100_000))
    """Position errors while the person is followed, of the last frames [m]."""

    def __str__(self) -> str:
        text = f"{self.answered} frames answered, {self.skipped} skipped (newer frames available), "
        text += f"{self.refused} invalid"
        if self.lost:
            text += f", {self.lost} answers not delivered"
        if not self.answered:
            return text
        median, rare, largest = 1e3 * np.quantile(self.times, [0.5, 0.999, 1.0])
        text += f"; {median:.2f} ms (median), {rare:.2f} ms (99.9 %), {largest:.2f} ms (largest)"
        held, lagging = (
            100.0 * self.states[name] / self.states.total() for name in ("holding", "lagging")
        )
        text += f"; held {held:.1f} %, lagged {lagging:.1f} %"
        return f"{text}; {errors_text(self.errors)}" if self.errors else text


class Server:
    """Answers the frames of a transport with the states of a robot.

    With `every` each frame is answered, none before its time; otherwise the newest. `stop` is a socket, or the like, to
    which a signal handler or another thread writes a byte.
    """

    def __init__(
        self,
        live: Any,
        transport: Pipe | Datagrams,
        stop: Any,
        every: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.summary = Summary()
        self._live, self._transport, self._stop, self._every, self._clock = (
            live,
            transport,
            stop,
            every,
            clock,
        )
        self._count, self._skipped = 0, 0
        self._lines, self._received = deque[Line](), 0.0  # that wait to be read, and when they came
        self._next: tuple[Frame, Line] | None = None  # the frame that is processed next …
        self._due = 0.0  # … and when, by the clock
        self._sender: Any = None
        self._newest = -math.inf  # time of the last frame by its sender
        self._offset, self._frame_time = (
            0.0,
            -math.inf,
        )  # added to it, and time of the last frame that the robot got
        self._framed = self._arrived = self._stepped = (
            0.0  # when that was, a frame came, and the robot moved last
        )
        self._patience = LONGEST_WAIT
        self._rests, self._open = True, True

    def run(self, longest_braking: float = 5.0) -> Summary:
        """Serve until frames end, the reader leaves, or `stop` can be read; then bring the robot to rest."""
        self._greet()
        try:
            self._serve()
        finally:
            self._live.hold()
            end = self._clock() + longest_braking
            while self._open and not self._rests and self._clock() < end:
                time.sleep(max(self._stepped + BRAKING_STEP - self._clock(), 0.0))
                self._step(None)
        return self.summary

    def _serve(self) -> None:
        while self._open:
            due = self._late if self._next is None else min(self._late, self._due)
            pause = None if due == math.inf else max(due - self._clock(), 0.0)
            sources = (
                [self._stop]
                if self._lines or self._next is not None
                else [self._stop, self._transport]
            )
            ready, free, _ = select.select(sources, self._transport.blocked(), [], pause)
            if self._stop in ready:
                break
            if free:
                self._open = self._transport.flush()
            if self._transport in ready:
                lines = self._transport.receive()
                if lines is None:
                    break
                self._lines.extend(lines)
                self._received = self._clock()
            self._process()

    @property
    def _late(self) -> float:
        """When the robot brakes without a frame, by the clock [s]."""
        return (
            math.inf
            if self._rests
            else max(self._arrived + self._patience, self._stepped + BRAKING_STEP)
        )

    def _process(self) -> None:
        """Process lines that are due. Each is read by itself, so that junk does not delay braking."""
        while self._open:
            if self._lines and not (self._every and self._next is not None):
                self._read(self._lines.popleft())
            now, waits = self._clock(), self._every and self._next is not None
            late = self._late <= now
            if (
                self._next is not None
                and (self._every or late or not self._lines)
                and self._due <= now
            ):
                self._answer(*self._next, now)
            elif late:
                self._step(None)
            elif waits or not self._lines:
                return

    def _read(self, line: Line) -> None:
        """Read a line; its frame is the next one, instead of one that was not processed yet."""
        self._count += 1
        try:
            frame = read_frame(line.text, self._live.points)
            if frame is None:
                self._greet(line.sender)
                return
            self._accept(frame, self._clock())
        except InvalidInputError as error:
            self._refuse(error, line)
            return
        self._skipped += self._next is not None
        self._next = frame, line

    def _accept(self, frame: Frame, now: float) -> None:
        """Raise unless a frame comes after the one before; where the sender's clock jumps, it was measured now."""
        behind, passed = frame.t <= self._newest, max(now - self._framed, 1e-3)
        gain = frame.t + self._offset - self._frame_time
        if (behind and self._rests and not self._every) or passed + CLOCK_JUMP < gain < math.inf:
            self._offset, gain = self._frame_time + passed - frame.t, passed
        elif behind:
            raise InvalidInputError(
                f"t must increase; found {frame.t!r} s after {self._newest!r} s"
            )
        # none waits for longer than a jump, and one that is later than a jump begins a new count
        self._due = (
            max(self._due + gain, now - CLOCK_JUMP) if self._every and gain < math.inf else now
        )
        self._patience = min(2.0 * abs(frame.t - self._newest), LONGEST_WAIT)
        self._newest, self._arrived = frame.t, now

    def _answer(self, frame: Frame, line: Line, now: float) -> None:
        """Process the next frame."""
        self._next, self._sender = None, line.sender
        try:
            self._step(frame)
        except ManiportError as error:
            self._newest = self._frame_time - self._offset
            self._refuse(error, line)
            return
        self._frame_time, self._framed = frame.t + self._offset, now
        self.summary.times.append(self._clock() - (now if self._every else self._received))

    def _step(self, frame: Frame | None) -> None:
        """Move the robot with a frame, or let it brake; send its state."""
        live, summary = self._live, self.summary
        state = (
            live.step(None) if frame is None else live.step(frame.points, frame.t + self._offset)
        )
        self._stepped, self._rests = self._clock(), not state.joint_velocities.any()
        summary.answered += frame is not None
        summary.skipped += self._skipped
        summary.states[state.state] += 1
        if state.position_error is not None and state.state not in ("reaching", "holding"):
            summary.errors.append(state.position_error)
        skipped, self._skipped = self._skipped, 0
        self._send(
            self._sender,
            t=state.time,
            frame=None if frame is None else frame.t,
            state=state.state,
            joints=dict(zip(live.robot.joint_names, state.joint_positions.tolist(), strict=True)),
            distance=state.distance,
            position_error=state.position_error,
            skipped=skipped,
        )

    def _greet(self, receiver: Any = None) -> None:
        """Send the first line, which is also the answer to the empty object."""
        arm = self._live.robot
        self._send(
            receiver,
            maniport=__version__,
            points=list(self._live.points),
            units=dict(zip(arm.joint_names, arm.joint_units, strict=True)),
            start=dict(zip(arm.joint_names, self._live.joint_positions.tolist(), strict=True)),
            **self._transport.about,
        )

    def _refuse(self, error: Exception, line: Line) -> None:
        self.summary.refused += 1
        self._send(line.sender, error=" ".join(str(error).split()), line=self._count)

    def _send(self, receiver: Any, **content: Any) -> None:
        """Send an answer; where every frame is answered, wait until it is taken or the loop is stopped."""
        self._open = self._transport.send(encoded(**content), receiver) and self._open
        while self._every and self._open and (blocked := self._transport.blocked()):
            if select.select([self._stop], blocked, [])[0]:
                break
            self._open = self._transport.flush()
        self.summary.lost = self._transport.lost
