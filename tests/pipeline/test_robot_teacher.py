"""The motion of a robot is a demonstration for another robot."""

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport import spd
from maniport.cli import app
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.pipeline.robot_teacher import (
    RobotDemonstration,
    read_demonstration,
    transfer_demonstration,
)
from sizes import SIX_ROWS, little_search, panda_profile

SMALL = {"n_teacher": 64, "n_student": 256, "collisions": False, "rate": 100.0}


@pytest.fixture(scope="module")
def demonstration():
    panda, time, joints, *_ = panda_profile()
    return RobotDemonstration.of_arm(panda, joints, time)


def test_a_demonstration_has_the_ellipsoids_and_the_path_of_the_arm(demonstration):
    panda, _, joints, ellipsoids, path = panda_profile()
    np.testing.assert_array_equal(demonstration.ellipsoids(Config()), ellipsoids)
    np.testing.assert_array_equal(demonstration.path, path)
    assert len(demonstration.subsampled(5.0).time) == 6
    with pytest.raises(InvalidInputError):
        RobotDemonstration.of_arm(panda, joints[1:], demonstration.time)


def test_a_robot_of_the_same_kind_repeats_its_own_motion(demonstration):
    with little_search():
        result = transfer_demonstration(demonstration, "panda", method="identity", **SMALL)
    np.testing.assert_allclose(
        spd.distance(result.arm.motion.achieved, result.arm.motion.target).mean(), 0.0, atol=0.25
    )


def test_another_robot_follows(demonstration):
    six = mp.Arm.from_dh("six", SIX_ROWS, -3.1, 3.1)
    with little_search():
        result = transfer_demonstration(demonstration, six, method="parallel-transport", **SMALL)
    assert result.arm.robot.name == "six"
    assert result.arm.motion.joint_positions.shape[1] == 6
    assert np.all(np.isfinite(result.arm.motion.distance))


def test_a_motion_is_read_from_a_file(demonstration, tmp_path):
    time = demonstration.time
    header = ",".join(["time_s", *(f"{name}_rad" for name in demonstration.arm.joint_names)])
    table = np.column_stack([time, demonstration.joint_positions])
    np.savetxt(tmp_path / "joints.csv", table, delimiter=",", header=header, comments="")
    read = read_demonstration(tmp_path / "joints.csv", demonstration.arm)
    np.testing.assert_allclose(read.joint_positions, demonstration.joint_positions, atol=1e-12)
    with pytest.raises(InvalidInputError, match="episode"):
        read_demonstration(tmp_path / "joints.csv", demonstration.arm, episode=3)


def test_the_command_writes_options_that_repeat_it(demonstration, tmp_path):
    header = ",".join(["time_s", *(f"{name}_rad" for name in demonstration.arm.joint_names)])
    table = np.column_stack([demonstration.time, demonstration.joint_positions])
    file = tmp_path / "joints.csv"
    np.savetxt(file, table, delimiter=",", header=header, comments="")
    words = ("--teacher", "panda", "--robot", "panda", "--method", "identity", "--no-collisions")
    sizes = ("--n-teacher", "64", "--n-student", "256", "--rate", "100")
    with little_search():
        done = CliRunner().invoke(
            app, ["transfer", str(file), *words, *sizes, "-o", str(tmp_path / "out"), "-q"]
        )
    assert done.exit_code == 0, done.output
    config = Config.load(tmp_path / "out" / "run.yaml")
    assert (config.teacher, config.recording, config.robot) == ("panda", (str(file),), ("panda",))
    assert (tmp_path / "out" / "run.yaml").read_text().splitlines()[0].count("maniport transfer")
    assert (tmp_path / "out" / "joints.csv").is_file()
