"""The command `maniport live`: frames in, answers out; wrong options are reported before any work."""

import json
import os
import signal
import socket
import sys
import threading

import numpy as np
import pytest

from maniport import cli
from maniport.live import Live


@pytest.fixture
def recorded(small_result, second, tmp_path):
    second.save(tmp_path / "person.npz")
    positions = second.select(Live.of(small_result).points).positions
    rows = zip(second.time.tolist(), positions.tolist(), strict=True)
    return (
        tmp_path / "person.npz",
        [json.dumps({"t": t, "points": points}) for t, points in rows],
        second.time,
    )


@pytest.fixture
def live(monkeypatch, capfdbinary, small_result):
    """Call the command with a finished transfer; return exit code, lines of output and standard error."""
    monkeypatch.setattr("maniport.pipeline.transfer_recording", lambda *_, **__: small_result)

    def call(*words, lines=()):
        reading, writing = os.pipe()
        os.write(writing, "".join(f"{line}\n" for line in lines).encode())
        os.close(writing)
        with open(reading) as source, monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", source)
            patch.setattr(sys, "argv", ["maniport", "live", *map(str, words)])
            with pytest.raises(SystemExit) as stop:
                cli.main()
        out, err = capfdbinary.readouterr()
        return (
            int(stop.value.code or 0),
            [json.loads(line) for line in out.splitlines()],
            err.decode(),
        )

    return call


@pytest.mark.slow
def test_every_line_is_answered(live, recorded, small_result):
    """First the expected points, then a line for each frame; at the end the robot rests, and a summary is printed."""
    path, lines, time = recorded
    code, (first, start, error, *rest), err = live(
        path, "--no-drop", "--auto-engage", lines=[lines[0], "nonsense", *lines[1:]]
    )
    arm = small_result.arm.robot
    assert code == 0
    assert first["points"] == list(Live.of(small_result).points)
    assert first["start"] == start["joints"]
    assert (start["state"], error["line"]) == ("approaching", 2)
    q = np.array([list(answer["joints"].values()) for answer in rest])
    assert np.all((q >= arm.lower - 1e-9) & (q <= arm.upper + 1e-9))
    assert [answer["frame"] for answer in rest if answer["frame"] is not None] == time[1:].tolist()
    assert rest[-1]["state"] == "holding"
    assert f"{len(time)} frames answered, 0 skipped (newer frames available), 1 invalid" in err
    assert "99.9 %" in err
    assert "of the person's motion" in err
    assert "waited for" not in err
    code, (_, answer, *_), err = live(path, lines=lines)
    assert (code, answer["frame"], answer["skipped"]) == (0, time[-1], len(time) - 1)
    assert "--no-drop" in err


@pytest.mark.parametrize("consent", [[], ['{"engage": true}'], ["--auto-engage"]])
def test_a_file_without_consent_moves_nothing(live, recorded, consent):
    """The remedies that the warning names work: a line before the frames, and the option."""
    path, lines, _ = recorded
    options = [word for word in consent if word.startswith("--")]
    orders = [word for word in consent if not word.startswith("--")]
    code, (_, *answers), err = live(path, "--no-drop", *options, lines=[*orders, *lines[:15]])
    assert code == 0
    states = {answer["state"] for answer in answers}
    assert bool(states & {"approaching", "following", "lagging"}) == bool(consent)
    assert ("waiting" in states) == (not consent)
    assert ("engage" in err) == (not consent)


def test_ctrl_c_brings_the_robot_to_rest(live, recorded):
    path, lines, _ = recorded
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    answers = []

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as guest:
            guest.settimeout(0.2)
            waiting = 1
            while waiting:  # a slow start answers several greetings at once: all of them are read
                if not answers:
                    guest.sendto(b"{}", ("127.0.0.1", port))
                try:
                    answers.append(json.loads(guest.recv(9999)))
                except OSError:
                    waiting = not answers
            guest.settimeout(60.0)
            for line in lines[:20]:
                guest.sendto(line.encode(), ("127.0.0.1", port))
                answers.append(json.loads(guest.recv(9999)))
            os.kill(os.getpid(), signal.SIGINT)
            while answers[-1].get("state") != "holding":
                answers.append(json.loads(guest.recv(9999)))

    sender = threading.Thread(target=send)
    sender.start()
    code, (first,), err = live(path, "--udp", port, "--auto-engage")
    sender.join(60.0)
    assert not sender.is_alive()
    assert answers[-1]["state"] == "holding"
    assert (code, first["udp"]) == (0, port)
    assert "frames answered" in err
    assert "open to other machines" not in err


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (("missing.bvh",), "missing.bvh"),
        (("missing.bvh", "--send", 9000), "--udp"),
        (("missing.bvh", "--export", "ros2"), "--export"),
        (("missing.bvh", "--udp", 99_999), "[0, 65535]"),
        (("missing.bvh", "--udp", 0, "--host", "no.such.host.invalid"), "no.such.host.invalid"),
    ],
)
def test_wrong_options_are_refused(live, words, word):
    code, out, err = live(*words)
    assert (code, out) == (2, [])
    assert word in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("closed", "words", "text"),
    [
        ("stdin", ("freeform",), "is closed"),
        ("stdout", ("freeform",), "is closed"),
        ("full", ("freeform",), "No space left"),
        (None, ("ladder", "--robot", "nothing", "--udp", "0"), "unknown robot 'nothing'"),
    ],
)
def test_closed_streams_and_unknown_robots_are_refused(monkeypatch, run, closed, words, text):
    with open("/dev/full", "w") as full:
        if closed is not None:
            monkeypatch.setattr(sys, *(("stdout", full) if closed == "full" else (closed, None)))
        code, _, err = run("live", *words)
    assert (code, text in err) == (2, True)
