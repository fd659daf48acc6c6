from pathlib import Path

import numpy as np
import pytest

from crane import two_arms
from fuzz.robot_examples import URDF
from maniport.arms import Arm, ArmGroup

MJCF = """<mujoco model="bench">
  <compiler angle="degree"/>
  <default><default class="slider"><joint type="slide" range="-0.3 0.4"/></default></default>
  <worldbody>
    <body name="lower" pos="0 0 1" euler="30 10 20"><geom size="0.1"/>
      <joint name="yaw" axis="0 0 1" range="-90 90"/><joint name="pitch" axis="0 1 0" range="-50 60"/>
      <body name="upper" pos="0.5 0 0" euler="30 0 0"><geom size="0.1"/>
        <joint name="roll" axis="1 0 0" pos="0.1 0 0" range="-90 80" ref="10"/>
        <body name="sled" pos="0.2 0 0"><geom size="0.1"/>
          <joint name="push" class="slider" axis="0 1 1"/>
          <body name="tip" pos="0.3 0 0"><geom size="0.1"/>
            <joint name="nod" axis="0 1 0" range="-90 90" ref="-5"/>
            <site name="tool" pos="0 0 0.1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="nod" joint2="roll" polycoef="0.1 0.5 0 0 0"/></equality>
</mujoco>
"""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A crane with continuous, revolute, prismatic, mimic and fixed joints and one without limits."""
    path = tmp_path / "crane.urdf"
    path.write_text(URDF)
    return path


@pytest.fixture
def mjcf(tmp_path: Path) -> Path:
    """A bench with two hinges on one body, a slide with an inherited range and a coupled joint."""
    path = tmp_path / "bench.xml"
    path.write_text(MJCF)
    return path


@pytest.fixture
def planar():
    return Arm.from_dh("planar", np.array([[0.0, 0, 1, 0], [0, 0, 1, 0]]))


@pytest.fixture(scope="session")
def crane() -> ArmGroup:
    """Two arms with four joints each on a trunk that turns and rises."""
    return two_arms()
