import numpy as np
import pytest

from maniport.arms import VELOCITY, Arm
from maniport.motion import MotionLimits, Planner, SeedBank
from sizes import little_search


@pytest.fixture(scope="session")
def crane():
    rows = [[0, 0, 0, np.pi / 2], [0, 0.1, 0.5, 0], [0, 0, 0.4, 0.7], [0, 0, 0.2, 0]]
    return Arm.from_dh(
        "crane", rows, [-0.5, -2, -2, -2], [0.5, 2, 2, 2], kinds=["prismatic", *["revolute"] * 3]
    )


@pytest.fixture(scope="session")
def bank(panda):
    return SeedBank(panda, 4096)


@pytest.fixture(scope="session")
def planner(panda):
    with little_search():
        return Planner.of(MotionLimits.of(panda), VELOCITY)
