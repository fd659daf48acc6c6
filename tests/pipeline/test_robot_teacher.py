"""The motion of a robot is a demonstration for another robot."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport import spd
from maniport.cli import app
from maniport.datasets.lerobot import STATE, Episode, Feature, LeRobotDataset, write_lerobot
from maniport.errors import InvalidInputError
from maniport.pipeline.config import Config
from maniport.pipeline.robot_teacher import (
    Demonstration,
    read_demonstration,
    transfer_demonstration,
)
from sizes import SIX_ROWS, little_search, panda_profile

SMALL = {"n_teacher": 64, "n_student": 256, "collisions": False, "rate": 100.0}


@pytest.fixture(scope="module")
def demonstration():
    panda, time, joints, *_ = panda_profile()
    return Demonstration.of_arm(panda, joints, time)


def test_a_demonstration_has_the_ellipsoids_and_the_path_of_the_arm(demonstration):
    panda, _, joints, ellipsoids, path = panda_profile()
    (found,) = demonstration.ellipsoids(Config())
    np.testing.assert_array_equal(found, ellipsoids)
    np.testing.assert_array_equal(demonstration.paths[0], path)
    assert len(demonstration.subsampled(5.0).time) == 6
    with pytest.raises(InvalidInputError):
        Demonstration.of_arm(panda, joints[1:], demonstration.time)


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
    for name in ("summary.md", "summary.json", "report.html"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8")
        visible = re.sub(r"<(style|script)[^>]*>.*?</\1>", "", text, flags=re.DOTALL)
        assert "teacher" in visible, name
        assert not re.search(r"\b(person|human)\b", visible), name


@pytest.fixture(scope="module")
def both():
    """Two Pandas side by side that move alike, as one group."""
    _, time, joints, *_ = panda_profile()
    group = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    mirrored = joints * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    return Demonstration.of_arm(group, group.joined(joints, mirrored), time)


def test_two_arms_keep_their_relation(both):
    group = both.arm
    assert len(both.ellipsoids(Config())) == 2
    apart = both.paths[0] - both.paths[1]
    with little_search():
        result = transfer_demonstration(both, group, method="identity", yaw=0.0, **SMALL)
    assert [arm.teacher for arm in result.arms] == [group.name] * 2
    placed = result.arms[0].motion.path - result.arms[1].motion.path
    scale = result.arms[0].placement.scale
    np.testing.assert_allclose(placed, scale * apart, atol=1e-9)
    assert result.motion.trajectory.joint_positions.shape[1] == 14


def test_two_arms_of_a_dataset_are_named_by_the_command(both, tmp_path):
    columns = tuple(f"{name}.pos" for name in both.arm.joint_names)
    parts = (Feature(STATE, columns), Feature("action", columns))
    values = {STATE: both.joint_positions, "action": both.joint_positions}
    write_lerobot(tmp_path / "set", [Episode("one", "Move", values)], parts, 10, "pandas")
    read = read_demonstration(tmp_path / "set", both.arm, unit="rad")
    np.testing.assert_allclose(read.joint_positions, both.joint_positions, atol=1e-6)
    assert read.grippers is None
    assert read.ignored == ()


def test_other_numbers_of_arms_are_an_error(both, demonstration):
    with pytest.raises(InvalidInputError, match="robot"):
        transfer_demonstration(both, "panda", **SMALL)
    with pytest.raises(InvalidInputError, match="robot"):
        transfer_demonstration(demonstration, both.arm, **SMALL)


def test_the_path_turns_with_the_base_of_the_student(demonstration):
    fixed = {"yaw": 0.0, "scale": 0.5, "method": "identity"}
    turns = []
    with little_search():
        for angle in (0.0, np.pi / 2):
            result = transfer_demonstration(
                demonstration, "panda", base_rotation=(0.0, 0.0, angle), **fixed, **SMALL
            )
            turns.append(np.diff(result.arm.motion.path[[0, -1]], axis=0)[0])
    x, y, z = 0.5 * (demonstration.paths[0][-1] - demonstration.paths[0][0])
    np.testing.assert_allclose(turns[0], [x, y, z], atol=1e-9)
    np.testing.assert_allclose(turns[1], [-y, x, z], atol=1e-9)


@pytest.fixture
def with_gripper(demonstration, tmp_path):
    """A dataset whose gripper is told to close at 0.5 s and is closed at 0.7 s."""
    columns = (*(f"{name}.pos" for name in demonstration.arm.joint_names), "gripper.pos", "mode")
    parts = (Feature(STATE, columns), Feature("action", columns))
    time = demonstration.time
    values = {}
    for key, closed in ((STATE, 0.7), ("action", 0.5)):
        gripper = np.where(time >= closed - 1e-6, 0.0, 0.04)
        values[key] = np.column_stack([demonstration.joint_positions, gripper, time])
    write_lerobot(tmp_path / "set", [Episode("one", "Grasp", values)], parts, 10, "panda")
    return tmp_path / "set"


def test_grippers_pass_through_by_their_time(demonstration, with_gripper, tmp_path):
    read = read_demonstration(with_gripper, demonstration.arm, unit="rad")
    assert read.grippers.names == ("gripper.pos",)
    assert read.ignored == ("mode",)
    with little_search():
        result = transfer_demonstration(read, "panda", method="identity", speed_scale=0.25, **SMALL)
    motion = result.arm.motion
    assert np.ptp(motion.time) > 2.0 * np.ptp(demonstration.time)
    commanded = np.interp(0.5, motion.demonstrated_time, motion.time)
    sampled = result.grippers.at(np.array([commanded - 1e-3, commanded + 1e-3]))
    np.testing.assert_allclose(sampled.commands[:, 0], [0.04, 0.0], atol=1e-6)
    closed = np.interp(0.7, motion.demonstrated_time, motion.time)
    np.testing.assert_allclose(result.grippers.at(np.array([closed])).positions, 0.0, atol=1e-6)

    mp.write_results(result, tmp_path / "out", exports="lerobot")
    table = np.genfromtxt(tmp_path / "out" / "grippers.csv", delimiter=",", names=True)
    joints = np.genfromtxt(tmp_path / "out" / "joints.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["time_s"], joints["time_s"])
    step = int(np.argmin(table["gripperpos_command"]))
    begin = motion.control_time[0]
    assert table["time_s"][step] == pytest.approx(commanded - begin, abs=2.0 / 100.0)
    exported = dict(LeRobotDataset(tmp_path / "out" / "lerobot").motions())[0]
    assert exported.columns[-1] == "gripper.pos"
    assert exported.positions[0, -1] == pytest.approx(0.04)
    assert exported.positions[-1, -1] == pytest.approx(0.0, abs=1e-6)


def test_grippers_of_columns_without_names(demonstration, with_gripper):
    given = (*demonstration.arm.joint_names, "my_gripper", "-")
    path = with_gripper / "meta" / "info.json"
    info = json.loads(path.read_text())
    for key in (STATE, "action"):
        info["features"][key]["names"] = None
    path.write_text(json.dumps(info))
    read = read_demonstration(with_gripper, demonstration.arm, unit="rad", columns=given)
    assert read.grippers.names == ("my_gripper",)
    assert read.grippers.commands[5, 0] < read.grippers.positions[5, 0]


def test_a_part_of_an_episode(demonstration):
    part = demonstration.crop(0.3, 0.8)
    np.testing.assert_allclose(part.time, np.arange(3, 9) / 10.0)
    with pytest.raises(InvalidInputError, match="start"):
        demonstration.crop(0.3, 0.35)


@pytest.mark.parametrize(
    "options", [("--height", "1.8"), ("--side", "left"), ("--person", "rhuman"), ("--unit", "mm")]
)
def test_options_of_persons_are_refused(demonstration, tmp_path, options):
    words = ("--teacher", "panda", "--robot", "panda", *options, "-o", str(tmp_path / "out"))
    done = CliRunner().invoke(app, ["transfer", str(tmp_path), *words])
    assert done.exit_code != 0
    assert options[0].strip("-") in f"{done.output}{done.exception}"
    assert not (tmp_path / "out").exists()
