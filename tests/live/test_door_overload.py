"""Senders that are too fast, late or send junk: answers stay consistent, and the robot brakes in time."""

import json
import os
import socket
import time

import numpy as np
import pytest
from test_live_clock import FakeClock, require_limits
from toy import Toy, serving

import maniport as mp
from maniport.input_limits import FRAME_BYTES
from maniport.live.door.openings import Datagrams, Line
from maniport.live.door.serving import Bell, serve

TICK = 0.01


class Script:
    """Lines that come at times that a fake clock has; answers, each with the time at which it was sent."""

    def __init__(self, clock, events):
        self.clock, self.about, self.lost, self.answers = clock, {}, 0, []
        self._events = iter(events)
        self._ready, self._end = os.pipe()
        os.write(self._end, b"!")

    def fileno(self):
        """Always ready."""
        return self._ready

    def receive(self):
        """The lines of the next event, at its time."""
        at, lines = next(self._events, (0.0, None))
        self.clock.now = max(self.clock.now, at)
        return None if lines is None else [Line(line, None) for line in lines]

    def send(self, text, receiver=None):
        """Keep an answer."""
        self.answers.append((self.clock.now, json.loads(text)))
        return True

    def blocked(self):
        """Nothing."""
        return []

    def serve(self, live, **options):
        """Let a robot follow; return the summary."""
        bell = Bell()
        summary = serve(live, self, bell, clock=self.clock, **options)
        for end in (self._ready, self._end):
            os.close(end)
        bell.close()
        return summary

    def states(self):
        """Answers with a state of the robot."""
        return [one for _, one in self.answers if "state" in one]


def frame(t, points):
    """A line of a sender."""
    return json.dumps({"t": t, "points": np.asarray(points).tolist()}).encode()


@pytest.fixture(scope="module")
def positions(small_result, second):
    """Positions of the person's points, shape (n, p, 3)."""
    return second.select(mp.Live.of(small_result).points).positions


def test_junk_does_not_delay_braking():
    """A moving robot brakes after 0.1 s at the latest, while line after line of the largest size is no frame."""
    clock = FakeClock()
    clock.delays = [1e-3] * 100_000
    arm = np.zeros((3, 3))
    junk = [b"[" + b"0," * (FRAME_BYTES // 2 - 2) + b"0]"] * 256
    script = Script(clock, [(1000.0, [frame(0.0, arm)]), (1000.05, [frame(0.05, arm + 0.1)]), *[(0.0, junk)] * 3])
    script.serve(Toy())
    moved, *later = [(at, one) for at, one in script.answers if one.get("frame") != 0.0 and "state" in one]
    assert (moved[1]["frame"], later[0][1]["state"]) == (0.05, "holding")
    braking = np.array([moved[0], *(at for at, _ in later)])
    assert braking[1] - braking[0] <= 0.1 + 5e-3
    assert np.diff(braking[1:8]).max() <= 2 * TICK


def test_longer_datagrams_are_dropped_unread():
    """Of 60 kB nothing is kept; a frame after it is."""
    opening = Datagrams(0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guest:
        for text in (b"[" * 60_000, b"x" * (FRAME_BYTES + 1), b"y" * FRAME_BYTES):
            guest.sendto(text, ("127.0.0.1", opening.about["udp"]))
        assert [line.text for line in opening.receive()] == [None, None, b"y" * FRAME_BYTES]
    opening.close()


@pytest.mark.parametrize("seed", range(3))
def test_answers_are_consistent_under_overload(small_result, positions, seed):
    """Late frames, bursts, pauses, clocks that leap, go back and begin again: `t` is that of the joints."""
    draw, clock = np.random.default_rng(seed), FakeClock()
    live = mp.Live.of(small_result, clock=clock)
    sent, events = 0.0, []
    for i in range(250):
        sent += draw.choice([TICK, 9 * TICK, -0.5, 30.0], p=[0.9, 0.06, 0.02, 0.02])
        pause, size = draw.choice([0.0, 4e-4, TICK, 0.2], p=[0.1, 0.2, 0.6, 0.1]), draw.integers(0, 4)
        lines = [frame(sent + 1e-3 * k, positions[i % len(positions)]) for k in range(size)]
        events.append((1000.0 + 0.007 * i + pause, [*lines, *[b"junk"] * draw.integers(0, 3)]))
    clock.delays = draw.uniform(0.0, 1e-3, 100_000).tolist()
    script = Script(clock, sorted(events, key=lambda event: event[0]))
    summary = script.serve(live)
    states = script.states()
    assert summary.worked > 50
    assert len([one for one in states if one["frame"] is None]) == summary.alone > 10
    times, q = [one["t"] for one in states], np.array([list(one["joints"].values()) for one in states])
    assert (np.diff(times) > 0.0).all()
    assert times[-1] - times[0] <= clock.now - 1000.0
    require_limits(small_result.execution.plan.limits, times, q)


def test_the_lag_is_reported(small_result, positions):
    """Median, 95th percentile and largest with its time, of answers while the person is followed."""
    clock = FakeClock()
    clock.delays = [1e-4] * 100_000
    events = [(1000.0 + 0.033 * i, [frame(0.033 * i, points)]) for i, points in enumerate(positions)]
    script = Script(clock, events)
    summary = script.serve(mp.Live.of(small_result, clock=clock))
    far = {one["t"]: one["tip_error"] for one in script.states() if one["state"] not in ("reaching", "holding")}
    at, most = max(far.items(), key=lambda item: item[1])
    assert (summary.lag.largest, summary.lag.largest_at) == (most, at)
    for share in (0.5, 0.95):
        wanted = np.quantile([*far.values()], share, method="inverted_cdf")
        assert summary.lag.quantile(share) == pytest.approx(wanted, rel=0.01)
    assert f"{1e3 * most:.0f} mm at {at:.2f} s" in str(summary)


def test_a_fast_sender_by_udp_moves_the_robot_no_faster(small_result, positions):
    """With 100 ms in each 10 ms, answers advance by the time that passes, and joints keep the limits over it."""
    opening, limits = Datagrams(0), small_result.execution.plan.limits
    live = mp.Live.of(small_result, start=0.5 * (limits.lower + limits.upper))
    with serving(live, opening), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guest:
        guest.settimeout(10.0)
        states, began = [], time.monotonic()
        for i in range(60):
            guest.sendto(frame(10 * TICK * i, positions[i % len(positions)]), ("127.0.0.1", opening.about["udp"]))
            while not states or states[-1]["frame"] != 10 * TICK * i:
                states.append(json.loads(guest.recv(9999)))
            time.sleep(0.5 * TICK)
        passed = time.monotonic() - began
    opening.close()
    times = [one["t"] for one in states]
    assert times[-1] - times[0] <= passed
    require_limits(limits, times, [list(one["joints"].values()) for one in states])
