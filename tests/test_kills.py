"""Kills at random moments, a few: ``make kills`` tries hundreds, of the whole way too."""

import random
import signal

import pytest

from kills.trial import complete, strike
from kills.works import Command, works

TIMES = 4


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    return works(tmp_path_factory.mktemp("kills"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("key", ["fit", "folder"])
def test_what_is_struck_leaves_old_or_new(tmp_path, every, key, number):
    work, log = every[key], tmp_path / "log"
    work.warm()
    longest = max(complete(work, which, log) for which in (1, 0)) if isinstance(work, Command) else 0.02
    *_, count = strike(work, number, TIMES, longest, random.Random(0), log)
    assert (count.half, count.missing, count.struck, count.faults) == (0, 0, TIMES, [])
