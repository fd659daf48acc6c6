"""Robots that show something, for tests of surfaces, and what those tests measure."""

from pathlib import Path

import numpy as np

from fuzz.mesh_examples import stl
from maniport.arms import Arm, Surface, load_arm

LIMIT = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'
ROBOT = f"""<robot name="digger">
  <link name="base"><visual><origin xyz="0 0 0.05" rpy="0.1 0 0"/><geometry><box size="0.3 0.2 0.1"/></geometry>
    </visual>
    <collision><geometry><mesh filename="package://digger/none.stl"/></geometry></collision></link>
  <link name="boom"><visual><origin xyz="0.1 0 0"/><geometry><mesh filename="boom.stl" scale="2 1 1"/></geometry>
    </visual>
    <visual><geometry><cylinder radius="0.04" length="0.2"/></geometry></visual></link>
  <link name="flange"/>
  <link name="bucket"><visual><origin rpy="0 0.5 1"/><geometry><sphere radius="0.06"/></geometry></visual></link>
  <link name="tooth"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <link name="lamp"><visual><geometry><box size="0.02 0.02 0.02"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.1" rpy="0.2 0 0.4"/>
    <axis xyz="0 1 1"/>{LIMIT}</joint>
  <joint name="weld" type="fixed"><parent link="boom"/><child link="lamp"/><origin xyz="0 0.1 0" rpy="1 0 0"/></joint>
  <joint name="push" type="prismatic"><parent link="boom"/><child link="flange"/><origin xyz="0.4 0 0" rpy="0 0.3 0"/>
    <axis xyz="1 0 0"/>{LIMIT}</joint>
  <joint name="hang" type="fixed"><parent link="flange"/><child link="bucket"/><origin xyz="0 0 0.1"/></joint>
  <joint name="bite" type="revolute"><parent link="bucket"/><child link="tooth"/>{LIMIT}</joint>
</robot>
"""


def volume(surface: Surface) -> float:
    """Volume within a closed surface; positive when its triangles are counter-clockwise from outside."""
    a, b, c = (surface.points[column] for column in surface.triangles.T)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def drawn(arm: Arm, q: np.ndarray) -> np.ndarray:
    """All corners of an arm in its base frame, in a fixed order."""
    poses = arm.link_poses(q)
    points = [s.points @ poses[s.joint, :3, :3].T + poses[s.joint, :3, 3] for s in arm.geometry.surfaces(None)]
    return ordered(np.concatenate(points))


def ordered(points: np.ndarray) -> np.ndarray:
    """Points without repetition, sorted along a skew direction."""
    points = points[np.argsort(points @ (1.0, 0.618034, 0.414214))]
    return points[np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-7])]


def write_digger(folder: Path) -> Path:
    """An arm with a box, a scaled mesh, a cylinder and a ball, a lamp on its side and a tooth that moves."""
    (folder / "boom.stl").write_bytes(stl())
    path = folder / "digger.urdf"
    path.write_text(ROBOT)
    return path


def one_link(folder: Path, geometry: str, origin: str = "") -> Arm:
    """An arm whose one moving link shows one thing, from a file in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "one.urdf"
    path.write_text(
        f'<robot name="one"><link name="base"/><link name="tip"><visual>{origin}<geometry>{geometry}</geometry>'
        f'</visual></link><joint name="j" type="revolute"><parent link="base"/><child link="tip"/>{LIMIT}</joint>'
        "</robot>"
    )
    return load_arm(path)
