"""Arms and robot files that several tests use."""

from pathlib import Path

import numpy as np
import pytest

from crane import two_arms
from maniport.arms import Arm, ArmGroup

URDF = """<robot name="crane">
  <link name="base"/><link name="post"/><link name="boom"/><link name="trolley"/><link name="cable"/>
  <link name="hook"/><link name="camera"/><link name="swing"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="post"/>
    <origin xyz="0 0 0.4" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/></joint>
  <joint name="raise" type="revolute"><parent link="post"/><child link="boom"/>
    <origin xyz="0.1 0 0.2"/><axis xyz="0 1 1"/><limit lower="-1" upper="1.5" effort="1" velocity="2"/></joint>
  <joint name="travel" type="prismatic"><parent link="boom"/><child link="trolley"/>
    <origin xyz="0.5 0.1 0"/><axis xyz="1 0 0"/><limit lower="0.1" upper="0.6" effort="1" velocity="0.5"/></joint>
  <joint name="level" type="revolute"><parent link="trolley"/><child link="cable"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/><mimic joint="raise" multiplier="-0.5" offset="0.2"/></joint>
  <joint name="weld" type="fixed"><parent link="cable"/><child link="camera"/><origin xyz="0 0.05 0.02"/></joint>
  <joint name="spin" type="revolute"><parent link="camera"/><child link="swing"/><origin rpy="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0" effort="1" velocity="0"/></joint>
  <joint name="end" type="fixed"><parent link="swing"/><child link="hook"/>
    <origin xyz="0.1 0 -0.3" rpy="0 1 0"/></joint>
</robot>
"""

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
    """A planar arm with two links of one meter."""
    return Arm.from_dh("planar", np.array([[0.0, 0, 1, 0], [0, 0, 1, 0]]))


@pytest.fixture(scope="session")
def crane() -> ArmGroup:
    """Two arms with four joints each on a trunk that turns and rises."""
    return two_arms()
