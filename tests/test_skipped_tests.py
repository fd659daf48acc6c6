"""What one run skips another one runs: `skipped_tests`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

TESTS = """
import os, pytest
HERE = bool(os.environ.get("HERE"))

@pytest.mark.skipif(not HERE, reason="not here")
@pytest.mark.parametrize("text", ["a b", "c::d[e]"])
def test_mark(text):
    pass

def test_within():
    if not HERE:
        pytest.skip("not here")

@pytest.mark.xfail
def test_expected():
    assert False

def test_always():
    pass
"""
MODULE = """
import os, pytest
if not os.environ.get("HERE"):
    pytest.skip("not here", allow_module_level=True)

def test_of_a_module():
    pass
"""


def run(folder, *names, **more):
    """Run tests of a folder in a new process; return the exit code and the output."""
    words = [sys.executable, "-m", "pytest", "-p", "skipped_tests", "-p", "no:cacheprovider"]
    usual = {name: value for name, value in os.environ.items() if not name.startswith("MANIPORT")}
    environment = {**usual, "PYTHONPATH": str(Path(__file__).parent), **more}
    ended = subprocess.run(
        [*words, *names], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    return ended.returncode, ended.stdout


def test_a_second_run_has_what_the_first_skipped(tmp_path):
    (tmp_path / "test_a.py").write_text(TESTS)
    (tmp_path / "test_b.py").write_text(MODULE)
    file = tmp_path / "skipped.txt"
    assert run(tmp_path, MANIPORT_SKIPPED=str(file))[0] == 0
    names = file.read_text(encoding="utf-8").splitlines()
    assert sorted(names) == [
        "test_a.py::test_mark[a b]",
        "test_a.py::test_mark[c::d[e]]",
        "test_a.py::test_within",
        "test_b.py",
    ]
    code, text = run(tmp_path, *names, "-n", "2", HERE="1", MANIPORT_NEEDS_ALL="1")
    assert (code, "4 passed" in text) == (0, True)
    code, text = run(tmp_path, *names, "-n", "2", MANIPORT_NEEDS_ALL="1")
    assert code == 1
    assert all(text.count(name) for name in names)
