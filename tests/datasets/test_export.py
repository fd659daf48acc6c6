"""Results as LeRobot datasets: one episode a result, one dataset for each robot of a batch, red results left out."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

import maniport as mp
from maniport import spd
from maniport.datasets.lerobot import STATE, LeRobotDataset
from maniport.errors import ManiportWarning
from maniport.mocap import shipped_recording
from maniport.report import report_of
from maniport.report.dataset_export import (
    FPS,
    Source,
    write_dataset,
    write_joint_dataset,
)
from maniport.report.values import Report, Section
from sizes import little_search


def columns(folder):
    table = pq.read_table(folder / "data/chunk-000/file-000.parquet")
    return {name: np.array(table[name].to_pylist()) for name in table.column_names}


def green(result):
    report = report_of(result)
    sections = tuple(
        replace(section, metrics=tuple(m for m in section.metrics if m.severity != "error"))
        for section in report.sections
    )
    return replace(report, sections=sections)


def red(result):
    section = Section("", key="motion")
    section.warn("collision", "the motion collides", severity="error")
    return Report("made", sections=(section,), outcome="It moves")


@pytest.fixture
def dataset(small_result, tmp_path):
    write_dataset(tmp_path / "set", small_result, green(small_result))
    return tmp_path / "set"


def test_the_columns_of_a_transfer(small_result, dataset):
    found = columns(dataset)
    info = json.loads((dataset / "meta/info.json").read_text())
    motion = small_result.motion.trajectory
    panda = small_result.arm.robot
    names = info["features"][STATE]["names"]
    assert names == [f"{name}.pos" for name in panda.joint_names]
    assert info["fps"] == FPS
    assert info["robot_type"] == "panda"
    inputs = {key for key in info["features"] if key.startswith(("observation.", "action"))}
    assert inputs == {STATE, "action", "observation.environment_state"}

    time = motion.control_time[0] + np.arange(len(found[STATE])) / FPS
    assert time[-1] <= motion.control_time[-1] < time[-1] + 1.0 / FPS
    for joint in range(panda.dof):
        expected = np.interp(time, motion.control_time, motion.control_positions[:, joint])
        np.testing.assert_allclose(found[STATE][:, joint], expected, atol=1e-6)
    np.testing.assert_array_equal(found["action"][:-1], found[STATE][1:])
    np.testing.assert_array_equal(found["action"][-1], found[STATE][-1])

    poses = panda.forward(found[STATE])
    np.testing.assert_allclose(found["ee_pose"][:, :3], poses[:, :3, 3], atol=1e-5)
    achieved = panda.ellipsoids(found[STATE])
    rows, cols = np.triu_indices(3)
    np.testing.assert_allclose(found["manipulability"], achieved[:, rows, cols], atol=1e-5)


def test_the_environment_state_is_the_target(small_result, dataset):
    found = columns(dataset)["observation.environment_state"]
    assert found.shape[1] == 9
    motion = small_result.arm.motion
    damped = motion.target + motion.damping.epsilon * np.eye(3)
    logarithm = np.zeros((3, 3))
    logarithm[np.triu_indices(3)] = found[0, 3:]
    logarithm = logarithm + np.triu(logarithm, 1).T
    np.testing.assert_allclose(spd.expm(logarithm[None])[0], damped[0], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(found[0, :3], motion.path[0], atol=1e-5)


def test_units_and_status_are_beside_the_dataset(small_result, dataset):
    about = json.loads((dataset / "meta/about.json").read_text())
    assert about["units"][STATE] == ["rad"] * 7
    assert about["episodes"][0]["status"] in ("green", "amber")
    ((_, motion),) = LeRobotDataset(dataset).motions()
    assert motion.units == ("rad",) * 7


def test_two_arms(two_arm_result, tmp_path):
    write_dataset(tmp_path / "set", two_arm_result, green(two_arm_result))
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    assert info["features"][STATE]["shape"] == [14]
    assert info["features"]["observation.environment_state"]["shape"] == [18]
    assert info["features"]["ee_pose"]["names"][0] == "left_ee.x"
    found = columns(tmp_path / "set")
    poses = two_arm_result.robot.forward(found[STATE])
    np.testing.assert_allclose(found["ee_pose"][:, 6:9], poses[:, 1, :3, 3], atol=1e-5)


def test_write_results_adds_the_dataset(small_result, tmp_path):
    report = report_of(small_result)
    if report.status == "red":
        with pytest.warns(ManiportWarning, match="LeRobot"):
            mp.write_results(small_result, tmp_path / "out", exports="lerobot")
        assert not (tmp_path / "out" / "lerobot").exists()
        return
    mp.write_results(small_result, tmp_path / "out", exports="lerobot")
    assert LeRobotDataset(tmp_path / "out" / "lerobot").count == 1
    mp.write_results(small_result, tmp_path / "out", exports="lerobot", overwrite=True)


def test_a_red_result_is_left_out(small_result, tmp_path):
    with pytest.warns(ManiportWarning, match="collision"):
        write_dataset(tmp_path / "set", small_result, red(small_result))
    assert list(tmp_path.iterdir()) == []


def test_one_dataset_of_several(dataset, tmp_path):
    shutil.copytree(dataset, tmp_path / "second")
    sources = [
        Source("one", dataset),
        Source("two", None, "red: collision"),
        Source("three", tmp_path / "second"),
    ]
    assert write_joint_dataset(tmp_path / "all" / "panda", sources) == 2
    joined = LeRobotDataset(tmp_path / "all" / "panda")
    first = dict(LeRobotDataset(dataset).motions())[0]
    motions = dict(joined.motions())
    assert list(motions) == [0, 1]
    for motion in motions.values():
        np.testing.assert_array_equal(motion.positions, first.positions)
    about = json.loads((tmp_path / "all/panda/meta/about.json").read_text())
    assert about["left_out"] == [{"name": "two", "reason": "red: collision"}]
    assert write_joint_dataset(tmp_path / "none", sources[1:2]) == 0
    assert not (tmp_path / "none").exists()


@pytest.mark.slow
def test_a_batch_writes_a_dataset_for_each_robot(tmp_path):
    source = shipped_recording("freeform")
    (tmp_path / "recordings").mkdir()
    for name in ("one.c3d", "two.c3d"):
        shutil.copy(source, tmp_path / "recordings" / name)
    options = {"start": 2.0, "stop": 2.2, "n_teacher": 64, "n_student": 256, "collisions": False}
    with little_search():
        result = mp.transfer_batch(
            [tmp_path / "recordings"],
            ["panda"],
            tmp_path / "out",
            processes=1,
            method="parallel-transport",
            export="lerobot",
            speed_scale=0.3,
            **options,
        )
    assert not result.failed
    folder = tmp_path / "out" / "lerobot" / "panda"
    kept = [row for row in result.table if row["status"] != "red"]
    assert kept, result.table
    assert LeRobotDataset(folder).count == len(kept)
    about = json.loads((folder / "meta/about.json").read_text())
    assert len(about["episodes"]) + len(about["left_out"]) == 2
