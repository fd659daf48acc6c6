"""Kills at random moments, a few: ``make kills`` tries hundreds, of the whole way too."""

import random
import signal

import pytest

from kills.__main__ import strike, works

TIMES = 4


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    work = works(tmp_path_factory.mktemp("kills"))["fit"]
    work.warm()
    return work


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_what_is_struck_leaves_old_or_new(tmp_path, fit, number):
    count = strike(fit, number, TIMES, random.Random(0), tmp_path / "log")
    assert count["struck"] == TIMES
    assert set(+count) <= {"struck", "old", "new"}
