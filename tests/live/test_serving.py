"""The server's loop: pipes and datagrams, late frames and none, junk, overload, ends."""

import contextlib
import errno
import fcntl
import io
import json
import os
import socket
import threading
import time

import numpy as np
import pytest
from toy import NAMES, Ends, FakeClock, Toy, require_limits, serving, wait

import maniport as mp
from maniport.errors import InvalidInputError, OutputError
from maniport.live.serving import Server
from maniport.live.transport import Datagrams, Line, Pipe
from maniport.util.input_limits import FRAME_BYTES


def frame(t, x=0.0):
    """A line with the wrist at x, or with all points."""
    points = [[0, 0, 0], [0, 0, 0], [x, 0, 0]] if np.isscalar(x) else np.asarray(x).tolist()
    return json.dumps({"t": t, "points": points})


@pytest.fixture
def ends():
    """Pipes to a server and back."""
    with Ends() as both:
        yield both


@pytest.fixture
def guest():
    """Somebody's UDP socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        link.settimeout(60.0)
        yield link


def next_frame(ends):
    """The next answer to a frame; those with which the robot braked before are skipped."""
    found = ends.read()
    while found["state"] == "holding":
        found = ends.read()
    return found


class Gated(Toy):
    """A stand-in whose steps wait until the gate is open."""

    def __init__(self):
        super().__init__()
        self.begun, self.gate = threading.Event(), threading.Event()

    def step(self, *given, **more):
        """Take a frame."""
        self.begun.set()
        assert self.gate.wait(60.0)
        return super().step(*given, **more)


def test_every_frame_is_answered_on_request(ends):
    """However many wait, none before its time; at the end of the input the robot is brought to rest."""
    with serving(Toy(), ends.transport, every=True) as found:
        assert ends.read()["points"] == [*NAMES]
        began = time.monotonic()
        ends.write(*(frame(0.01 * i, 0.1 * i) for i in range(20)))
        answers = [ends.read() for _ in range(20)]
        assert [one["joints"]["lift"] for one in answers] == [0.1 * i for i in range(20)]
        assert time.monotonic() - began >= 0.19
        ends.write(frame(0.3).rstrip("\n"))
        ends.end()
        while ends.read()["state"] != "holding":
            pass
    assert (found[0].answered, found[0].skipped, found[0].refused) == (21, 0, 0)
    assert "21 frames answered" in str(found[0])


def test_the_newest_of_waiting_frames_is_answered(ends):
    """While one is processed others come; the next answer is that of the last, with the number of skipped ones."""
    toy = Gated()
    with serving(toy, ends.transport) as found:
        ends.read()
        ends.write(frame(0.0))
        assert toy.begun.wait(60.0)
        ends.write(*(frame(0.01 * i, i) for i in range(1, 6)))
        toy.gate.set()
        assert ends.read()["skipped"] == 0
        answer = ends.read()
        assert (answer["frame"], answer["joints"]["lift"], answer["skipped"]) == (0.05, 5.0, 4)
    assert found[0].skipped == 4


def test_a_robot_without_frames_brakes_until_it_rests(ends):
    """Then nothing is sent; a frame that comes late, and a sender that begins again, are answered."""
    toy = Toy()
    with serving(toy, ends.transport):
        ends.read()
        ends.write(frame(0.0, 0.0), frame(0.01, 1.0))
        assert [ends.read()["state"] for _ in range(8)] == ["following"] + ["holding"] * 7
        wait(lambda: toy._change == 0.0)  # it rests
        count = toy.steps
        time.sleep(0.05)
        assert toy.steps == count
        for t in (0.02, 0.025, 0.0):
            ends.write(frame(t, 3.0))
            answer = next_frame(ends)
            assert (answer["joints"]["lift"], answer["frame"]) == (3.0, t)
            wait(lambda: toy._change == 0.0)
    assert np.all(np.diff(toy.asked) > 0.0)


def test_junk_is_answered_and_the_loop_continues(ends):
    """Other lines, too long ones, and times that go back: each is answered with its number."""
    with serving(Toy(), ends.transport, every=True) as found:
        ends.read()
        for i, (bad, word) in enumerate([
            ("nonsense", "must be JSON"),
            (b"x" * (3 * FRAME_BYTES) + b"\n", "at most"),
            (frame(2.1, 2e11), "too far away"),
            (frame(0.0), "t must increase"),
        ]):  # fmt: skip
            ends.write(frame(float(i)))
            assert ends.read()["state"] == "following"
            ends.write(bad)
            refused = ends.read()
            assert word in refused["error"]
            assert refused["line"] == 2 * i + 2
        ends.write("{}", "", "  ")
        assert ends.read()["points"] == [*NAMES]
    assert (found[0].answered, found[0].refused) == (4, 4)


def test_a_full_disk_is_an_error():
    """It is no reader that leaves."""

    class Full(io.BytesIO):
        def flush(self):
            raise OSError(errno.ENOSPC, "No space left on device")

    with open("/dev/full", "wb") as full, pytest.raises(OutputError, match="No space left"):
        Pipe(0, full.fileno()).send(b"{}")
    with contextlib.closing(Datagrams(0, sink=Full())) as transport, pytest.raises(OutputError, match="No space left"):
        transport.send(b"{}")


def test_a_line_without_end_takes_no_memory(ends):
    """No more is kept than a frame may have, of lines and of datagrams."""
    for _ in range(20):
        ends.write(b"x" * 60_000)
        assert ends.transport.receive() == []
        assert len(ends.transport._rest) <= FRAME_BYTES
    ends.write("", frame(0.0))
    assert [line.text for line in ends.transport.receive()] == [None, frame(0.0).encode()]
    with contextlib.closing(Datagrams(0)) as transport, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guest:
        for text in (b"[" * 60_000, b"x" * (FRAME_BYTES + 1), b"y" * FRAME_BYTES):
            guest.sendto(text, ("127.0.0.1", transport.about["udp"]))
        assert [line.text for line in transport.receive()] == [None, None, b"y" * FRAME_BYTES]


def test_a_reader_that_leaves_ends_it(ends):
    """With nobody to answer, the robot is left at its last answer."""
    with serving(Toy(), ends.transport) as found:
        ends.read()
        ends.lines.close()
        ends.write(frame(0.0))
        wait(lambda: found)
        assert found[0].answered == 1


def test_a_reader_that_does_not_read_is_not_waited_for(ends):
    """The robot goes on; lost answers are counted, those that come are whole, and it ends."""
    fcntl.fcntl(ends.lines, fcntl.F_SETPIPE_SZ, 8192)
    toy = Toy()
    with serving(toy, ends.transport) as found:
        for i in range(60):
            ends.write(frame(0.01 * i))
            wait(lambda: len(toy.asked) > i)  # noqa: B023 - it is called before the next `i`
        assert [ends.read().get("frame", -0.01) for _ in range(20)] == [0.01 * i for i in range(-1, 19)]
    assert 0 < found[0].lost < 60
    assert f"{found[0].lost} answers lost" in str(found[0])


def test_datagrams_are_answered_to_their_sender(guest):
    """Junk too."""
    transport = Datagrams(0)
    address = ("127.0.0.1", transport.about["udp"])
    with serving(Toy(), transport) as found:
        guest.sendto(b"{}", address)
        assert json.loads(guest.recv(9999))["udp"] == address[1]
        guest.sendto(frame(0.0, 2.0).encode(), address)
        assert json.loads(guest.recv(9999))["joints"]["lift"] == 2.0
        guest.sendto(b"", address)
        assert "must be JSON" in json.loads(guest.recv(9999))["error"]
    transport.close()
    assert (found[0].answered, found[0].refused) == (1, 1)


def test_answers_can_go_to_one_port(guest):
    """The first line too; senders get none. Of a flood some datagrams are received at a time."""
    transport = Datagrams(0, send=guest.getsockname()[1])
    address = ("127.0.0.1", transport.about["udp"])
    with serving(Toy(), transport), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        assert json.loads(guest.recv(9999))["points"] == [*NAMES]
        other.sendto(frame(0.0).encode(), address)
        assert json.loads(guest.recv(9999))["state"] == "following"
    for _ in range(20):
        guest.sendto(b"x", address)
    assert 0 < len(transport.receive(most=10)) <= 10
    transport.close()


@pytest.mark.parametrize(("port", "send"), [("taken", None), (99_999, None), (0, 0), (9000, 9000)])
def test_impossible_ports_are_refused(guest, port, send):
    """Taken, none, or the same for frames and answers."""
    with pytest.raises(InvalidInputError, match=r"Port 0 takes a free one|udp|send"):
        Datagrams(guest.getsockname()[1] if port == "taken" else port, send=send)


class Script:
    """Lines that come at times of a fake clock; answers, each with the time at which it was sent."""

    def __init__(self, clock, events):
        self.clock, self.about, self.lost, self.answers = clock, {}, 0, []
        self._events = iter(events)
        self._ready, end = os.pipe()
        os.close(end)

    def fileno(self):
        """Always ready."""
        return self._ready

    def receive(self):
        """The lines of the next event, at its time."""
        at, lines = next(self._events, (0.0, None))
        self.clock.now = max(self.clock.now, at)
        return None if lines is None else [Line(line.encode()) for line in lines]

    def send(self, text, receiver=None):
        """Keep an answer."""
        self.answers.append((self.clock.now, json.loads(text)))
        return True

    def blocked(self):
        """Nothing."""
        return []

    def serve(self, live):
        """Let a robot follow; return the summary."""
        stop, signal = socket.socketpair()
        with stop, signal:
            return Server(live, self, stop, clock=self.clock).run()

    def states(self):
        """Answers with a state of the robot, and when they were sent."""
        return [(at, one) for at, one in self.answers if "state" in one]


@pytest.fixture(scope="module")
def positions(small_result, second):
    """Positions of the person's points, shape (n, p, 3)."""
    return second.select(mp.Live.of(small_result).points).positions


def test_junk_does_not_delay_braking():
    """A moving robot brakes after 0.1 s at the latest, while line after line of the largest size is no frame."""
    clock = FakeClock()
    clock.delays = [1e-3] * 100_000
    junk = ["[" + "0," * (FRAME_BYTES // 2 - 2) + "0]"] * 64
    script = Script(clock, [(1000.0, [frame(0.0)]), (1000.05, [frame(0.05, 0.1)]), *[(0.0, junk)] * 2])
    script.serve(Toy())
    _, (moved, answer), *later = script.states()
    assert (answer["frame"], later[0][1]["state"]) == (0.05, "holding")
    braking = np.array([moved, *(at for at, _ in later)])
    assert braking[1] - braking[0] <= 0.1 + 5e-3
    assert np.diff(braking[1:8]).max() <= 0.02


def test_answers_are_consistent_under_overload(small_result, positions):
    """Late frames, bursts, pauses, clocks that jump, go back and begin again: limits are kept over `t`; lag is told."""
    draw, clock = np.random.default_rng(0), FakeClock()
    live, sent, events = mp.Live.of(small_result, clock=clock), 0.0, []
    for i in range(250):
        sent += draw.choice([0.01, 0.09, -0.5, 30.0], p=[0.9, 0.06, 0.02, 0.02])
        pause, size = draw.choice([0.0, 4e-4, 0.01, 0.2], p=[0.1, 0.2, 0.6, 0.1]), draw.integers(0, 4)
        lines = [frame(sent + 1e-3 * k, positions[i % len(positions)]) for k in range(size)]
        events.append((1000.0 + 0.007 * i + pause, [*lines, *["junk"] * draw.integers(0, 3)]))
    clock.delays = draw.uniform(0.0, 1e-3, 100_000).tolist()
    script = Script(clock, sorted(events, key=lambda event: event[0]))
    summary = script.serve(live)
    states = [one for _, one in script.states()]
    assert summary.answered > 50
    assert len([one for one in states if one["frame"] is None]) == summary.unprompted > 10
    times, q = [one["t"] for one in states], np.array([list(one["joints"].values()) for one in states])
    assert (np.diff(times) > 0.0).all()
    assert times[-1] - times[0] <= clock.now - 1000.0
    require_limits(small_result.arm.motion.limits, times, q)
    lags = [(one["position_error"], one["t"]) for one in states if one["state"] not in ("reaching", "holding")]
    assert sorted(summary.lags) == sorted(lag for lag in lags if lag[0] is not None)
    assert len(summary.times) == summary.answered
