"""The command `maniport view`: it starts, prints its address, and ends with Ctrl-C."""

import signal
import subprocess
import sys
import urllib.request

import pytest

pytestmark = pytest.mark.slow

pytest.importorskip("viser")

ENDLESS = """
import threading
from maniport import __main__ as entry_point
from maniport.viewer import state
from maniport.viewer.state import Fits, ViewState
state.TEACHER_SAMPLES, state.STUDENT_SAMPLES = 128, 256
ViewState.find_places = lambda *args: None
fit = Fits.fit
def endless(self, name, base_rotation):
    if name != state.AT_ONCE:
        print("fitting", flush=True)
        threading.Event().wait()
    return fit(self, name, base_rotation)
Fits.fit = endless
entry_point.main()
"""
"""The command line in a process of its own, on a small scale, with a fit that does not end."""


def test_it_starts_and_ends_with_ctrl_c(tmp_path):
    """Ctrl-C ends it with exit code 0, without waiting for a fit; a robot without its mesh is drawn, with a warning."""
    links = "".join(f'<link name="l{i}"/>' for i in range(3))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="0 0 0.3"/>'
        f'<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="9" velocity="2"/></joint>'
        for i, axis in enumerate(("0 0 1", "0 1 0", "1 0 0"))
    )
    hand = (
        '<link name="l3"><visual><geometry><mesh filename="hand.stl"/></geometry></visual></link>'
    )
    robot = tmp_path / "robot.urdf"
    robot.write_text(f'<robot name="bare">{links}{hand}{joints}</robot>')
    command = [sys.executable, "-c", ENDLESS, "view", "--person", "rhuman", "--robot", str(robot)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    ) as view:
        assert view.stdout.readline() == "fitting\n"
        url = view.stdout.readline().split()[0]
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=60) as answer:
            assert answer.status == 200
        view.send_signal(signal.SIGINT)
        try:
            out, err = view.communicate(timeout=300)  # a machine may be busy
        finally:
            view.kill()
    assert view.returncode == 0
    assert "Traceback" not in out + err
    (line,) = [line for line in err.splitlines() if "skeleton" in line]
    assert "hand.stl" in line
    assert list(tmp_path.iterdir()) == [robot]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--person", "nobody"], "unknown person"),
        (["--side", "both"], "--pose"),
        (["--pose", "0,0,0,0"], "--pose"),
        (["--side", "both", "--hand-targets", "relative"], "--hand-targets"),
        (["--robot", "nothing"], "unknown robot 'nothing'"),
        (["--port", "99999"], "[0, 65535]"),
        (["missing.bvh"], "missing.bvh"),
        (["--recording", "missing.bvh"], "missing.bvh"),
        (["missing.bvh", "--recording", "missing.bvh"], "twice"),
    ],
)
def test_invalid_options_end_with_one_sentence(run, words, message):
    code, out, err = run("view", *words)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_the_recording_of_a_configuration_is_shown(run, tmp_path):
    file = tmp_path / "run.yaml"
    file.write_text("recording: [missing.bvh]\n")
    code, _, err = run("view", "--config", file)
    assert code == 2
    assert "missing.bvh" in err
    file.write_text("recording: [missing.bvh, other.bvh]\n")
    code, _, err = run("view", "--config", file)
    assert code == 2
    assert "one recording" in err
