"""How commands begin and end: Ctrl-C from the first import on, outputs that are closed or full."""

import os
import signal
import subprocess
import sys

import pytest

from maniport.util.files import load_ellipsoids

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


@pytest.mark.parametrize("name", ["maniport.cli", "numpy", "maniport.cli.live"])
def test_ctrl_c_during_imports(name):
    code = INTERRUPTED_WHEN_STARTED.format(name=name)
    ended = subprocess.run(
        [sys.executable, "-c", code, "info", "panda"], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (
        130,
        "",
        "maniport: interrupted; nothing was written\n",
    )


@pytest.mark.slow
def test_ctrl_c_in_the_middle_of_the_work_leaves_nothing(tmp_path):
    command = [*COMMAND, "demo", "-o", str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "Read recording" in line:
            break
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "interrupted; nothing was written" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize("closing", [">/dev/full", "<&- >&-"])
def test_an_output_that_cannot_be_written_is_an_error(closing):
    words = ["sh", "-c", f'exec "$0" "$@" {closing}', *COMMAND, "--version"]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
    assert "cannot print the result" in ended.stderr


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
def test_no_file_takes_the_number_of_a_closed_output(tmp_path):
    words = [
        "sh",
        "-c",
        'exec "$0" "$@" <&- >&- 2>&-',
        *COMMAND,
        "domain",
        "panda",
        "-n",
        "10",
        "-o",
    ]
    ended = subprocess.run([*words, str(tmp_path / "domain.npz")], check=False)
    assert ended.returncode == 1
    assert len(load_ellipsoids(tmp_path / "domain.npz")[0]) == 10


@pytest.mark.slow
def test_a_broken_pipe_loses_no_result(tmp_path):
    reading, writing = os.pipe()
    words = [*COMMAND, "domain", "panda", "-n", "10", "-o", str(tmp_path / "domain.npz")]
    with subprocess.Popen(words, stdout=writing, stderr=writing) as process:
        os.close(writing)
        os.close(reading)
    assert process.returncode == 0
    assert (tmp_path / "domain.npz").stat().st_size > 0


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, maniport; heavy = {'numba', 'pinocchio', 'scipy', 'sklearn', 'matplotlib', 'numpy'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_describing_a_robot_loads_neither_recordings_nor_plans():
    code = (
        "import sys; from maniport.__main__ import main\n"
        "sys.argv = ['maniport', 'info', 'panda', '--quiet']\n"
        "try:\n    main()\n"
        "except SystemExit:\n    pass\n"
        "heavy = {'scipy.stats', 'scipy.interpolate', 'scipy.optimize', 'jinja2', 'trimesh', 'maniport.mocap',\n"
        "         'maniport.transfer', 'maniport.batch', 'maniport.motion.search'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    printed = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert printed.splitlines()[-1] == "[]"
