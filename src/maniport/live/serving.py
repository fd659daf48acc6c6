"""The loop of a server: a frame comes in, the robot's joint positions go out."""

import math
import select
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from maniport.errors import InvalidInputError, ManiportError
from maniport.live.state import MOVING, errors_text
from maniport.live.transport import (
    SILENCE,
    Address,
    Datagrams,
    Frame,
    Line,
    Order,
    Pipe,
    Source,
    encoded,
    read_frame,
)
from maniport.util.validation import Array
from maniport.version import __version__

if TYPE_CHECKING:
    from maniport.live.live import Live

BRAKING_STEP = 0.01  # Between two steps of a robot without frames [s]
LONGEST_WAIT = 0.1
"""The robot goes on after this time without a frame, or twice the last interval [s]."""
CLOCK_JUMP = 0.1
"""A sender's clock that gains more than this on the clock here jumps; its next frame counts as measured now [s]."""
MOST_JUNK = 10  # Of a sender that is not admitted; more invalid lines in a second are not read


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
        for state in ("holding", "waiting", "lagging"):
            text += f"; {state} {100.0 * self.states[state] / self.states.total():.1f} %"
        if self.states["displaced"]:
            text += f"; displaced {100.0 * self.states['displaced'] / self.states.total():.1f} %"
        if self.errors:
            text += f"; {errors_text(self.errors)}"
        return text

    @property
    def never_engaged(self) -> bool:
        """Whether the person was visible, and the robot waited for `engage` in vain."""
        return self.states["waiting"] > 0 and not any(self.states[state] for state in MOVING)


class Server:
    """Answers the frames of a transport with the states of a robot.

    With `every` each frame is answered, none before its time; otherwise the newest. `stop` is a socket, or the like, to
    which a signal handler or another thread writes a byte.
    """

    def __init__(
        self,
        live: "Live",
        transport: Pipe | Datagrams,
        stop: Source,
        every: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.summary = Summary()
        self._live = live
        self._transport = transport
        self._stop = stop
        self._every = every
        self._clock = clock
        self._count = 0  # of lines
        self._skipped = 0  # frames since the last answer
        self._lines = deque[Line]()  # that wait to be read
        self._received = 0.0  # when they came
        self._next: tuple[Frame, Line] | None = None  # the frame that is processed next …
        self._due = 0.0  # … and when, by the clock
        # the sender who is followed, and when a line of it was read last [s]; before the first one, and after one was
        # silent, anyone may become it
        self._sender: Address | None = None
        self._is_admitted = False
        self._heard = 0.0
        self._junk = Counter[Address | None]()  # invalid lines of senders that are not admitted …
        self._junk_since = 0.0  # … since this time [s]
        self._engage = False  # whether to engage after the next step
        self._joints: Array | None = None  # measured, for the next step
        self._reply_at = math.inf  # when a line without a frame is answered, at the latest [s]
        self._newest = -math.inf  # time of the last frame by its sender
        self._offset = 0.0  # added to it [s]
        self._frame_time = -math.inf  # of the last frame that the robot got [s]
        self._framed = 0.0  # when that was [s]
        self._arrived = 0.0  # when a frame came last [s]
        self._stepped = 0.0  # when the robot moved last [s]
        self._patience = LONGEST_WAIT
        self._rests = True
        self._open = True

    def run(self, longest_braking: float = 5.0) -> Summary:
        """Serve until frames end, the reader leaves, or `stop` can be read; then bring the robot to rest."""
        self._greet()
        try:
            self._serve()
        finally:
            self._live.hold()
            self._forget_order()
            end = self._clock() + longest_braking
            while self._open and not self._rests and self._clock() < end:
                time.sleep(max(self._stepped + BRAKING_STEP - self._clock(), 0.0))
                self._step(None)
        return self.summary

    def _serve(self, longest_pause: float = 0.1) -> None:
        """Wait for lines and process them; while a sender is admitted, see to it and to others in between [s]."""
        while self._open:
            self._dismiss_if_silent()
            due = self._late
            if self._next is not None:
                due = min(due, self._due)
            if self._is_admitted:
                due = min(due, self._clock() + longest_pause)
            if due == math.inf:
                pause = None
            else:
                pause = max(due - self._clock(), 0.0)
            sources: list[Source] = [self._stop]
            if not self._lines and self._next is None:
                sources += self._transport.sources()
            ready, free, _ = select.select(sources, self._transport.blocked(), [], pause)
            if self._stop in ready:
                break
            if free:
                self._open = self._transport.flush()
            if any(source in ready for source in sources[1:]):
                lines = self._transport.receive()
                if lines is None:
                    break
                self._lines.extend(lines)
                self._received = self._clock()
            self._transport.turn_away()
            self._process()

    @property
    def _late(self) -> float:
        """When the robot moves on without a frame, by the clock [s]."""
        if self._rests:
            return self._reply_at
        return min(
            self._reply_at, max(self._arrived + self._patience, self._stepped + BRAKING_STEP)
        )

    def _process(self) -> None:
        """Process lines that are due. Each is read by itself, so that junk does not delay braking."""
        while self._open:
            if self._lines and not (self._every and self._next is not None):
                self._read(self._lines.popleft())
            now = self._clock()
            waits = self._every and self._next is not None
            late = self._late <= now
            due = self._due_frame(now, late)
            if due is not None:
                self._next = None
                self._answer(*due, now)
            elif late:
                self._answer(None, Line(b"", self._sender), now)
            elif waits or not self._lines:
                return

    def _due_frame(self, now: float, late: bool) -> tuple[Frame, Line] | None:
        """Return the next frame and its line where it is answered now: in time, and by no newer one."""
        if self._next is None or self._due > now:
            return None
        if self._every or late or not self._lines:
            return self._next
        return None

    def _read(self, line: Line) -> None:
        """Read a line; its frame is the next one, instead of one that was not processed yet."""
        self._count += 1
        if not self._is_read(line.sender):
            self.summary.refused += 1
            return
        try:
            content = read_frame(line.text, self._live.points, self._live.robot.joint_names)
            if content is None:
                self._heard = self._clock()
                self._greet(line.sender)
                return
            self._admit(line.sender)
            if isinstance(content, Frame):
                self._accept(content, self._clock())
        except InvalidInputError as error:
            self._refuse(error, line)
            return
        if isinstance(content, Order):
            self._take(content)
            self._reply_at = min(self._reply_at, self._stepped + BRAKING_STEP)
            return
        self._take(content.order)
        self._skipped += self._next is not None
        self._next = content, line

    def _is_read(self, sender: Address | None) -> bool:
        """Whether a line of a sender is read: of the one who is admitted, or of anyone, but for floods of junk."""
        if self._is_admitted:
            return sender == self._sender
        now = self._clock()
        if now - self._junk_since > 1.0:
            self._junk.clear()
            self._junk_since = now
        return self._junk[sender] < MOST_JUNK

    def _admit(self, sender: Address | None) -> None:
        """Follow the sender of a valid line until it is silent, by its own clock."""
        self._heard = self._clock()
        if self._is_admitted:
            return
        self._is_admitted = True
        self._lines.extend(self._transport.admit(sender))
        if sender != self._sender:
            self._newest = -math.inf
        self._sender = sender

    def _dismiss_if_silent(self) -> None:
        """Let others be followed after the silence of a sender; the robot rests then."""
        if self._is_admitted and self._clock() - self._heard > SILENCE:
            self._is_admitted = False
            self._forget_order()
            self._transport.dismiss()

    def _take(self, order: Order) -> None:
        """Hold at once, engage after the next step, and keep measured joints for it."""
        if order.joints is not None:
            self._joints = order.joints
        if order.engage is not None:
            self._engage = order.engage
        if order.engage is False:
            self._live.hold()

    def _forget_order(self) -> None:
        self._engage = False
        self._joints = None
        self._reply_at = math.inf

    def _accept(self, frame: Frame, now: float) -> None:
        """Raise unless a frame comes after the one before; where the sender's clock jumps, it was measured now."""
        is_first = self._newest == -math.inf
        behind = frame.t <= self._newest
        passed = max(now - self._framed, 1e-3)
        gain = frame.t + self._offset - self._frame_time
        restarts = (behind and self._rests and not self._every) or (is_first and gain <= 0.0)
        if restarts or passed + CLOCK_JUMP < gain < math.inf:
            self._offset = self._frame_time + passed - frame.t
            gain = passed
        elif behind:
            raise InvalidInputError(
                f"t must increase; found {frame.t!r} s after {self._newest!r} s"
            )
        # none waits for longer than a jump, and one that is later than a jump begins a new count
        self._due = now
        if self._every and gain < math.inf:
            self._due = max(self._due + gain, now - CLOCK_JUMP)
        self._patience = min(2.0 * abs(frame.t - self._newest), LONGEST_WAIT)
        self._newest = frame.t
        self._arrived = now

    def _answer(self, frame: Frame | None, line: Line, now: float) -> None:
        """Move the robot with the next frame, or without one, and send its state."""
        try:
            self._step(frame)
        except ManiportError as error:
            self._forget_order()
            if frame is not None:
                self._newest = self._frame_time - self._offset
            self._refuse(error, line)
            return
        if self._engage:
            self._live.engage()
            self._engage = False
            self._reply_at = self._stepped + BRAKING_STEP
        if frame is None:
            return
        self._frame_time = frame.t + self._offset
        self._framed = now
        self.summary.times.append(self._clock() - (now if self._every else self._received))

    def _step(self, frame: Frame | None) -> None:
        """Move the robot with a frame, or let it brake; send its state."""
        live = self._live
        summary = self.summary
        points = None if frame is None else frame.points
        frame_time = None if frame is None else frame.t + self._offset
        state = live.step(points, frame_time, joints=self._joints)
        self._joints = None
        self._reply_at = math.inf
        self._stepped = self._clock()
        self._rests = not state.joint_velocities.any()
        summary.answered += frame is not None
        summary.skipped += self._skipped
        summary.states[state.state] += 1
        if state.position_error is not None and state.state in ("following", "lagging"):
            summary.errors.append(state.position_error)
        skipped = self._skipped
        self._skipped = 0
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

    def _greet(self, receiver: Address | None = None) -> None:
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
        if not self._is_admitted:
            self._junk[line.sender] += 1
        self._send(line.sender, error=" ".join(str(error).split()), line=self._count)

    def _send(self, receiver: Address | None, **content: object) -> None:
        """Send an answer; where every frame is answered, wait until it is taken or the loop is stopped."""
        self._open = self._transport.send(encoded(**content), receiver) and self._open
        while self._every and self._open:
            blocked = self._transport.blocked()
            if not blocked or select.select([self._stop], blocked, [])[0]:
                break
            self._open = self._transport.flush()
        self.summary.lost = self._transport.lost
