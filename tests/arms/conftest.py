from pathlib import Path

import numpy as np
import pytest

from crane import two_arms
from fuzz.robot_examples import URDF
from maniport.arms import Arm, ArmGroup


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A crane with continuous, revolute, prismatic, mimic and fixed joints and one without limits."""
    path = tmp_path / "crane.urdf"
    path.write_text(URDF)
    return path


@pytest.fixture
def mjcf() -> Path:
    """A bench with two hinges on one body, a slide with an inherited range and a coupled joint."""
    return Path(__file__).parent / "bench.xml"


@pytest.fixture
def planar():
    return Arm.from_dh("planar", np.array([[0.0, 0, 1, 0], [0, 0, 1, 0]]))


@pytest.fixture(scope="session")
def crane() -> ArmGroup:
    """Two arms with four joints each on a trunk that turns and rises."""
    return two_arms()
