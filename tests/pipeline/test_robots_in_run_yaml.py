"""run.yaml of a motion names the robot that moved, so that its command repeats that one."""

import numpy as np
import pytest
import yaml

import maniport as mp
from crane import CRANE
from maniport.arms import load_arm, load_arms
from maniport.errors import InvalidInputError
from maniport.pipeline import follow_profile
from maniport.pipeline.config import Config
from maniport.pipeline.settings import load_robot
from real_robots import NEEDS_ROBOTS
from sizes import little_search


def followed(robot, arms, q=None, damping=0.01, **options):
    """A short motion of a robot, along its own ellipsoids."""
    time = np.linspace(0.0, 0.4, 5)
    middle = 0.5 * (robot.lower + robot.upper) if q is None else q
    joints = np.linspace(middle, middle + 0.02, 5)
    targets = []
    for arm in arms:
        ellipsoids = arm.ellipsoids(joints[:, : arm.dof])
        target = mp.motion.TargetTrajectory.checked(arm, time, ellipsoids, damping=damping)
        targets.append(target)
    with little_search():
        return follow_profile(robot, targets, collisions=False, **options)


def repeated(result, folder):
    """Write a result, and load the robot of its configuration."""
    mp.write_results(result, folder)
    return load_robot(Config.load(folder / "run.yaml"))


def assert_same_robot(first, second):
    q = first.sample(8, random_state=0)
    assert first.joint_names == second.joint_names
    np.testing.assert_allclose(second.jacobian(q), first.jacobian(q), atol=1e-9)
    np.testing.assert_allclose(second.forward(q), first.forward(q), atol=1e-9)


def test_another_robot_than_the_default_one(tmp_path):
    crane = tmp_path / "crane.urdf"
    crane.write_text(CRANE)
    arm = load_arm(crane)
    result = followed(arm, [arm])
    assert_same_robot(arm, repeated(result, tmp_path / "out"))
    settings = yaml.safe_load((tmp_path / "out" / "run.yaml").read_text())
    assert settings["robot"]["robot"] == [str(crane)]


def test_a_frame_a_base_and_locked_joints(tmp_path):
    arm = load_arm("panda", "panda_link7", base="panda_link1", lock={"panda_joint3": 0.5})
    assert_same_robot(arm, repeated(followed(arm, [arm]), tmp_path / "out"))


def test_moving_joints_named_when_the_arm_was_loaded(tmp_path):
    arm = load_arm("panda", joints=["panda_joint1", "panda_joint2", "panda_joint4"])
    assert_same_robot(arm, repeated(followed(arm, [arm]), tmp_path / "out"))


def test_options_of_a_robot_of_another_name_do_not_stay(panda, tmp_path):
    config = Config(robot=("xarm7",), frame=("link_eef",), joints=("joint1",))
    result = followed(panda, [panda], config=config)
    assert_same_robot(panda, repeated(result, tmp_path / "out"))


def test_the_payload_is_that_of_the_options(panda, tmp_path):
    result = followed(panda, [panda], payload=(1.5,), payload_center=(0.0, 0.0, 0.1))
    loaded = repeated(result, tmp_path / "out")
    assert loaded.chain.payload == pytest.approx(1.5)
    assert result.arm.robot.chain.payload == pytest.approx(1.5)
    q = panda.sample(4, random_state=0)
    np.testing.assert_allclose(result.arm.robot.gravity_torques(q), loaded.gravity_torques(q))


def test_a_payload_that_run_yaml_would_lose_is_refused(panda):
    with pytest.raises(InvalidInputError, match="payload"):
        followed(panda.with_payload(1.0), [panda])


@pytest.mark.parametrize(
    "bases",
    [
        [(0.0, 0.4, 0.0), (0.0, -0.4, 0.1, 0.3)],
        [np.eye(4), mp.arms.chain.pose((0.0, 0.8, 0.0), (0.3, 0.1, 0.2))],
    ],
    ids=["upright", "inclined"],
)
def test_robots_in_one_world(tmp_path, bases):
    group = load_arms("panda", bases=bases, lock={"left_panda_joint3": 0.2})
    result = followed(group, group.arms, np.tile([0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.0], 2)[1:])
    loaded = repeated(result, tmp_path / "out")
    assert_same_robot(group, loaded)
    assert loaded.names == group.names


@NEEDS_ROBOTS
def test_arms_of_one_robot(tmp_path):
    group = load_arms("baxter")
    result = followed(group, group.arms)
    assert_same_robot(group, repeated(result, tmp_path / "out"))


def test_a_damping_in_python_is_written(panda, tmp_path):
    result = followed(panda, [panda], damping=0.02)
    mp.write_results(result, tmp_path / "out")
    assert Config.load(tmp_path / "out" / "run.yaml").damping == 0.02
