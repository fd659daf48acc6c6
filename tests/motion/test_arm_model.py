import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from maniport.arms import as_group
from maniport.motion import robot_model
from maniport.motion.arm_model import model_prefixes
from real_robots import NEEDS_ROBOTS


@pytest.mark.parametrize(
    "robot", ["panda", "few", "pandas", pytest.param("talos", marks=NEEDS_ROBOTS)]
)
def test_a_model_has_the_kinematics_of_all_arms(robot, panda):
    """Poses and Jacobians of all end effectors are the group's, column by column; shared joints are there once."""
    if robot == "talos":
        arms = mp.load_arms("talos")
    elif robot == "pandas":
        arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.1, -0.3, 0.0, 0.2)])
    else:
        names = [f"panda_joint{i}" for i in (1, 2, 4, 6)]
        arms = panda if robot == "panda" else panda.restricted(joints=names)
    model = robot_model(arms)
    group = as_group(arms)
    assert tuple(model.names)[1:] == arms.joint_names
    assert_array_equal(model.lowerPositionLimit, arms.lower)
    assert_array_equal(model.upperPositionLimit, arms.upper)
    assert_array_equal(model.velocityLimit, arms.velocity_limits)
    frames = [
        prefix + arm.frame for prefix, arm in zip(model_prefixes(group), group.arms, strict=True)
    ]
    data = model.createData()
    for q in arms.sample(4, 0):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for name, pose, jacobian in zip(frames, group.forward(q), group.jacobian(q), strict=True):
            index = model.getFrameId(name)
            assert_allclose(data.oMf[index].homogeneous, pose, atol=1e-12)
            computed = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
            assert_allclose(computed, jacobian, atol=1e-12)


TREE = {
    "trunk": "base",
    "left1": "trunk",
    "left2": "left1",
    "right1": "trunk",
    "right2": "right1",
    "third2": "right1",
}


@pytest.mark.parametrize("frames", [("left2", "right2", "third2"), ("third2", "left2", "right2")])
def test_arms_that_fork_one_after_another_have_all_masses_once(tmp_path, frames):
    """The dynamics are those of the whole robot, also where two of three arms share a joint more."""
    links = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.1 {0.02 * k} -0.05"/><mass value="{1 + k}"/>'
        f'<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="to_{name}" '
        f'type="revolute"><parent link="{parent}"/><child link="{name}"/><axis xyz="0 {k % 2} {(k + 1) % 2}"/>'
        f'<origin xyz="0.2 0.1 {0.1 * k}"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
        for k, (name, parent) in enumerate(TREE.items())
    )
    (path := tmp_path / "tree.urdf").write_text(
        f'<robot name="tree"><link name="base"/>{links}</robot>'
    )
    group = mp.load_arms(path, frames=frames)
    whole = pin.buildModelFromUrdf(str(path))
    columns = [whole.joints[whole.getJointId(name)].idx_v for name in group.joint_names]
    model = robot_model(group)
    state = np.zeros((3, whole.nv))
    state[:, columns] = values = group.sample(3, 0)
    expected = pin.rnea(whole, whole.createData(), *state)[columns]
    assert_allclose(pin.rnea(model, model.createData(), *values), expected, atol=1e-9)
