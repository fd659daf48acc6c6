"""The command `maniport view`: it starts, prints where, and ends with Ctrl-C."""

import signal
import subprocess
import sys
import urllib.request
from types import SimpleNamespace

import pytest

from maniport import cli

pytest.importorskip("viser")


QUICK = """
from maniport import __main__ as entry_point
from maniport.viewer import prepare
prepare.TEACHER_SAMPLES, prepare.STUDENT_SAMPLES, prepare.BANK_SIZE = 128, 256, 512
entry_point.main()
"""
"""The command line in a process of its own, on a small scale."""

ENDLESS = """
import threading
from maniport.viewer.maps import Maps
from maniport.viewer.state import ViewState
ViewState.find_place = lambda *given: None
fit = Maps.fit
def endless(self, name, base_rotation):
    if name != prepare.AT_ONCE:
        print("fitting", flush=True)
        threading.Event().wait()
    return fit(self, name, base_rotation)
Maps.fit = endless
entry_point.main()
"""
"""The same, where a fit does not end."""


@pytest.fixture
def run(monkeypatch, capsys):
    """Call the command in this process; return exit code, standard output and standard error."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["maniport", "view", *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return int(stop.value.code or 0), *capsys.readouterr()

    return call


@pytest.fixture
def bare_robot(tmp_path):
    """A robot's file whose mesh is missing."""
    links = "".join(f'<link name="l{i}"/>' for i in range(3))
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="0 0 0.3"/>'
        f'<axis xyz="{axis}"/><limit lower="-2" upper="2" effort="9" velocity="2"/></joint>'
        for i, axis in enumerate(("0 0 1", "0 1 0", "1 0 0"))
    )
    hand = '<link name="l3"><visual><geometry><mesh filename="hand.stl"/></geometry></visual></link>'
    file = tmp_path / "robot.urdf"
    file.write_text(f'<robot name="bare">{links}{hand}{joints}</robot>')
    return file


def test_it_starts_and_ends_with_ctrl_c(bare_robot, tmp_path):
    """The printed page answers; Ctrl-C ends it with exit code 0, and does not wait for a fit that never ends.

    A robot whose meshes are missing is shown all the same, and one line says which and why.
    """
    files = set(tmp_path.iterdir())
    code = QUICK.replace("entry_point.main()", ENDLESS)
    command = [sys.executable, "-c", code, "view", "--person", "rhuman", "--robot", str(bare_robot)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as view:
        url = view.stdout.readline().split()[0]
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=60) as answer:
            assert answer.status == 200
        assert view.stdout.readline() == "fitting\n"
        view.send_signal(signal.SIGINT)
        try:
            out, err = view.communicate(timeout=30)
        finally:
            view.kill()
    assert view.returncode == 0
    assert "Traceback" not in out + err
    (line,) = [line for line in err.splitlines() if "skeleton" in line]
    assert "hand.stl" in line
    assert set(tmp_path.iterdir()) == files


def test_a_page_that_is_open_to_others_says_so(run, monkeypatch):
    """One line says who can come in; without --host there is none."""

    class Page(SimpleNamespace):
        def __init__(self, *_):
            super().__init__(no_surface="", url="http://here", stop=lambda: None)

        def run_until_interrupted(self, announce):
            announce()

    monkeypatch.setattr("maniport.viewer.prepare.prepare", lambda *_, **__: (None, None, None))
    monkeypatch.setattr("maniport.viewer.server.LiveView", Page)
    assert "open to other machines" in run("--host", "0.0.0.0")[2]
    assert "open to" not in run()[2]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--person", "nobody"], "unknown person"),
        (["--side", "both"], "--pose"),
        (["--pose", "0,0,0,0"], "--pose"),
        (["--side", "both", "--tips", "relative"], "--tips"),
        (["--side", "both", "--robot", "panda", "--robot", "ur5"], "--pose"),
        (["--robot", "nothing"], "unknown robot 'nothing'"),
        (["--port", "99999"], "[0, 65535]"),
        (["--adapter", "missing.npz"], "missing.npz"),
        (["--recording", "missing.bvh"], "missing.bvh"),
    ],
)
def test_bad_words_end_with_one_sentence(run, words, told):
    """What cannot be used is told before anything is listened to, with exit code 2."""
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert told in err
    assert "Traceback" not in err
