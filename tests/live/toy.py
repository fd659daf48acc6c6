"""Stand-ins for `Live` and clocks, a server that runs in a thread, and the check of limits."""

import contextlib
import json
import os
import socket
import threading
import time as clock
from types import SimpleNamespace

import numpy as np

from maniport.errors import InvalidInputError
from maniport.live.serving import Server
from maniport.live.state import FOLLOWING, HOLDING
from maniport.live.transport import Pipe

NAMES = ("shoulder", "elbow", "wrist")
ARM = SimpleNamespace(joint_names=("lift", "turn"), joint_units=("m", "rad"))


class Toy:
    """Its first joint is where the wrist is, in x; unseen, it halves the way it made in the step before."""

    points, robot = NAMES, ARM

    def __init__(self, seconds=0.0):
        self.joint_positions, self._change, self.asked, self.steps = np.zeros(2), 0.0, [], 0
        self._seconds, self._began = seconds, None

    def step(self, points, time=None):
        """Take a frame."""
        if points is not None and points[2, 0] > 1e11:
            raise InvalidInputError("the wrist is too far away")
        clock.sleep(self._seconds)
        self.steps += 1
        if time is not None:
            self.asked.append(time)
        if self._began is None:
            self._began = clock.monotonic() - time
        seen = points is not None and not np.isnan(points).any()
        if seen:
            self._change = points[2, 0] - self.joint_positions[0]
        else:
            self._change = 0.5 * self._change if abs(self._change) > 1e-3 else 0.0
        change = np.array([self._change, 0.0])
        self.joint_positions = self.joint_positions + change
        distance, error = (0.5, 0.01) if seen else (None, None)
        return SimpleNamespace(
            joint_positions=self.joint_positions, joint_velocities=change, distance=distance, position_error=error,
            state=FOLLOWING if seen else HOLDING, time=clock.monotonic() - self._began,
        )  # fmt: skip


@contextlib.contextmanager
def serving(live, transport, every=False):
    """Run the loop of a server in a thread; yields what will hold its summary, and ends it."""
    (stop, signal), found = socket.socketpair(), []
    loop = threading.Thread(target=lambda: found.append(Server(live, transport, stop, every).run()))
    with stop, signal:
        loop.start()
        try:
            yield found
        finally:
            signal.send(b"!")
            loop.join(60.0)
    assert not loop.is_alive()


class FakeClock:
    """A clock that is moved by hand; each reading may take time, too."""

    def __init__(self):
        self.now, self.delays = 1000.0, []

    def __call__(self):
        """Return the time [s]."""
        if self.delays:
            self.now += self.delays.pop(0)
        return self.now


def require_limits(limits, time, q, velocity_tolerance=1e-6, acceleration_tolerance=1e-4):
    """Positions, velocities and accelerations of commands are within the limits; at equal times they are equal."""
    time, q = np.asarray(time), np.asarray(q)
    assert ((q >= limits.lower) & (q <= limits.upper)).all()
    same = np.diff(time) == 0.0
    assert (np.diff(q, axis=0)[same] == 0.0).all()
    time, q = time[np.append(True, ~same)], q[np.append(True, ~same)]
    steps = np.diff(time)[:, None]
    velocity = np.diff(q, axis=0) / steps
    acceleration = np.diff(velocity, axis=0) / (0.5 * (steps[1:] + steps[:-1]))
    assert (np.abs(velocity) / limits.velocity).max() <= 1.0 + velocity_tolerance
    assert (np.abs(acceleration) / limits.acceleration).max() <= 1.0 + acceleration_tolerance


class Ends(contextlib.ExitStack):
    """Both ends of a pair of pipes: `transport` for the loop, `write` and `lines` for who uses it."""

    def __enter__(self):
        source, self._to = os.pipe()
        back, sink = os.pipe()
        self.callback(os.close, source)
        self.callback(os.close, sink)
        self.lines = self.enter_context(os.fdopen(back, "rb"))
        self.transport = Pipe(source, sink)
        return super().__enter__()

    def write(self, *lines):
        """Write lines, at once."""
        os.write(self._to, b"".join(line if isinstance(line, bytes) else line.encode() + b"\n" for line in lines))

    def read(self):
        """The next answer."""
        return json.loads(self.lines.readline())

    def end(self):
        """Write no more."""
        os.close(self._to)


def wait(condition, seconds=60.0):
    """Wait until something holds, which is soon or never."""
    end = clock.monotonic() + seconds
    while not condition():
        assert clock.monotonic() < end, "it did not come about"
        clock.sleep(1e-3)
