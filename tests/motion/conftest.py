"""The robot that most tests of tracking move, and what is known of it."""

import numpy as np
import pytest

from maniport.arms import VELOCITY, Arm, load_arm
from maniport.motion import MotionLimits, Planner, SeedBank
from sizes import little_search


@pytest.fixture(scope="session")
def panda():
    """The Panda to its flange."""
    return load_arm("panda", frame="panda_link8")


@pytest.fixture(scope="session")
def crane():
    """A small arm of a slide and three revolute joints."""
    rows = [[0, 0, 0, np.pi / 2], [0, 0.1, 0.5, 0], [0, 0, 0.4, 0.7], [0, 0, 0.2, 0]]
    return Arm.from_dh("crane", rows, [-0.5, -2, -2, -2], [0.5, 2, 2, 2], kinds=["prismatic", *["revolute"] * 3])


@pytest.fixture(scope="session")
def bank(panda):
    """A small bank of starts for it."""
    return SeedBank(panda, 4096)


@pytest.fixture(scope="session")
def planner(panda):
    """A planner for it with few samples, which knows collisions."""
    with little_search():
        return Planner.of(MotionLimits.of(panda), VELOCITY)
