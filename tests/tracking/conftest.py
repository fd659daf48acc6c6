"""The robot that most tests of tracking move."""

import pytest

from maniport.bodies import load_arm
from maniport.tracking import StartBank, robot_model


@pytest.fixture(scope="session")
def panda():
    """The Panda to its flange."""
    return load_arm("panda", frame="panda_link8")


@pytest.fixture(scope="session")
def model(panda):
    """Its Pinocchio model."""
    return robot_model(panda)


@pytest.fixture(scope="session")
def bank(panda):
    """A small bank of starts for it."""
    return StartBank.build(panda, 4096)
