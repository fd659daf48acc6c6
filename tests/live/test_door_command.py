"""The command `maniport live`: frames in, answers out, ends in order; what cannot be used is told before any work."""

import json
import os
import signal
import socket
import sys
import threading
from contextlib import suppress

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport import cli
from maniport.live import Live


@pytest.fixture(scope="module")
def frames(small_result, second):
    """Frames of the person, as the points that are asked for, and their times."""
    points = Live.of(small_result).points
    return second.select(points).positions, second.time


@pytest.fixture
def run(monkeypatch, capfdbinary, small_result):
    """Call the command with a transfer that is done already; return exit code, lines of output and standard error."""
    monkeypatch.setattr("maniport.pipeline.transfer_recording", lambda *_, **__: small_result)

    def call(*words, given=b""):
        reading, writing = os.pipe()
        os.write(writing, given)
        os.close(writing)
        with open(reading) as source, monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", source)
            patch.setattr(sys, "argv", ["maniport", "live", *map(str, words)])
            with pytest.raises(SystemExit) as stop:
                cli.main()
        out, err = capfdbinary.readouterr()
        return int(stop.value.code or 0), [json.loads(line) for line in out.splitlines()], err.decode()

    return call


def lines(positions, time):
    """Frames as a sender writes them."""
    rows = [{"t": t, "points": rows.tolist()} for t, rows in zip(time.tolist(), positions, strict=True)]
    return "".join(json.dumps(row) + "\n" for row in rows).encode()


def test_every_line_is_answered(run, frames, second, tmp_path, small_result):
    """First what is expected, then a line for each; at the end the robot rests, and one sentence tells how it went."""
    second.save(tmp_path / "person.npz")
    positions, time = frames
    given = lines(positions, time).replace(b"\n", b"\nnonsense\n", 1)
    code, (first, start, error, *rest), err = run(tmp_path / "person.npz", "--every", given=given)
    assert code == 0
    arm = small_result.robot
    assert first["points"] == list(Live.of(small_result).points)
    assert first["start"] == start["joints"]
    assert (start["state"], error["line"]) == ("reaching", 2)
    q = np.array([list(one["joints"].values()) for one in rest])
    assert list(rest[0]["joints"]) == list(arm.joint_names)
    assert np.all((q >= arm.lower - 1e-9) & (q <= arm.upper + 1e-9))
    assert [one["frame"] for one in rest if one["frame"] is not None] == time[1:].tolist()
    assert np.all(np.diff([one["t"] for one in rest]) > 0.0)
    assert rest[-1]["state"] == "holding"
    assert f"{len(time)} frames answered, 0 skipped since newer ones waited, 1 refused" in err
    assert "99.9 %" in err
    assert "--every" not in err


def test_a_file_that_is_read_as_it_comes_tells_how_to_work_it_all(run, frames, second, tmp_path):
    """Most of its frames wait at once; the newest is worked."""
    second.save(tmp_path / "person.npz")
    code, (_, answer, *_), err = run(tmp_path / "person.npz", given=lines(*frames))
    assert (code, answer["frame"], answer["skipped"]) == (0, frames[1][-1], len(frames[1]) - 1)
    assert "--every processes all of them" in err


def test_ctrl_c_brings_the_robot_to_rest(run, frames, second, tmp_path):
    """While frames come by UDP; then it ends with exit code 0."""
    second.save(tmp_path / "person.npz")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    found, ended = [], threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guest:
            guest.settimeout(0.2)
            while not found:
                guest.sendto(b"{}", ("127.0.0.1", port))
                try:
                    found.append(json.loads(guest.recv(9999)))
                except OSError:
                    continue
            guest.settimeout(60.0)
            for line in lines(*frames).splitlines()[:20]:
                guest.sendto(line, ("127.0.0.1", port))
                found.append(json.loads(guest.recv(9999)))
            os.kill(os.getpid(), signal.SIGINT)
            assert ended.wait(60.0)
            guest.setblocking(False)
            with suppress(BlockingIOError):  # all answers are there
                while True:
                    found.append(json.loads(guest.recv(9999)))

    sender = threading.Thread(target=send)
    sender.start()
    code, (first,), err = run(tmp_path / "person.npz", "--udp", port)
    ended.set()
    sender.join(60.0)
    assert not sender.is_alive()
    assert found[-1]["state"] == "holding"
    assert (code, first["udp"]) == (0, port)
    assert "frames answered" in err
    assert "open to other machines" not in err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("missing.bvh",), "missing.bvh"),
        (("missing.bvh", "--send", 9000), "give --udp, too"),
        (("missing.bvh", "--export", "ros2"), "--export writes a motion"),
        (("missing.bvh", "--udp", 99_999), "udp must be a whole number in [0, 65535]"),
        (("missing.bvh", "--udp", 0, "--host", "no.such.host.invalid"), "cannot listen on host 'no.such.host.invalid'"),
        (("missing.bvh", "--robot", "nothing"), "unknown robot 'nothing'"),
    ],
)
def test_bad_words_end_with_one_sentence(run, words, told):
    """What cannot be used is told with exit code 2, before anything is read."""
    code, out, err = run(*words)
    assert (code, out) == (2, [])
    assert told in err
    assert "Traceback" not in err


@pytest.mark.parametrize(("stream", "told"), [("stdin", "input is closed"), ("stdout", "output is closed")])
def test_what_is_closed_is_told(monkeypatch, capsys, stream, told):
    """Before any long work, as where a shell was told `<&-` or `>&-`."""
    monkeypatch.setattr(sys, stream, None)
    monkeypatch.setattr(sys, "argv", ["maniport", "live", "freeform"])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    assert stop.value.code == 2
    assert f"standard {told}" in capsys.readouterr().err


def test_neither_unit_nor_axes_of_frames_matter(small_result, frames):
    """Turned about any axis, moved, and in millimetres, the same frames give the same joint positions."""
    positions, time = frames[0][:15], frames[1][:15]
    turned = 1e3 * positions @ Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix().T + [50.0, -7.0, 300.0]
    one, other = Live.of(small_result, clock=None), Live.of(small_result, clock=None)
    for t, here, there in zip(time, positions, turned, strict=True):
        np.testing.assert_allclose(
            one.step(here, t).joint_positions, other.step(there, t).joint_positions, atol=1e-6, rtol=0.0
        )
