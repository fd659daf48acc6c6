"""Stand-ins for `Live` and clocks, a server that runs in a thread, and the check of limits."""

import contextlib
import socket
import threading
import time as clock
from types import SimpleNamespace

import numpy as np

from maniport.errors import InvalidInputError
from maniport.live.serving import Server

NAMES = ("shoulder", "elbow", "wrist")


class Toy:
    """Its first joint is where the wrist is, in x; unseen, it halves the motion of the step before."""

    points = NAMES
    robot = SimpleNamespace(joint_names=("lift", "turn"), joint_units=("m", "rad"))

    def __init__(self):
        self.joint_positions = np.zeros(2)
        self.change = 0.0
        self.times = []
        self.steps = 0
        self.held = False
        self.engaged = 0
        self.joints = []

    def hold(self):
        self.held = True

    def engage(self):
        self.engaged += 1

    def step(self, points, time=None, joints=None):
        if points is not None and points[2, 0] > 1e11:
            raise InvalidInputError("the wrist is too far away")
        self.steps += 1
        self.joints += [] if joints is None else [joints]
        self.times += [] if time is None else [time]
        seen = points is not None and not np.isnan(points).any()
        if seen:
            self.change = points[2, 0] - self.joint_positions[0]
        else:
            self.change = 0.5 * self.change if abs(self.change) > 1e-3 else 0.0
        change = np.array([self.change, 0.0])
        self.joint_positions = self.joint_positions + change
        distance, error = (0.5, 0.01) if seen else (None, None)
        return SimpleNamespace(
            joint_positions=self.joint_positions,
            joint_velocities=change,
            distance=distance,
            position_error=error,
            state="following" if seen else "holding",
            time=clock.monotonic(),
        )


@contextlib.contextmanager
def serving(live, transport, every=False):
    """Run a server in a thread; yield the list that will hold its summary, and end it."""
    (stop, signal), summaries = socket.socketpair(), []
    loop = threading.Thread(
        target=lambda: summaries.append(Server(live, transport, stop, every).run())
    )
    with stop, signal:
        loop.start()
        try:
            yield summaries
        finally:
            signal.send(b"!")
            loop.join(60.0)
    assert not loop.is_alive()


class FakeClock:
    """A clock that is moved by hand; each reading may take time, too."""

    def __init__(self):
        self.now = 1000.0
        self.delays = []

    def __call__(self):
        if self.delays:
            self.now += self.delays.pop(0)
        return self.now


def require_limits(limits, time, q, velocity_tolerance=1e-6, acceleration_tolerance=1e-4):
    """Positions, velocities and accelerations of commands are within the limits; at equal times they are equal."""
    time = np.asarray(time)
    q = np.asarray(q)
    assert ((q >= limits.arm.lower) & (q <= limits.arm.upper)).all()
    same = np.diff(time) == 0.0
    assert (np.diff(q, axis=0)[same] == 0.0).all()
    time = time[np.append(True, ~same)]
    q = q[np.append(True, ~same)]
    steps = np.diff(time)[:, None]
    velocity = np.diff(q, axis=0) / steps
    acceleration = np.diff(velocity, axis=0) / (0.5 * (steps[1:] + steps[:-1]))
    assert (np.abs(velocity) / limits.velocity).max() <= 1.0 + velocity_tolerance
    assert (np.abs(acceleration) / limits.acceleration).max() <= 1.0 + acceleration_tolerance


def wait(condition, seconds=60.0):
    end = clock.monotonic() + seconds
    while not condition():
        assert clock.monotonic() < end, "it does not hold"
        clock.sleep(5e-3)
