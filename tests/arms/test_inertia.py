"""Masses of robot files: dynamics of chains against Pinocchio and MuJoCo, and faults of masses."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import inertias
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import load_arm
from maniport.arms.loaders import read_model
from maniport.arms.loaders.packages import find_robot
from maniport.errors import FileFormatError
from maniport.motion.arm_model import InverseDynamics
from real_robots import NEEDS_ROBOTS


@NEEDS_ROBOTS
@pytest.mark.parametrize(
    "robot", ["example-robot-data/panda", "ur5", "xarm7", "g1_left_arm", "talos_left_arm", "tiago"]
)
def test_dynamics_are_those_of_the_whole_robot(robot):
    """Other limbs and fingers rest at zero, or at the limit next to zero; joints that follow them follow."""
    path = find_robot(robot).path
    arm = load_arm(robot)
    source = read_model(path)
    model = pin.buildModelFromUrdf(str(path))
    positions = arm.sample(3, random_state=0)
    rest = {name: float(np.clip(0.0, *bounds)) for name, bounds in source.bounds.items()}
    columns = [model.joints[model.getJointId(name)].idx_v for name in arm.joint_names]
    gravities = arm.gravity_torques(positions)
    for q, gravity, inertia in zip(positions, gravities, inertias(arm, positions), strict=True):
        at = rest | dict(zip(arm.joint_names, q, strict=True))
        whole = pin.neutral(model)
        for name, follower in source.followers.items():
            at[name] = follower.factor * at[follower.leader] + follower.offset
        for name in filter(model.existJointName, at):  # a mimic of a fixed joint is none
            joint = model.joints[model.getJointId(name)]
            exact = [at[name]] if joint.nq == 1 else [np.cos(at[name]), np.sin(at[name])]
            whole[joint.idx_q : joint.idx_q + joint.nq] = exact
        data = model.createData()
        assert_allclose(
            gravity, pin.computeGeneralizedGravity(model, data, whole)[columns], atol=1e-9
        )
        upper = np.triu(pin.crba(model, data, whole))
        assert_allclose(inertia, (upper + np.triu(upper, 1).T)[np.ix_(columns, columns)], atol=1e-9)


@NEEDS_ROBOTS
def test_the_embedded_panda_weighs_what_its_urdf_does():
    ours = load_arm("panda")
    urdf = load_arm("example-robot-data/panda")
    flange = load_arm("panda", frame="panda_link8")
    assert_array_equal(ours.effort_limits, urdf.effort_limits)
    assert_allclose(ours.chain.inertia[1:], urdf.chain.inertia[1:], atol=1e-12)
    assert_allclose(ours.chain.inertia[-1, 0, 0] - flange.chain.inertia[-1, 0, 0], 0.76)


BOX = '<inertial pos="0.1 0.02 0" quat="1 0.2 0 0.1" mass="{}" diaginertia="0.03 0.02 0.04"/>'
BENCH = f"""<mujoco><compiler angle="degree"/><default><joint armature="0.02"/></default>
  <worldbody><body name="a" pos="0 0 1">{BOX.format(9)}
  <body name="b" pos="0 0.1 0" euler="10 20 30">{BOX.format(2)}<joint name="yaw" axis="0 0 1" ref="-30"/>
  <joint name="pitch" axis="0 1 0" pos="0.1 0 0" ref="10" armature="0.3"/><body name="c" pos="0.5 0 0">{BOX.format(1)}
  <joint name="push" type="slide" axis="1 1 0" range="-0.2 0.3"/><geom size="0.1"/>
  <body name="finger">{BOX.format(0.2)}<joint name="close" axis="1 0 0" range="20 30"/></body></body></body></body>
  </worldbody></mujoco>"""


def test_dynamics_of_an_mjcf_are_mujocos(tmp_path):
    path = tmp_path / "bench.xml"
    path.write_text(BENCH)
    arm = load_arm(path, frame="c")
    model = mujoco.MjModel.from_xml_string(BENCH)
    data = mujoco.MjData(model)
    matrix = np.zeros((4, 4))
    positions = arm.sample(3, random_state=0)
    gravities = arm.gravity_torques(positions)
    inverse = InverseDynamics(arm)
    for q, gravity, inertia in zip(positions, gravities, inertias(arm, positions), strict=True):
        data.qpos[:] = [*q, np.radians(20)]
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, matrix)
        assert_allclose(gravity, data.qfrc_bias[:3], atol=1e-9)
        assert_allclose(inertia, matrix[:3, :3], atol=1e-9)
        still = np.zeros((1, 3))
        torques = gravity + matrix[:3, :3] @ (1.0, 2.0, 3.0)
        assert_allclose(
            inverse.torques(q[None], still, np.array([[1.0, 2.0, 3.0]]))[0], torques, atol=1e-9
        )


@pytest.mark.parametrize(
    "change",
    [
        ("<geom", "<geom name='only'"),
        (BOX.format(1), ""),
        ("angle", 'inertiafromgeom="true" angle'),
    ],
)
def test_masses_that_shapes_determine_are_unknown(tmp_path, change):
    path = tmp_path / "bench.xml"
    path.write_text(BENCH.replace(*change).replace(BOX.format(9), ""))
    assert (load_arm(path, frame="c").chain.inertia is None) == ("only" not in change[1])


LINK = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
TWO = """<robot name="r"><link name="a"/><link name="b"><inertial>{}</inertial></link><joint name="j" type="continuous">
  <parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("name", "text", "change"),
    [
        *(
            ("r.urdf", TWO.format(LINK), change)
            for change in (
                ('value="1"', 'value="-1"'),
                ('value="1"', 'value="nan"'),
                ('value="1"', 'value="1e300"'),
                (' value="1"', ""),
                ('ixx="1"', 'ixx="-1"'),
                ('ixy="0"', 'ixy="2"'),
                ('iyz="0"', 'iyz="inf"'),
                (' iyz="0"', ""),
                ("<mass", '<origin xyz="nan 0 0"/><mass'),
                ('<mass value="1"/>', ""),
            )
        ),
        *(
            ("r.xml", BENCH, change)
            for change in (
                ('mass="2"', 'mass="-2"'),
                ("0.03 0.02", "0.03 -0.02"),
                ('mass="2"', 'mass="nan"'),
                ('armature="0.3"', 'armature="-1"'),
            )
        ),
    ],
)
def test_impossible_masses_are_named_with_their_link(tmp_path, name, text, change):
    path = tmp_path / name
    path.write_text(text.replace(*change))
    message = (
        r"link '[abc]'|<inertial> needs mass|'pitch' needs armature .* not negative; found '-1'"
    )
    with pytest.raises(FileFormatError, match=message):
        load_arm(path)
