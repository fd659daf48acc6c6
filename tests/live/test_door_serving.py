"""The loop of the door: pipes and datagrams, old frames and none, nonsense, ends."""

import contextlib
import errno
import fcntl
import io
import json
import socket
import threading
import time

import numpy as np
import pytest
from toy import NAMES, Ends, Toy, serving, wait

from maniport.errors import InvalidInputError, OutputError
from maniport.input_limits import FRAME_BYTES
from maniport.live.door.histogram import Histogram
from maniport.live.door.openings import AT_ONCE, Datagrams, Pipe


def frame(t, x=0.0):
    """A line with the wrist at x."""
    return json.dumps({"t": t, "points": [[0, 0, 0], [0, 0, 0], [x, 0, 0]]})


@pytest.fixture
def ends():
    """Pipes to a door and back."""
    with Ends() as both:
        yield both


@pytest.fixture
def guest():
    """Somebody's UDP socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        one.settimeout(60.0)
        yield one


def read(stream):
    """The next line."""
    return json.loads(stream.readline())


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


def test_every_frame_is_answered_when_that_is_asked_for(ends):
    """However many wait; the end of the input ends the loop, with a robot at rest and the count of all."""
    with serving(Toy(), ends.opening, every=True) as found:
        assert read(ends.lines)["points"] == [*NAMES]
        began = time.monotonic()
        ends.write(*(frame(0.01 * i, 0.1 * i) for i in range(20)))
        answers = [read(ends.lines) for _ in range(20)]
        assert [one["joints"]["lift"] for one in answers] == [0.1 * i for i in range(20)]
        assert time.monotonic() - began >= 0.19  # none before its time
        ends.write(frame(0.3).rstrip("\n"))
        ends.end()
        rest = read(ends.lines)
        while rest["state"] != "holding":
            rest = read(ends.lines)
    assert (found[0].worked, found[0].skipped, found[0].refused) == (21, 0, 0)
    assert "21 frames answered" in str(found[0])


def test_of_frames_that_wait_the_newest_counts(ends):
    """While one is worked others come; the next answer is that of the last, and says how many were skipped."""
    toy = Gated()
    with serving(toy, ends.opening) as found:
        read(ends.lines)
        ends.write(frame(0.0))
        assert toy.begun.wait(60.0)
        ends.write(*(frame(0.01 * i, i) for i in range(1, 6)))
        toy.gate.set()
        assert read(ends.lines)["skipped"] == 0
        told = read(ends.lines)
        assert (told["frame"], told["joints"]["lift"], told["skipped"]) == (0.05, 5.0, 4)
    assert found[0].skipped == 4


def test_a_robot_without_frames_brakes_by_itself(ends):
    """When a frame is late it is told that nothing is seen, until it rests; then nothing is said or done."""
    toy = Toy()
    with serving(toy, ends.opening):
        read(ends.lines)
        ends.write(frame(0.0, 0.0), frame(0.01, 1.0))
        states = [read(ends.lines)["state"] for _ in range(8)]
        assert states == ["following"] + ["holding"] * 7
        wait(lambda: toy._change == 0.0)  # it rests
        count = toy.steps
        time.sleep(0.05)
        assert toy.steps == count
        ends.write(frame(0.02, 3.0))  # its sender stood still meanwhile, or began again
        told = read(ends.lines)
        while told["state"] == "holding":
            told = read(ends.lines)
        assert (told["joints"]["lift"], told["frame"]) == (3.0, 0.02)
    assert np.all(np.diff(toy.asked) > 0.0)


def test_nonsense_is_answered_and_the_loop_goes_on(ends):
    """Lines that are none, too long, or back in time: each is answered with its number, frames between them as ever."""
    with serving(Toy(), ends.opening, every=True) as found:
        read(ends.lines)
        for i, (bad, told) in enumerate([
            ("nonsense", "must be JSON"),
            (b"x" * (3 * FRAME_BYTES) + b"\n", "at most"),
            (frame(2.1, 2e11), "too far away"),
            (frame(0.0), "t must increase"),
        ]):  # fmt: skip
            ends.write(frame(float(i)))
            assert read(ends.lines)["state"] == "following"
            ends.write(bad)
            refused = read(ends.lines)
            assert told in refused["error"]
            assert refused["line"] == 2 * i + 2
        ends.write("{}", "", "  ")
        assert read(ends.lines)["points"] == [*NAMES]
    assert (found[0].worked, found[0].refused) == (4, 4)


@pytest.mark.parametrize("leap", [1.0, 3e7, 4e11])
def test_a_clock_that_leaps_moves_the_robot_no_farther(ends, leap):
    """The robot is told the time that has passed here; answers bear their frames' times, as before."""
    toy, began = Toy(), time.monotonic()
    with serving(toy, ends.opening):
        read(ends.lines)
        for t in (0.0, 0.01, leap, leap + 0.01):
            ends.write(frame(t))
            told = read(ends.lines)
            while told["state"] == "holding":
                told = read(ends.lines)
            assert told["frame"] == t
    assert np.all(np.diff(toy.asked) > 0.0)
    assert toy.asked[-1] < time.monotonic() - began + 0.5


def test_times_are_told_to_the_last_digit(ends):
    """Those of a clock that counts since 1970 differ in the tenth."""
    with serving(Toy(), ends.opening, every=True):
        read(ends.lines)
        ends.write(frame(1.7e9 + 0.02), frame(1.7e9))
        read(ends.lines)
        assert "found 1700000000.0 s after 1700000000.02 s" in read(ends.lines)["error"]


def test_a_full_disk_is_told():
    """It is no reader that leaves."""

    class Full(io.BytesIO):
        def flush(self):
            raise OSError(errno.ENOSPC, "No space left on device")

    with open("/dev/full", "wb") as full, pytest.raises(OutputError, match="written: No space left on device"):
        Pipe(0, full.fileno()).send(b"{}")
    with contextlib.closing(Datagrams(0, sink=Full())) as door, pytest.raises(OutputError, match="No space left"):
        door.send(b"{}")


def test_a_flood_of_one_line_takes_no_memory(ends):
    """Of a line without an end, no more is kept than a frame may have."""
    piece = b"x" * 60_000
    for _ in range(20):
        ends.write(piece)
        assert ends.opening.receive() == []
        assert len(ends.opening._rest) <= FRAME_BYTES
    ends.write("", frame(0.0))
    too_long, good = ends.opening.receive()
    assert (too_long.text, good.text) == (None, frame(0.0).encode())


def test_a_reader_that_leaves_ends_it(ends):
    """With nobody to answer, the robot is left where it is told to be last."""
    with serving(Toy(), ends.opening) as found:
        read(ends.lines)
        ends.lines.close()
        ends.write(frame(0.0))
        wait(lambda: found)
        assert found[0].worked == 1


def shown(ends, count, toy):
    """Send frames one by one, until so many are worked; nobody reads."""
    for i in range(count):
        ends.write(frame(0.01 * i))
        wait(lambda: len(toy.asked) > i)  # noqa: B023 - it is called before the next `i`


def test_a_reader_that_does_not_read_is_not_waited_for(ends):
    """The robot goes on; answers that nobody takes are lost and counted, those that come are whole, and it ends."""
    fcntl.fcntl(ends.lines, fcntl.F_SETPIPE_SZ, 8192)
    toy = Toy()
    with serving(toy, ends.opening) as found:
        shown(ends, 60, toy)
        assert len(toy.asked) >= 60
        told = [read(ends.lines) for _ in range(20)]
        assert [one["frame"] for one in told[1:]] == [0.01 * i for i in range(19)]
    assert 0 < found[0].lost < 60
    assert f"{found[0].lost} answers lost since nobody read them" in str(found[0])


def test_where_every_frame_is_worked_a_reader_is_waited_for(ends):
    """Nothing is lost; a bell ends it all the same."""
    fcntl.fcntl(ends.lines, fcntl.F_SETPIPE_SZ, 8192)
    toy = Toy()
    with serving(toy, ends.opening, every=True) as found:
        ends.write(*(frame(0.01 * i) for i in range(100)))
        assert [read(ends.lines).get("frame", -0.01) for _ in range(101)] == [0.01 * i for i in range(-1, 100)]
        ends.write(*(frame(0.01 * i) for i in range(100, 200)))
        wait(lambda: len(toy.asked) > 101)
    assert found[0].worked > 100


def test_datagrams_are_answered_to_who_sent_them(guest):
    """Nonsense too; a flood of it is taken in pieces, and frames in its midst are worked."""
    opening = Datagrams(0)
    door = ("127.0.0.1", opening.about["udp"])
    with serving(Toy(), opening) as found:
        guest.sendto(b"{}", door)
        assert json.loads(guest.recv(9999))["udp"] == door[1]
        guest.sendto(frame(0.0, 2.0).encode(), door)
        assert json.loads(guest.recv(9999))["joints"]["lift"] == 2.0
        guest.sendto(b"", door)
        assert "must be JSON" in json.loads(guest.recv(9999))["error"]
    opening.close()
    assert (found[0].worked, found[0].refused) == (1, 1)
    crowd = Datagrams(0)
    for _ in range(AT_ONCE + 10):
        guest.sendto(b"x", ("127.0.0.1", crowd.about["udp"]))
    assert 0 < len(crowd.receive()) <= AT_ONCE
    crowd.close()


def test_answers_can_go_to_one_port(guest):
    """The first line too; senders get none."""
    opening = Datagrams(0, send=guest.getsockname()[1])
    with serving(Toy(), opening), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        assert json.loads(guest.recv(9999))["points"] == [*NAMES]
        other.sendto(frame(0.0).encode(), ("127.0.0.1", opening.about["udp"]))
        assert json.loads(guest.recv(9999))["state"] == "following"
    opening.close()


def test_ports_that_cannot_be_are_told(guest):
    """Taken or none; the sentence says what to do instead."""
    with pytest.raises(InvalidInputError, match="Port 0 takes a free one"):
        Datagrams(guest.getsockname()[1])
    with pytest.raises(InvalidInputError, match="udp must be a whole number"):
        Datagrams(99_999)
    with pytest.raises(InvalidInputError, match="send must be a whole number"):
        Datagrams(0, send=0)
    with pytest.raises(InvalidInputError, match="another port than udp"):
        Datagrams(9000, send=9000)


def test_times_are_those_of_a_sorted_list():
    """Quantiles agree with NumPy's to the width of a bin; the largest is exact; without any there is nan."""
    times, drawn = Histogram(), np.exp(np.random.default_rng(0).normal(-8.0, 1.0, 5000))
    assert np.isnan(times.quantile(0.5))
    for one in drawn:
        times.add(one)
    for share in (0.5, 0.9, 0.999):
        assert times.quantile(share) == pytest.approx(np.quantile(drawn, share, method="inverted_cdf"), rel=0.01)
    assert times.largest == drawn.max()


def test_a_frame_that_comes_late_counts_from_when_it_came(ends):
    """The robot has gone on by itself beyond its time; it is answered, with its own time, as is the next."""
    toy = Toy()
    with serving(toy, ends.opening) as found:
        read(ends.lines)
        ends.write(frame(0.0), frame(0.01, 1.0))
        assert read(ends.lines)["frame"] == 0.01
        braking = read(ends.lines)
        assert (braking["state"], braking["frame"]) == ("holding", None)
        for t in (0.015, 0.02):
            ends.write(frame(t, 2.0))
            told = read(ends.lines)
            while told["state"] == "holding":
                told = read(ends.lines)
            assert (told["frame"], told["joints"]["lift"]) == (t, 2.0)
    assert found[0].skipped == 1
    assert np.all(np.diff(toy.asked) > 0.0)
