"""The robot that the laws of bodies and motions are tried on."""

import pytest

from maniport.arms import load_arm
from maniport.motion import SeedBank


@pytest.fixture(scope="session")
def panda():
    """The Panda to its flange."""
    return load_arm("panda", frame="panda_link8")


@pytest.fixture(scope="session")
def bank(panda):
    """A few starts for it."""
    return SeedBank.build(panda, 512)
