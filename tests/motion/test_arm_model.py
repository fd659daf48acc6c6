from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from crane import two_arms
from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.chain import point_mass
from maniport.arms.restriction import carried_inertia
from maniport.motion import robot_model
from maniport.motion.arm_model import model_prefixes
from real_robots import NEEDS_ROBOTS


@pytest.mark.parametrize("robot", ["panda", "few", "pandas", pytest.param("talos", marks=NEEDS_ROBOTS)])
def test_a_model_has_the_kinematics_of_all_arms(robot, panda):
    """Poses and Jacobians of all end effectors are the group's, column by column; shared joints are there once."""
    if robot == "talos":
        arms = mp.load_arms("talos")
    elif robot == "pandas":
        arms = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.1, -0.3, 0.0, 0.2)])
    else:
        names = [f"panda_joint{i}" for i in (1, 2, 4, 6)]
        arms = panda if robot == "panda" else panda.restricted(joints=names)
    model, group = robot_model(arms), as_group(arms)
    assert tuple(model.names)[1:] == arms.joint_names
    assert_array_equal(model.lowerPositionLimit, arms.lower)
    assert_array_equal(model.upperPositionLimit, arms.upper)
    assert_array_equal(model.velocityLimit, arms.velocity_limits)
    frames = [prefix + arm.frame for prefix, arm in zip(model_prefixes(group), group.arms, strict=True)]
    data = model.createData()
    for q in arms.sample(4, 0):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for name, pose, jacobian in zip(frames, group.forward(q), group.jacobian(q), strict=True):
            index = model.getFrameId(name)
            assert_allclose(data.oMf[index].homogeneous, pose, atol=1e-12)
            computed = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
            assert_allclose(computed, jacobian, atol=1e-12)


def test_a_torso_of_two_arms_carries_all_masses_once():
    crane = two_arms()
    links = np.zeros((2, len(crane.arms[0].chain.joints) + 1, 6, 6))
    for arm, own in enumerate(links):
        own[1:] = [point_mass(1.0 + 0.1 * k + arm, np.array([0.1, 0.02 * k, -0.05])) for k in range(1, len(own))]
        own[1:, 3:, 3:] += 0.01 * np.eye(3)
    arms, count = crane.arms, int(crane.common[0, 1])
    links[1, : count + 1] = links[0, : count + 1]
    chains = [replace(arm.chain, inertia=own) for arm, own in zip(arms, links, strict=True)]
    for own, other in ((0, 1), (1, 0)):  # each chain has the other arm at rest as a part of the trunk
        links[own, count] += carried_inertia(chains[other], count)
    group = ArmGroup(*(Arm(replace(c, inertia=own)) for c, own in zip(chains, links, strict=True)), names=crane.names)
    model = robot_model(group)
    q = np.clip(np.zeros(group.dof), group.lower, group.upper)
    gravity = pin.computeGeneralizedGravity(model, model.createData(), q)
    for arm, part, columns in zip(group.arms, group.split(q), group.columns, strict=True):
        assert_allclose(gravity[columns], arm.gravity_torques(part), atol=1e-9)
