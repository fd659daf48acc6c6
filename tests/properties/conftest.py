"""The robot of these tests."""

import pytest

from maniport.arms import load_arm


@pytest.fixture(scope="session")
def panda():
    return load_arm("panda", frame="panda_link8")
