"""How the command begins and ends: Ctrl-C from the first import on, outputs that are closed or full, names too long."""

import os
import signal
import subprocess
import sys

import pytest

from maniport.files import load_ellipsoids

COMMAND = [sys.executable, "-m", "maniport"]
INTERRUPTED_WHEN_STARTED = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from maniport.__main__ import main
main()
"""


@pytest.mark.parametrize("name", ["maniport.cli", "maniport.errors", "typer", "numpy", "maniport.cli.view"])
def test_ctrl_c_while_it_is_loading(name):
    """At any import it ends with exit code 130 and one sentence."""
    code = INTERRUPTED_WHEN_STARTED.format(name=name)
    ended = subprocess.run([sys.executable, "-c", code, "info", "panda"], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "maniport: interrupted; nothing was written\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize("closing", [">/dev/full", ">&-", "<&- >&-"])
def test_an_output_that_cannot_be_written_is_an_error(closing):
    """Full or closed: one sentence, with exit code 1."""
    words = ["sh", "-c", f'exec "$0" "$@" {closing}', *COMMAND, "info", "panda", "--json"]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
    assert "cannot print the result" in ended.stderr


@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
def test_no_file_takes_the_number_of_a_closed_output(tmp_path):
    """With both outputs closed the file of the result holds the result alone."""
    words = ["sh", "-c", 'exec "$0" "$@" <&- >&- 2>&-', *COMMAND, "domain", "panda", "-n", "10", "-o"]
    ended = subprocess.run([*words, str(tmp_path / "domain.npz")], check=False)
    assert ended.returncode == 1
    assert len(load_ellipsoids(tmp_path / "domain.npz")[0]) == 10


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
    # since Python 3.14 a file of such a name is merely not there, so that it is looked for among robots
    unread = "name too long" if sys.version_info < (3, 14) else "unknown robot"
    written = ["domain", "panda", "-n", "10", "-o", str(tmp_path / f"{'x' * 300}.npz")]
    for words, told in ((["info", "x" * 300], unread), (written, "name too long")):
        ended = subprocess.run([*COMMAND, *words], capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
        assert told in ended.stderr


def test_ctrl_c_after_all_is_said_changes_nothing():
    """It is over then."""
    code = (
        "import atexit, os, signal\nfrom maniport.__main__ import main\n"
        f"atexit.register(lambda: os.kill(os.getpid(), {signal.SIGINT:d}))\nmain()"
    )
    ended = subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_one_thread_of_blas_where_nobody_says_otherwise():
    """Threads of BLAS are for who asks for them; a number that somebody gave stays."""
    code = "import os; from maniport import cli; cli.main = lambda: print(*map(os.environ.get, {names}))\n"
    code = code.format(names=("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")) + "from maniport.__main__ import main; main()"
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    given = environment | {"OPENBLAS_NUM_THREADS": "3"}
    for found, expected in ((environment, "1 1"), (given, "3 1")):
        ended = subprocess.run([sys.executable, "-c", code], env=found, capture_output=True, text=True, check=True)
        assert ended.stdout.strip() == expected
