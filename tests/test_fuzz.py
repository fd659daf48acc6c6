"""A few mutated files of every format; ``make fuzz`` tries many, in separate processes."""

import os

import pytest

from fuzz.__main__ import READ, REFUSED, mutation, outcome
from fuzz.targets import TARGETS

COUNT = 300 if os.environ.get("CI") else 20


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_files_are_read_or_refused(tmp_path, name):
    path = tmp_path / f"file{TARGETS[name].suffix}"
    for number in range(COUNT):
        assert outcome(TARGETS[name], path, mutation(name, number)) in (READ, REFUSED), number
