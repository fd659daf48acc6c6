"""The arms and motions of the paper's experiments."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.studies.paper import trajectories


def test_two_joint_training_rests_one_joint_and_turns_the_other():
    """Twenty trajectories of 20 points, each with one constant joint and a half turn of the other, all different."""
    paths = trajectories.two_dof_training()
    assert paths.shape == (20, 20, 2)
    spans = np.ptp(paths, axis=1)
    assert_allclose(np.sort(spans, axis=1), np.tile([0.0, np.pi], (20, 1)), atol=1e-12)
    assert len({tuple(path.ravel()) for path in paths.round(9)}) == 20
    resting = {
        (int(np.argmin(span)), round(float(np.degrees(path[0, np.argmin(span)]))))
        for path, span in zip(paths, spans, strict=True)
    }
    assert (1, 0) in resting  # the outstretched arm that turns as a whole is in the training


def test_two_joint_evaluation_has_the_published_angles():
    """M-Eval-1 rests joint 2 at -135° and M-Eval-2 joint 1 at -110°; none of the three is in the training."""
    paths = trajectories.two_dof_evaluation()
    assert list(paths) == ["M-Eval-1", "M-Eval-2", "M-Eval-3"]
    assert_allclose(np.degrees(paths["M-Eval-1"][:, 1]), -135.0)
    assert_allclose(np.degrees(paths["M-Eval-2"][:, 0]), -110.0)
    training = {tuple(path.ravel().round(9)) for path in trajectories.two_dof_training()}
    assert all(path.shape == (20, 2) and tuple(path.ravel().round(9)) not in training for path in paths.values())


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


def test_human_trajectories_have_the_published_angles():
    """Eight training motions make 400 configurations within the limits; sideways -90° to 130°, upwards 79° to 180°."""
    arm, paths = trajectories.human_arm(), trajectories.human_training()
    assert list(paths) == ["side_90", "side_110", "side_120", "side_150", "up_0", "up_30", "up_45", "up_90"]
    for name, path in paths.items():
        arm.require_within_limits(path)
        kind, angle = name.split("_")
        moving, resting, ends = (0, 1, (-90, 130)) if kind == "side" else (1, 0, (79, 180))
        assert path.shape == (50, 7)
        assert_allclose(np.degrees(path[[0, -1], moving]), ends)
        assert_allclose(np.degrees(path[:, resting]), float(angle))
        assert_allclose(path[:, 2:], 0.0)


def test_human_evaluation_is_not_in_the_training():
    """Four motions within the limits; H-Eval-4 goes upwards in the plane of 60°, and two of them bend the elbow."""
    arm, paths = trajectories.human_arm(), trajectories.human_evaluation()
    training = trajectories.human_training().values()
    assert list(paths) == [f"H-Eval-{i}" for i in range(1, 5)]
    for path in paths.values():
        arm.require_within_limits(path)
        assert path.shape == (50, 7)
        assert not any(np.allclose(path, other) for other in training)
    assert_allclose(np.degrees(paths["H-Eval-4"][:, 0]), 60.0)
    assert_allclose(np.degrees(paths["H-Eval-1"][:, 1]), 140.0)
    assert_allclose(np.degrees(paths["H-Eval-2"][-1, 3]), 130.0)
    assert_allclose(np.degrees(paths["H-Eval-3"][-1, :4]), [90, 90, 40, 90])


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


def test_panda_trajectories_are_the_same_every_time():
    """The search is deterministic: the same path gives the same bits."""
    path = trajectories.human_evaluation()["H-Eval-3"]
    assert np.array_equal(trajectories.robot_path(path), trajectories.robot_path(path))
