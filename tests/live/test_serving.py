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
from toy import NAMES, FakeClock, Toy, require_limits, serving, wait

import maniport as mp
from maniport.errors import InvalidInputError, OutputError
from maniport.live.serving import Server
from maniport.live.transport import Datagrams, Line, Pipe
from maniport.util.input_limits import FRAME_BYTES


def frame(t, x=0.0):
    points = [[0, 0, 0], [0, 0, 0], [x, 0, 0]] if np.isscalar(x) else np.asarray(x).tolist()
    return json.dumps({"t": t, "points": points})


class Ends(contextlib.ExitStack):
    """Both ends of a pair of pipes: `transport` for the server, `write` and `lines` for its user."""

    def __enter__(self):
        source, self._to = os.pipe()
        back, sink = os.pipe()
        self.callback(os.close, source)
        self.callback(os.close, sink)
        self.lines = self.enter_context(os.fdopen(back, "rb"))
        self.transport = Pipe(source, sink)
        return super().__enter__()

    def write(self, *lines):
        os.write(
            self._to,
            b"".join(line if isinstance(line, bytes) else line.encode() + b"\n" for line in lines),
        )

    def read(self):
        return json.loads(self.lines.readline())

    def end(self):
        os.close(self._to)


@pytest.fixture
def ends():
    with Ends() as both:
        yield both


@pytest.fixture
def guest():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        link.settimeout(60.0)
        yield link


def test_every_frame_is_answered_on_request(ends):
    with serving(Toy(), ends.transport, every=True) as summaries:
        assert ends.read()["points"] == [*NAMES]
        began = time.monotonic()
        ends.write(*(frame(0.01 * i, 0.1 * i) for i in range(20)))
        assert [ends.read()["joints"]["lift"] for _ in range(20)] == [0.1 * i for i in range(20)]
        assert time.monotonic() - began >= 0.19
        ends.write(frame(0.3).rstrip("\n"))
        ends.end()
        while ends.read()["state"] != "holding":
            pass
    assert (summaries[0].answered, summaries[0].skipped, summaries[0].refused) == (21, 0, 0)
    assert "21 frames answered" in str(summaries[0])


def test_the_newest_of_waiting_frames_is_answered(ends):
    """While a frame is processed others come; the next answer is that of the last, with the number of skipped ones."""
    toy = Toy()
    begun = threading.Event()
    gate = threading.Event()
    step = toy.step

    def gated(*frame, **more):
        begun.set()
        assert gate.wait(60.0)
        return step(*frame, **more)

    toy.step = gated
    with serving(toy, ends.transport) as summaries:
        ends.read()
        ends.write(frame(0.0))
        assert begun.wait(60.0)
        ends.write(*(frame(0.01 * i, i) for i in range(1, 6)))
        gate.set()
        assert ends.read()["skipped"] == 0
        answer = ends.read()
        assert (answer["frame"], answer["joints"]["lift"], answer["skipped"]) == (0.05, 5.0, 4)
    assert summaries[0].skipped == 4


def test_a_robot_without_frames_brakes_until_it_rests(ends):
    toy = Toy()
    with serving(toy, ends.transport):
        ends.read()
        ends.write(frame(0.0, 0.0), frame(0.01, 1.0))
        assert [ends.read()["state"] for _ in range(8)] == ["following"] + ["holding"] * 7
        wait(lambda: toy.change == 0.0)  # it rests
        count = toy.steps
        time.sleep(0.05)
        assert toy.steps == count
        for t in (0.02, 0.025, 0.0):
            ends.write(frame(t, 3.0))
            while (answer := ends.read())["state"] == "holding":
                pass
            assert (answer["joints"]["lift"], answer["frame"]) == (3.0, t)
            wait(lambda: toy.change == 0.0)
    assert np.all(np.diff(toy.times) > 0.0)


def test_junk_is_answered_and_the_loop_continues(ends):
    bad = {
        "must be JSON": "nonsense",
        "at most": b"x" * (3 * FRAME_BYTES) + b"\n",
        "too far away": frame(2.1, 2e11),
        "t must increase": frame(0.0),
    }
    with serving(Toy(), ends.transport, every=True) as summaries:
        ends.read()
        for i, (word, line) in enumerate(bad.items()):
            ends.write(frame(float(i)))
            assert ends.read()["state"] == "following"
            ends.write(line)
            refused = ends.read()
            assert word in refused["error"]
            assert refused["line"] == 2 * i + 2
        ends.write("{}", "", "  ")
        assert ends.read()["points"] == [*NAMES]
    assert (summaries[0].answered, summaries[0].refused) == (4, 4)


def test_a_full_disk_is_an_error():
    class Full(io.BytesIO):
        def flush(self):
            raise OSError(errno.ENOSPC, "No space left on device")

    with (
        open("/dev/full", "wb") as full,
        contextlib.closing(Datagrams(0, sink=Full())) as datagrams,
    ):
        for transport in (Pipe(0, full.fileno()), datagrams):
            with pytest.raises(OutputError, match="No space"):
                transport.send(b"{}")


def test_a_line_without_end_takes_no_memory(ends, guest):
    for _ in range(20):
        ends.write(b"x" * 60_000)
        assert ends.transport.receive() == []
        assert len(ends.transport._begun) <= FRAME_BYTES
    ends.write("", frame(0.0))
    assert [line.text for line in ends.transport.receive()] == [None, frame(0.0).encode()]
    with contextlib.closing(Datagrams(0)) as transport:
        for text in (b"[" * 60_000, b"x" * (FRAME_BYTES + 1), b"y" * FRAME_BYTES, *[b"z"] * 20):
            guest.sendto(text, ("127.0.0.1", transport.about["udp"]))
        assert [line.text for line in transport.receive(most=4)] == [
            None,
            None,
            b"y" * FRAME_BYTES,
            b"z",
        ]


def test_a_reader_that_leaves_ends_it(ends):
    with serving(Toy(), ends.transport) as summaries:
        ends.read()
        ends.lines.close()
        ends.write(frame(0.0))
        wait(lambda: summaries)
        assert summaries[0].answered == 1


def test_a_reader_that_does_not_read_is_not_waited_for(ends):
    fcntl.fcntl(ends.lines, fcntl.F_SETPIPE_SZ, 8192)
    toy = Toy()
    with serving(toy, ends.transport) as summaries:
        for i in range(60):
            ends.write(frame(0.01 * i))
            wait(lambda: len(toy.times) > i)  # noqa: B023 - it is called before the next `i`
        assert [ends.read().get("frame", -0.01) for _ in range(20)] == [
            0.01 * i for i in range(-1, 19)
        ]
    assert 0 < summaries[0].lost < 60
    assert f"{summaries[0].lost} answers not delivered" in str(summaries[0])


def test_datagrams_are_answered_to_their_sender_or_one_port(guest):
    transport = Datagrams(0)
    address = ("127.0.0.1", transport.about["udp"])
    with serving(Toy(), transport) as summaries:
        guest.sendto(b"{}", address)
        assert json.loads(guest.recv(9999))["udp"] == address[1]
        guest.sendto(frame(0.0, 2.0).encode(), address)
        assert json.loads(guest.recv(9999))["joints"]["lift"] == 2.0
        guest.sendto(b"", address)
        assert "must be JSON" in json.loads(guest.recv(9999))["error"]
    transport.close()
    assert (summaries[0].answered, summaries[0].refused) == (1, 1)
    transport = Datagrams(0, send=guest.getsockname()[1])
    with serving(Toy(), transport), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        while json.loads(guest.recv(9999)).get("points") != [
            *NAMES
        ]:  # states of the first server's robot that brakes
            pass
        other.sendto(frame(0.0).encode(), ("127.0.0.1", transport.about["udp"]))
        assert json.loads(guest.recv(9999))["state"] == "following"
    transport.close()


@pytest.mark.parametrize(("port", "send"), [("taken", None), (99_999, None), (0, 0), (9000, 9000)])
def test_impossible_ports_are_refused(guest, port, send):
    with pytest.raises(InvalidInputError, match=r"\b[Pp]ort\b|udp|send"):
        Datagrams(guest.getsockname()[1] if port == "taken" else port, send=send)


class Script:
    """A transport with lines at times of a fake clock, `blocked` by nothing; keeps answers with their times."""

    def __init__(self, clock, events):
        self.clock = clock
        self.about = {}
        self.lost = 0
        self.answers = []
        self.blocked = list
        self._events = iter(events)
        self._ready, end = os.pipe()
        os.close(end)
        self.dismiss = self.turn_away = lambda: None
        self.admit = lambda sender: []

    def sources(self):
        return [self._ready]

    def receive(self):
        at, lines = next(self._events, (0.0, None))
        self.clock.now = max(self.clock.now, at)
        return None if lines is None else [Line(line.encode()) for line in lines]

    def send(self, text, receiver=None):
        self.answers.append((self.clock.now, json.loads(text)))
        return True

    def serve(self, live):
        """Let a robot follow; return the summary, the times of answers, and the answers with a state of the robot."""
        stop, signal = socket.socketpair()
        with stop, signal:
            summary = Server(live, self, stop, clock=self.clock).run()
        times, states = zip(
            *(answer for answer in self.answers if "state" in answer[1]), strict=True
        )
        return summary, np.array(times), states


def test_junk_does_not_delay_braking():
    clock = FakeClock()
    clock.delays = [1e-3] * 100_000
    junk = ["[" + "0," * (FRAME_BYTES // 2 - 2) + "0]"] * 64
    script = Script(
        clock, [(1000.0, [frame(0.0)]), (1000.05, [frame(0.05, 0.1)]), *[(0.0, junk)] * 2]
    )
    _, times, states = script.serve(Toy())
    assert (states[1]["frame"], states[2]["state"]) == (0.05, "holding")
    assert times[2] - times[1] <= 0.1 + 5e-3
    assert np.diff(times[2:9]).max() <= 0.02


def test_the_robot_brakes_after_an_unexpected_error():
    clock = FakeClock()
    toy = Toy()
    clock.delays = [1e-3] * 1000
    step = toy.step

    def failing(points, time=None, joints=None):
        if time == 0.1:
            raise RuntimeError
        return step(points, time)

    toy.step = failing
    with pytest.raises(RuntimeError):
        Script(
            clock,
            [(1000.0, [frame(0.0)]), (1000.05, [frame(0.05, 0.1)]), (1000.1, [frame(0.1, 0.2)])],
        ).serve(toy)
    assert toy.held
    assert toy.change == 0.0


def test_answers_are_consistent_under_overload(small_result, second):
    """Late frames, bursts, pauses, clocks that jump, go back and restart: limits are kept over `t`; lag is reported."""
    draw = np.random.default_rng(0)
    clock = FakeClock()
    live = mp.Live.of(small_result, clock=clock, auto_engage=True)
    sent = 0.0
    events = []
    positions = second.select(live.points).positions
    for i in range(250):
        sent += draw.choice([0.01, 0.09, -0.5, 30.0], p=[0.9, 0.06, 0.02, 0.02])
        pause = draw.choice([0.0, 4e-4, 0.01, 0.2], p=[0.1, 0.2, 0.6, 0.1])
        size = draw.integers(0, 4)
        lines = [frame(sent + 1e-3 * k, positions[i % len(positions)]) for k in range(size)]
        events.append((1000.0 + 0.007 * i + pause, [*lines, *["junk"] * draw.integers(0, 3)]))
    clock.delays = draw.uniform(0.0, 1e-3, 100_000).tolist()
    summary, _, states = Script(clock, sorted(events, key=lambda event: event[0])).serve(live)
    assert summary.answered > 50
    assert len([state for state in states if state["frame"] is None]) > 10
    assert summary.states.total() == len(states)
    times = [state["t"] for state in states]
    q = np.array([list(state["joints"].values()) for state in states])
    assert (np.diff(times) > 0.0).all()
    assert times[-1] - times[0] <= clock.now - 1000.0
    require_limits(small_result.arm.motion.limits, times, q)
    errors = [
        answer["position_error"] for answer in states if answer["state"] in ("following", "lagging")
    ]
    assert list(summary.errors) == [error for error in errors if error is not None]
    assert len(summary.times) == summary.answered
