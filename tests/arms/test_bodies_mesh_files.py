"""Meshes of robots: finding them by their names, reading them, and what is wrong with them in words."""

import os
from pathlib import Path

import numpy as np
import pytest
from drawn_arms import one_link, volume, write_digger

from fuzz.mesh_examples import stl
from maniport.arms import Arm, load_arm
from maniport.arms.restriction import mirrored
from maniport.errors import FileFormatError


@pytest.fixture
def digger(tmp_path) -> Path:
    """The file of the digger."""
    return write_digger(tmp_path)


NAMES = {
    "beside": ("part.stl", "part.stl"),
    "relative": ("../meshes/part.stl", "../meshes/part.stl"),
    "package above": ("package://kit/meshes/part.stl", "../../kit/meshes/part.stl"),
    "inside its package": ("package://robot/meshes/part.stl", "../meshes/part.stl"),
    "model": ("model://kit/part.stl", "../../kit/part.stl"),
    "three slashes": ("package:///kit/part.stl", "../../kit/part.stl"),
    "package under another name": ("package://other/meshes/part.stl", "../meshes/part.stl"),
    "ROS": ("package://kit/part.stl", "../../../elsewhere/ros/kit/part.stl"),
    "ROS 2": ("package://kit/part.stl", "../../../elsewhere/ros2/share/kit/part.stl"),
}


@pytest.mark.parametrize("case", NAMES)
def test_meshes_are_found_by_their_names(tmp_path, monkeypatch, case):
    """Relative names count from the robot's file; packages are looked for above it and where ROS has them."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'nowhere'}{os.pathsep}{tmp_path / 'elsewhere/ros'}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "elsewhere/ros2"))
    name, place = NAMES[case]
    folder = tmp_path / "ws" / "robot" / "urdf"
    file = Path(os.path.normpath(folder / place))
    file.parent.mkdir(parents=True)
    file.write_bytes(stl())
    monkeypatch.chdir(tmp_path)
    assert len(one_link(folder, f'<mesh filename="{name}"/>').surfaces()[0].points) == 4


def test_missing_meshes_are_named_only_when_they_are_drawn(tmp_path):
    """Kinematics needs no mesh; drawing says which is missing, how many, and where it was looked for."""
    arm = one_link(tmp_path, '<mesh filename="package://kit/part.stl"/>')
    assert arm.forward([0.1]).shape == (4, 4)
    with pytest.raises(FileFormatError, match=r"one\.urdf: the mesh 'package://kit/part\.stl' is missing \(1 of 1 .*"
                       r"the package 'kit' in .* and every folder above.*ROS_PACKAGE_PATH"):  # fmt: skip
        arm.surfaces()
    with pytest.raises(FileFormatError, match=r"'part\.stl' is missing.*looked at '.*part\.stl'"):
        one_link(tmp_path, '<mesh filename="part.stl"/>').surfaces()


ROD = '<collision name="rod"><origin xyz="0.1 0 0" rpy="0 1 0"/><geometry>{}</geometry></collision>'


def test_collision_shapes_stand_in_for_missing_meshes(digger):
    """A link whose mesh is missing looks as what it collides with, and only that link; it is told which."""
    whole = load_arm(digger, frame="bucket")
    volumes = [volume(surface) for surface in whole.surfaces(None)]
    rod = ROD.format('<cylinder radius="0.05" length="0.3"/>')
    text = digger.read_text().replace('<link name="boom">', f'<link name="boom">{rod}')
    digger.write_text(text.replace('filename="boom.stl"', 'filename="gone.stl"'))
    arm = load_arm(digger, frame="bucket")
    lamp = 0.02**3
    assert arm.geometry.stand_ins() == ("boom",)
    assert whole.geometry.stand_ins() == ()
    found = [volume(surface) for surface in arm.surfaces(None)]
    assert found[1] - lamp == pytest.approx(np.pi * 0.05**2 * 0.3, rel=0.02)  # a mesh of flat sides
    assert [found[0], found[2]] == [volumes[0], volumes[2]]
    assert Arm(mirrored(arm.chain)).geometry.stand_ins() == ("boom",)
    digger.write_text(digger.read_text().replace('<cylinder radius="0.05" length="0.3"/>', '<mesh filename="no.stl"/>'))
    with pytest.raises(FileFormatError, match=r"'gone\.stl' is missing \(1 of 1"):
        load_arm(digger, frame="bucket").surfaces()


SENSELESS = {
    "": "holds no <geometry>", "<mesh/>": "names no file", '<cone radius="1"/>': "has the shape <cone>; allowed",
    '<box size="1 2"/>': "needs size with 3 finite.*found '1 2'", "<box/>": "needs size.*found None",
    '<sphere radius="-1"/>': "needs radius with 1 finite non-negative number; found '-1'",
    '<cylinder radius="1" length="nan"/>': "needs length", '<sphere radius="1e9"/>': "reaches farther than",
    '<mesh filename="part.stl" scale="2"/>': "needs scale with 3 finite numbers; found '2'",
}  # fmt: skip


@pytest.mark.parametrize("geometry", SENSELESS)
def test_senseless_shapes_are_named(tmp_path, geometry):
    """A shape without its numbers, of an unknown kind or beyond reason raises with the link's name."""
    (tmp_path / "part.stl").write_bytes(stl())
    with pytest.raises(FileFormatError, match=rf"link 'tip'.*{SENSELESS[geometry]}"):
        one_link(tmp_path, geometry).surfaces()
