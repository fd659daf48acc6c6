"""The arms and motions of the paper's experiments."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.studies.paper import trajectories


def test_two_joint_arms_differ_by_the_mounting_alone():
    """At the same joint angles S = R_b T R_bᵀ exactly; the teacher moves in x-y and the student in y-z."""
    teacher, student = trajectories.two_dof_arms()
    q = teacher.sample(50, 0)
    turn = trajectories.MOUNTING
    assert_allclose(student.manipulability(q), turn @ teacher.manipulability(q) @ turn.T, atol=1e-15)
    assert_allclose(teacher.forward(np.zeros(2))[:3, 3], [2, 0, 0], atol=1e-15)
    assert_allclose(teacher.manipulability(q)[:, 2], 0.0, atol=1e-15)
    assert_allclose(student.manipulability(q)[:, 0], 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("degrees", "hand"),
    [
        ({}, (0, 0, -0.6315)),
        ({1: 90}, (0, -0.6315, 0)),
        ({0: 90, 1: 90}, (0.6315, 0, 0)),
        ({3: 90}, (0.3295, 0, -0.302)),
    ],
)
def test_human_arm_is_the_published_one(degrees, hand):
    """The hand is where the published table puts it, in a trunk frame that a quarter turn about z takes to theirs."""
    arm, q = trajectories.human_arm(), np.zeros(7)
    for joint, angle in degrees.items():
        q[joint] = np.radians(angle)
    assert_allclose(arm.forward(q)[:3, 3], hand, atol=1e-12)


def test_panda_follows_the_scaled_hand_path_within_its_limits():
    """Every Panda trajectory stays within the limits and within a millimetre of its target, without jumps."""
    arm = trajectories.robot_arm()
    human = trajectories.human_training() | trajectories.human_evaluation()
    robot = trajectories.robot_training() | trajectories.robot_evaluation()
    assert list(human) == list(robot)
    for name, path in robot.items():
        arm.require_within_limits(path)
        assert (
            np.linalg.norm(arm.forward(path)[:, :3, 3] - trajectories.robot_targets(human[name]), axis=1).max() < 1e-3
        )
        assert np.degrees(np.abs(np.diff(path, axis=0)).max()) < 5.0
