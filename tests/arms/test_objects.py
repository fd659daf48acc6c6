"""Arms from models of Pinocchio, MuJoCo and yourdfpy are those of the same files."""

import importlib
import pickle
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import inertias

from crane import CRANE
from maniport.arms import Arm, load_arm
from maniport.arms.collisions import Collisions
from maniport.arms.loaders.packages import find_robot
from maniport.errors import InvalidInputError, UnknownNameError
from real_robots import NEEDS_ROBOTS

URDF = """<robot name="lab"><link name="base"/>
  <link name="one"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
  <link name="two"><inertial><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="three"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="meshes/part.stl"/></geometry></visual></link>
  <link name="flange"/><link name="camera"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.1" rpy="0.1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2.5" effort="30" velocity="2"/></joint>
  <joint name="out" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0 0 0.4"/>
    <axis xyz="0.6 0 0.8"/><limit lower="0" upper="0.5" effort="20" velocity="0.3"/></joint>
  <joint name="bend" type="revolute"><parent link="two"/><child link="three"/><origin xyz="0.1 0 0" rpy="0 0.3 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="3"/></joint>
  <joint name="tip" type="fixed"><parent link="three"/><child link="flange"/><origin xyz="0.3 0 0" rpy="0 0 1"/></joint>
  <joint name="eye" type="fixed"><parent link="flange"/><child link="camera"/><origin xyz="0 0.1 0"/></joint>
</robot>"""

MJCF = """<mujoco model="lab"><compiler angle="degree" autolimits="true"/>
  <worldbody><body name="one" pos="0 0 0.1" euler="5 0 0">
    <joint name="turn" axis="0 0 1" range="-100 150" ref="10" armature="0.2" actuatorfrcrange="-30 30"/>
    <geom name="g1" type="capsule" size="0.05 0.15" pos="0 0 0.2" mass="2"/>
    <body name="two" pos="0 0 0.4"><joint name="out" type="slide" axis="0.6 0 0.8" range="0 0.5" pos="0.1 0 0"/>
      <geom name="g2" type="box" size="0.05 0.04 0.03" mass="1"/>
      <geom type="mesh" mesh="wedge" contype="0" conaffinity="0" mass="0.1"/>
      <body name="three" pos="0.1 0 0"><joint name="bend" axis="0 1 0" range="-60 60"/>
        <geom name="g3" type="cylinder" size="0.03 0.2" pos="0.3 0 0" euler="0 90 0" mass="0.5"/>
        <site name="attachment_site" pos="0.5 0 0" euler="0 0 30"/>
        <body name="four" pos="0.5 0 0"><joint name="roll" axis="1 0 0" range="-90 90"/>
          <geom name="g4" type="ellipsoid" size="0.03 0.05 0.02" mass="0.3"/></body></body></body></body></worldbody>
  <asset><mesh name="wedge" vertex="0 0 0 0.1 0 0 0 0.1 0 0 0 0.1 0.05 0.05 0.02"/></asset>
  <contact><exclude body1="one" body2="three"/></contact>
  <equality><joint joint1="roll" joint2="bend" polycoef="0.1 0.5 0 0 0"/></equality>
  <actuator><motor joint="out" gear="2" ctrlrange="-10 10"/><position joint="bend" forcerange="-9 9"/></actuator>
</mujoco>"""


def assert_same_arm(first, second, atol=1e-9):
    q = first.sample(16, random_state=0)
    assert second.joint_names == first.joint_names
    assert second.joint_units == first.joint_units
    assert second.frame == first.frame
    np.testing.assert_allclose(second.forward(q), first.forward(q), atol=atol)
    np.testing.assert_allclose(second.jacobian(q), first.jacobian(q), atol=atol)
    np.testing.assert_allclose([second.lower, second.upper], [first.lower, first.upper], atol=atol)
    for name in ("velocity_limits", "effort_limits"):
        expected = getattr(first, name)
        if expected is None:
            assert getattr(second, name) is None
        else:
            np.testing.assert_allclose(getattr(second, name), expected)
    if first.chain.inertia is not None:
        torques = first.gravity_torques(q)
        np.testing.assert_allclose(second.gravity_torques(q), torques, atol=1e-6)
        np.testing.assert_allclose(inertias(second, q), inertias(first, q), rtol=1e-5, atol=1e-6)


def yourdfpy(monkeypatch):
    """Return the package, or a module with what is used of it: a URDF with the files of its meshes."""
    try:
        return importlib.import_module("yourdfpy")
    except ImportError:
        module = ModuleType("yourdfpy")
        module.URDF = StandIn
        monkeypatch.setitem(sys.modules, "yourdfpy", module)
        return module


class StandIn:
    """A URDF as yourdfpy holds it: in writing it replaces names of meshes by files."""

    def __init__(self, path):
        self.path = Path(path)
        self.robot = SimpleNamespace(name=ElementTree.parse(path).getroot().get("name"))

    @classmethod
    def load(cls, path):
        return cls(path)

    def write_xml_string(self):
        root = ElementTree.parse(self.path).getroot()
        for mesh in root.iter("mesh"):
            mesh.set("filename", str(self.path.parent / mesh.get("filename")))
        return ElementTree.tostring(root)


@pytest.fixture
def robot(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.2, 0.05, 0.05)).export(tmp_path / "meshes" / "part.stl")
    path = tmp_path / "lab.urdf"
    path.write_text(URDF)
    return path


@pytest.mark.parametrize("frame", [None, "flange", "two"])
def test_a_model_of_pinocchio(robot, frame):
    model = pin.buildModelFromUrdf(str(robot))
    assert_same_arm(load_arm(robot, frame), Arm.of(model, frame))


def test_a_base_joints_and_locked_positions(robot):
    model = pin.buildModelFromUrdf(str(robot))
    options = {"frame": "flange", "joints": ["turn", "bend"], "lock": {"out": 0.2}}
    assert_same_arm(load_arm(robot, **options), Arm.of(model, **options))
    assert_same_arm(load_arm(robot, "flange", base="one"), Arm.of(model, "flange", base="one"))


def test_a_floating_base_is_at_rest(robot):
    model = pin.buildModelFromUrdf(str(robot), pin.JointModelFreeFlyer())
    arm = Arm.of(model, "flange")
    q = arm.sample(4, random_state=0)
    np.testing.assert_allclose(arm.forward(q), load_arm(robot, "flange").forward(q), atol=1e-12)


def test_continuous_joints_frames_and_gravity_of_pinocchio(tmp_path):
    (tmp_path / "crane.urdf").write_text(CRANE)
    model = pin.buildModelFromUrdf(str(tmp_path / "crane.urdf"))
    hook = model.getFrameId("hook")
    placement = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.2]))
    joint = model.frames[hook].parentJoint
    model.addFrame(pin.Frame("grasp", joint, hook, placement, pin.OP_FRAME))
    model.gravity.linear = np.array([0.0, 1.0, -9.0])
    arm = Arm.of(model, "grasp")
    expected = load_arm(tmp_path / "crane.urdf", "hook")
    q = expected.sample(4, random_state=0)
    np.testing.assert_allclose(arm.forward(q), expected.forward(q) @ placement.homogeneous)
    assert arm.chain.gravity == (0.0, 1.0, -9.0)
    assert arm.chain.unlimited == ("turn",)
    assert arm.chain.shapes is None


def test_mimic_joints_of_pinocchio(tmp_path):
    text = CRANE.replace(
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>\n  <joint name="look"',
        '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
        '<mimic joint="up" multiplier="2" offset="0.1"/></joint>\n  <joint name="look"',
    )
    assert "mimic" in text
    path = tmp_path / "crane.urdf"
    path.write_text(text)
    model = pin.buildModelFromXML(text, mimic=True)
    assert_same_arm(load_arm(path, "hook"), Arm.of(model, "hook"))


def test_a_model_built_by_hand_without_frames_of_bodies():
    model = pin.Model()
    model.name = "own"
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "a")
    place = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    model.addJoint(first, pin.JointModelRevoluteUnaligned(0.0, 0.6, 0.8), place, "b")
    model.lowerPositionLimit[:] = -1.0
    model.upperPositionLimit[:] = 1.0
    arm = Arm.of(model, "b")
    data = model.createData()
    q = arm.sample(1, random_state=0)[0]
    pin.forwardKinematics(model, data, q)
    np.testing.assert_allclose(arm.forward(q), data.oMi[2].homogeneous, atol=1e-12)


def test_a_joint_of_several_axes_is_refused():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.addJoint(joint, pin.JointModelRX(), pin.SE3.Identity(), "x")
    with pytest.raises(ValueError, match="Spherical"):
        Arm.of(model, "x")


def test_a_model_of_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "lab.xml"
    path.write_text(MJCF)
    for frame in (None, "four", "two"):
        assert_same_arm(
            load_arm(path, frame), Arm.of(mujoco.MjModel.from_xml_string(MJCF), frame), 1e-7
        )


def test_collisions_of_a_model_of_mujoco_are_those_of_its_file(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "lab.xml"
    path.write_text(MJCF)
    first = Collisions.of(load_arm(path, "four"))
    arm = Arm.of(mujoco.MjModel.from_xml_string(MJCF), "four")
    second = Collisions.of(arm)
    assert second.pairs == first.pairs
    assert second.excluded == first.excluded
    q = arm.sample(64, random_state=0)
    if first.pairs:
        np.testing.assert_allclose(second.clearance(q), first.clearance(q), atol=1e-6)
    drawn = {link: mesh[0] for link, mesh in arm.geometry.shapes.items()}
    expected = load_arm(path, "four").geometry.shapes
    assert drawn.keys() == expected.keys()
    for link, points in drawn.items():
        np.testing.assert_allclose(
            np.ptp(points, axis=0), np.ptp(expected[link][0], axis=0), atol=1e-6
        )


def test_an_arm_of_a_model_can_be_sent_to_a_worker(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    arm = Arm.of(mujoco.MjModel.from_xml_string(MJCF), "four")
    again = pickle.loads(pickle.dumps(arm))
    assert_same_arm(arm, again)
    assert again.geometry.checked.shapes


def test_a_model_of_yourdfpy(robot, monkeypatch):
    arm = Arm.of(yourdfpy(monkeypatch).URDF.load(str(robot)), "flange")
    expected = load_arm(robot, "flange")
    assert_same_arm(expected, arm)
    for link, (points, _) in expected.geometry.shapes.items():
        np.testing.assert_allclose(
            np.ptp(arm.geometry.shapes[link][0], axis=0), np.ptp(points, axis=0)
        )
    assert Collisions.of(arm).pairs == Collisions.of(expected).pairs


@NEEDS_ROBOTS
@pytest.mark.parametrize("name", ["xarm7", "ur5", "baxter_left_arm", "so100"])
def test_robots_of_a_package(name):
    expected = load_arm(name)
    file = find_robot(name).path
    model = pin.buildModelFromUrdf(str(file))
    base = expected.base
    arm = Arm.of(model, expected.frame, base=base)
    assert_same_arm(expected, arm, 1e-6)


@pytest.mark.parametrize("model", [None, "panda", 3, object()])
def test_other_objects_are_refused(model):
    with pytest.raises(InvalidInputError, match="MjModel"):
        Arm.of(model)


def test_an_unknown_frame_is_named(robot):
    with pytest.raises(UnknownNameError, match="flang"):
        Arm.of(pin.buildModelFromUrdf(str(robot)), "flang")


def test_a_sliding_joint_without_limits_is_refused():
    model = pin.Model()
    model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.lowerPositionLimit[:] = -np.inf
    model.upperPositionLimit[:] = np.inf
    with pytest.raises(InvalidInputError, match="slide"):
        Arm.of(model, "slide")
