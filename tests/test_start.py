"""How the command begins and ends: Ctrl-C from the first import on, outputs that are closed or full, names too long."""

import os
import signal
import subprocess
import sys

import pytest

COMMAND = [sys.executable, "-m", "maniport"]
INTERRUPTED_WHEN_STARTED = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from maniport.start import main
main()
"""


@pytest.mark.parametrize("name", ["maniport.cli", "maniport.errors", "typer", "numpy", "maniport.cli.view"])
def test_ctrl_c_while_it_is_loading(name):
    """At any import it ends with exit code 130 and one sentence."""
    code = INTERRUPTED_WHEN_STARTED.format(name=name)
    ended = subprocess.run([sys.executable, "-c", code, "info", "panda"], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "maniport: interrupted; nothing was written\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_full_output_is_told():
    """What cannot be printed is said in one sentence, with exit code 1."""
    with open("/dev/full", "w") as full:
        ended = subprocess.run([*COMMAND, "info", "panda"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
    assert "cannot print the result" in ended.stderr


def test_a_reader_that_leaves_loses_no_result(tmp_path):
    """``head`` closes both outputs before anything is printed: the file is written, exit code 0."""
    reading, writing = os.pipe()
    words = [*COMMAND, "domain", "panda", "-n", "10", "-o", str(tmp_path / "domain.npz")]
    with subprocess.Popen(words, stdout=writing, stderr=writing) as process:
        os.close(writing)
        os.close(reading)
    assert process.returncode == 0
    assert (tmp_path / "domain.npz").stat().st_size > 0


def test_a_name_too_long_is_told(tmp_path):
    """One sentence, whatever looked at it first."""
    for words in (["info", "x" * 300], ["domain", "panda", "-n", "10", "-o", str(tmp_path / f"{'x' * 300}.npz")]):
        ended = subprocess.run([*COMMAND, *words], capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
        assert "name too long" in ended.stderr


def test_ctrl_c_after_all_is_said_changes_nothing():
    """It is over then."""
    code = (
        "import atexit, os, signal\nfrom maniport.start import main\n"
        f"atexit.register(lambda: os.kill(os.getpid(), {signal.SIGINT:d}))\nmain()"
    )
    ended = subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
