"""Robots from URDF and MJCF files."""

import os
import sys

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def tree(*joints: str, links: tuple[str, ...] = ()) -> str:
    """A URDF from joints written as ``name:parent>child[:type]``."""
    names, body = dict.fromkeys(links), ""
    for joint in joints:
        name, ends, kind = [*joint.split(":"), "revolute"][:3]
        parent, child = ends.split(">")
        names |= {parent: None, child: None}
        body += f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        body += f'<origin xyz="0 0 0.1" rpy="0.2 0 0"/><axis xyz="0 1 0"/>{LIMIT}</joint>'
    return f'<robot name="r">{"".join(f"<link name={n!r}/>" for n in names)}{body}</robot>'.replace("'", '"')


@pytest.fixture
def write(tmp_path):
    """Write a robot file and give its path."""

    def write(text: str, name: str = "robot.urdf"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_urdf_joints_become_coordinates(urdf):
    """Continuous joints and joints without limits span one turn, mimic and fixed joints are no coordinates."""
    arm = load_arm(urdf)
    assert arm.name == "crane"
    assert arm.joint_names == ("turn", "raise", "travel", "spin")
    assert arm.frame == "hook"
    np.testing.assert_allclose(arm.lower, [-np.pi, -1, 0.1, -np.pi])
    np.testing.assert_allclose(arm.upper, [np.pi, 1.5, 0.6, np.pi])
    np.testing.assert_array_equal(arm.velocity_limits, [np.inf, 2, 0.5, np.inf])


def test_mjcf_equals_mujoco(mjcf):
    """Two hinges on one body, a slide, a coupled joint and rest angles: poses and limits agree with MuJoCo."""
    if os.environ.get("CI"):
        import mujoco
    else:
        mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(model)
    arm = load_arm(mjcf, frame="tool")
    assert arm.joint_names == ("yaw", "pitch", "roll", "push")
    np.testing.assert_allclose(np.stack([arm.lower, arm.upper], axis=1), model.jnt_range[:4], atol=1e-12)
    for q in arm.sample(20, random_state=0):
        data.qpos[:] = [*q, model.qpos0[4] + 0.1 + 0.5 * (q[2] - model.qpos0[2])]
        mujoco.mj_kinematics(model, data)
        pose = arm.forward(q)
        np.testing.assert_allclose(pose[:3, 3], data.site("tool").xpos, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3], data.site("tool").xmat.reshape(3, 3), atol=1e-12)


def test_fingers_are_left_out(write):
    """Where the longest chains are fingers, the tip is the body that carries them."""
    text = tree("a:base>one", "b:one>two", "w:two>hand:fixed", "f1:hand>left:prismatic", "f2:hand>right:prismatic")
    arm = load_arm(write(text))
    assert (arm.frame, arm.joint_names) == ("hand", ("a", "b"))


def test_two_arms_are_ambiguous(write):
    """A robot with two arms gets an error with the candidates, the hands and not the fingers."""
    arm = (
        "{s}1:base>{s}one",
        "{s}2:{s}one>{s}two",
        "{s}w:{s}two>{s}hand:fixed",
        "{s}f:{s}hand>{s}f1",
        "{s}g:{s}hand>{s}f2",
    )
    path = write(tree(*(joint.format(s=s) for s in ("left_", "right_") for joint in arm)))
    with pytest.raises(InvalidInputError, match=r"several frames.*2 movable.*frame=.*'left_hand', 'right_hand'$"):
        load_arm(path)
    assert load_arm(path, frame="right_hand").joint_names == ("right_1", "right_2")


def test_catalogue_robots_are_loaded_by_name(monkeypatch, urdf):
    """A name from robot_descriptions is looked up in that package when it is installed."""
    package = urdf.parent / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "_descriptions.py").write_text("DESCRIPTIONS = {'crane_description': 0, 'ladder_description': 0}\n")
    (package / "crane_description.py").write_text(f"URDF_PATH = {str(urdf)!r}\n")
    (package / "offline_description.py").write_text("raise OSError('no network')\n")
    monkeypatch.syspath_prepend(str(urdf.parent))
    for name in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, name)  # the real package, where it is installed and was used before
    before = set(sys.modules)
    try:
        assert load_arm("crane_description", frame="boom").joint_names == ("turn", "raise")
        with pytest.raises(UnknownNameError, match=r"'cran_description' .*first: 'crane_description', "):
            load_arm("cran_description")
        with pytest.raises(UnknownNameError, match=r"'offline_description' could not be fetched.*no network"):
            load_arm("offline_description")
    finally:
        for name in set(sys.modules) - before:
            if name.startswith("robot_descriptions"):
                del sys.modules[name]


SEGMENTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="segment" params="n parent length">
  <link name="link${n}"/><joint name="j${n}" type="revolute"><parent link="${parent}"/><child link="link${n}"/>
  <origin xyz="0 0 ${length}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</xacro:macro></robot>"""


def test_xacro_is_its_urdf(write, capfd):
    """Macros out of an included file, arguments and sums give the arm that one would write by hand, and no chatter."""
    pytest.importorskip("xacrodoc")
    write(SEGMENTS, "segments.xacro")
    header = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:arg name="reach" default="0.1"/>'
    text = (
        f'{header}<xacro:include filename="segments.xacro"/><link name="base"/><xacro:segment n="1" parent="base" '
        'length="$(arg reach)"/><xacro:segment n="2" parent="link1" length="${2 * 0.15}"/></robot>'
    )
    arm = load_arm(write(text, "arm.urdf.xacro"))
    assert (arm.joint_names, arm.frame) == (("j1", "j2"), "link2")
    np.testing.assert_allclose(arm.forward([0.0, 0.0])[:3, 3], [0, 0, 0.4], atol=1e-12)
    with pytest.raises(FileFormatError, match=r"broken\.xacro: xacro cannot expand it: .*no\.xacro"):
        load_arm(write(f'{header}<xacro:include filename="no.xacro"/></robot>', "broken.xacro"))
    with pytest.raises(FileFormatError, match=r"there is no package 'nowhere' above its folder or in ROS_PACKAGE_PATH"):
        load_arm(write(f'{header}<xacro:include filename="$(find nowhere)/a.xacro"/></robot>', "broken.xacro"))
    load_arm(write(text.replace("<link", '<xacro:property name="len" value="1"/><link'), "shadow.xacro"))
    assert capfd.readouterr() == ("", "")
    with pytest.raises(FileFormatError, match=r"robot\.urdf: this is a xacro file; let its name end in \.xacro"):
        load_arm(write(text))
