"""Mutated files of every format, in few: ``make fuzz`` tries many, in processes of their own."""

import os

import pytest
from fuzz.trial import READ, REFUSED, files, outcome

from fuzz.targets import TARGETS

EACH = 300 if os.environ.get("CI") else 100


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_files_are_read_or_refused(tmp_path, name):
    """What stands in a file gives a result or an error of maniport's own, never another."""
    target = TARGETS[name]
    path = tmp_path / f"file{target.suffix}"
    for number, content in files(target, name, 0, EACH):
        assert outcome(target, path, content) in (READ, REFUSED), number
