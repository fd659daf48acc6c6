"""Kills at random moments, a few: ``make kills`` tries hundreds, of the whole way too."""

import random
import signal

import pytest

from kills.trial import strike, works

TIMES = 4


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    return works(tmp_path_factory.mktemp("kills"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("key", ["fit", "folder"])
def test_what_is_struck_leaves_old_or_new(tmp_path, every, key, number):
    every[key].warm()
    count = strike(every[key], number, TIMES, random.Random(0), tmp_path / "log")
    assert count["struck"] == TIMES
    assert set(+count) <= {"struck", "old", "new"}
