"""The robot of these tests."""

import pytest

from maniport.arms import load_arm
from maniport.motion import SeedBank


@pytest.fixture(scope="session")
def panda():
    return load_arm("panda", frame="panda_link8")


@pytest.fixture(scope="session")
def bank(panda):
    return SeedBank(panda, 512)
