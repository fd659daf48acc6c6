"""A few mutated files of every format; ``make fuzz`` reads many, in processes of their own."""

import pytest

from fuzz.__main__ import READ, REFUSED, mutation, outcome
from fuzz.targets import TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_mutated_files_are_read_or_refused(tmp_path, name):
    """A mutated file gives a result or a ManiportError, never another exception."""
    path = tmp_path / f"file{TARGETS[name].suffix}"
    for number in range(40):
        assert outcome(TARGETS[name], path, mutation(name, number)) in (READ, REFUSED), number
