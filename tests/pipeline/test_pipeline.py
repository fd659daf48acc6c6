"""The main job: a recording in, a frozen result and a folder out; and its last part alone, `follow`."""

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, OutputError, UnknownNameError
from maniport.pipeline import follow_profile, transfer_recording
from maniport.pipeline.results import RESULT_FILES
from maniport.report import as_numbers, report_of
from maniport.util.files import load_ellipsoids, load_path

SMALL = {"n_teacher": 64, "n_student": 128}
STILL = SMALL | {"move": False}


@pytest.fixture(scope="module")
def clip(second):
    return second.crop(10.0, 10.35)


@pytest.fixture(scope="module")
def result(small_result):
    return small_result


def test_a_method_is_chosen_or_named(clip, result):
    rejected = result.arm.evaluation.rejected
    numbers = as_numbers(report_of(result))
    assert numbers["evaluation"]["choice"] == {
        "method": result.arm.method,
        "failures": list(rejected),
    }
    assert set(numbers["evaluation"]["rows"]) >= {
        "identity",
        "mean-transport",
        "parallel-transport",
        "length-field",
    }
    named = transfer_recording(clip, method="mean-transport", **STILL)
    assert (named.arm.method, named.arm.evaluation.rejected) == ("mean-transport", None)


def test_every_frame_gets_an_ellipsoid_by_the_adapter(result):
    arm = result.arm.fit.arm
    angles = result.arm.fit.joint_angles
    target = result.arm.target_profile
    assert (
        len(result.time) == len(angles) == len(target) == len(result.arm.demonstrated_profile) == 31
    )
    np.testing.assert_array_equal(result.arm.demonstrated_profile, arm.manipulability(angles))
    assert arm.within_limits(angles).all()
    np.testing.assert_array_equal(
        target, result.arm.adapter.transform(result.arm.demonstrated_profile)
    )
    assert np.linalg.eigvalsh(target).min() > 0
    back = result.arm.adapter.inverse_transform(target)
    scale = np.abs(result.arm.demonstrated_profile).max()
    np.testing.assert_allclose(back, result.arm.demonstrated_profile, atol=1e-9 * scale)


def test_the_robot_follows_to_the_end(result):
    motion = result.arm.motion
    robot = result.arm.robot
    assert len(motion.joint_positions) == len(result.time)
    assert robot.within_limits(motion.control_positions).all()
    np.testing.assert_allclose(motion.target, result.arm.placement.profile, atol=1e-12)
    np.testing.assert_allclose(motion.achieved, robot.manipulability(motion.joint_positions))
    assert np.percentile(motion.position_error, 95) < result.arm.motion.position_tolerance
    assert motion.limit_use is not None
    assert result.motion.clearance.share == 0.0


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(clip, tmp_path):
    steps = []
    job = SMALL | {"method": "parallel-transport"}
    first = transfer_recording(clip, progress=lambda *call: steps.append(call), **job)
    again = transfer_recording(clip, **job)
    numbers = [json.dumps(as_numbers(report_of(run)), allow_nan=False) for run in (first, again)]
    assert numbers[0] == numbers[1]
    assert str(Path.home()) not in numbers[0]
    for run, folder in ((first, "first"), (again, "again")):
        run.save(tmp_path / folder)
    files = sorted(file.name for file in (tmp_path / "first").iterdir())
    assert {"joints.csv", "joints.npz", "path.npz", "target_profile.npz"} <= set(files)
    for file in files:
        assert (tmp_path / "first" / file).read_bytes() == (
            tmp_path / "again" / file
        ).read_bytes(), file
    other = transfer_recording(clip, **job | {"move": False}, seed=7)
    assert not np.array_equal(other.arm.target_profile, first.arm.target_profile)
    for name in dict.fromkeys(step[0] for step in steps):
        fractions = [step[1] for step in steps if step[0] == name]
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0


@pytest.mark.slow
def test_force_ellipsoids_are_followed_as_their_inverses(clip, tmp_path):
    job = SMALL | {"method": "parallel-transport", "ellipsoids": "force"}
    forces = transfer_recording(clip, **job)
    yaw = forces.arm.placement.yaw
    turn = np.array(
        [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    )
    expected = turn @ np.linalg.inv(forces.arm.target_profile) @ turn.T
    np.testing.assert_allclose(forces.arm.motion.target, expected, rtol=1e-6, atol=1e-9)
    forces.save(tmp_path / "results")
    placed = load_ellipsoids(tmp_path / "results" / "placed_profile.npz")[0]
    np.testing.assert_allclose(np.linalg.inv(placed), expected, rtol=1e-5, atol=1e-9)


def test_a_robot_that_cannot_follow_is_not_moved(clip):
    planar = mp.Arm.from_dh("planar", [[0, 0, 0.4, 0], [0, 0, 0.4, 0]])
    result = transfer_recording(clip, robot=planar, method="parallel-transport", **SMALL)
    assert result.motion is None
    assert any("was not moved: 'planar' has 2 joints" in warning for warning in result.warnings)


def test_the_mounting_turns_results_and_baselines(clip):
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    half_turn = np.diag([-1.0, -1.0, 1.0])
    plain, turned, half = (
        transfer_recording(clip, method="parallel-transport", base_rotation=base_rotation, **STILL)
        for base_rotation in (None, turn, half_turn)
    )
    copy = turn @ turned.arm.demonstrated_profile @ turn.T
    gaps = mp.nearest_feasible(
        turned.arm.robot, copy, damping=turned.arm.adapter.student_regularization
    ).distance
    assert turned.arm.evaluation.values["identity"] == pytest.approx(gaps.mean(), rel=0.02)
    as_seen = half_turn @ half.arm.target_profile @ half_turn
    assert np.median(mp.spd.distance(as_seen, plain.arm.target_profile)) < 0.3
    assert np.median(mp.spd.distance(half.arm.target_profile, plain.arm.target_profile)) > 0.3


def test_a_result_is_written_whole_and_can_be_read_back(result, tmp_path):
    folder = tmp_path / "out"
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.arm.method = "icp"
    result.save(folder)
    assert {entry.name for entry in folder.iterdir()} < RESULT_FILES
    mp.write_results(result, folder, overwrite=True)
    assert (
        {"report.html", "summary.md", "joints.csv"}
        <= {entry.name for entry in folder.iterdir()}
        <= RESULT_FILES
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    rows = list(csv.reader((folder / "person.csv").open()))
    joints = [f"{name}_deg" for name in result.arm.fit.arm.joint_names]
    lines = [f"direction_{what}_{axis}" for what in ("force", "speed") for axis in "xyz"]
    assert rows[0] == ["time_s", *joints, *lines]
    numbers = np.array(rows[1:], float)
    np.testing.assert_allclose(numbers[:, 1:8], np.degrees(result.arm.fit.joint_angles), atol=1e-4)
    for capability, columns in zip(
        result.arm.capabilities, np.split(numbers[:, 8:], 2, axis=1), strict=True
    ):
        np.testing.assert_allclose(columns, capability.lines, atol=1e-9)
    for name, profile in (
        ("demonstrated", result.arm.demonstrated_profile),
        ("target", result.arm.target_profile),
    ):
        ellipsoids, time = load_ellipsoids(folder / f"{name}_profile.npz")
        np.testing.assert_array_equal(ellipsoids, profile)
        np.testing.assert_array_equal(time, result.time)
    adapter = mp.load_adapter(folder / "adapter.npz")
    np.testing.assert_array_equal(
        adapter.transform(result.arm.demonstrated_profile), result.arm.target_profile
    )
    assert json.loads((folder / "summary.json").read_text())["run"]["ellipsoids"]["count"] == len(
        result.time
    )


def test_a_failed_save_keeps_what_is_there(result, tmp_path, monkeypatch):
    """An earlier result on a full disk; other things of the user; and what is no result is not written."""
    folder = tmp_path / "out"
    result.save(folder)
    before = (folder / "person.csv").read_bytes()

    def disk_full(self, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(result.arm.adapter), "save", disk_full)
    with pytest.raises(OutputError, match="No space"):
        result.save(folder, overwrite=True)
    assert (folder / "person.csv").read_bytes() == before
    (folder / "thesis.tex").write_text("precious")
    alone = mp.pipeline.MotionResult(
        robot=result.robot, arms=result.arms, config=result.config, motion=result.motion
    )
    for run in (result, alone):
        with pytest.raises(OutputError, match=r"thesis\.tex"):
            mp.write_results(run, folder, overwrite=True)
    for thing in (3, None, "results"):
        with pytest.raises(InvalidInputError, match=f"result.*found {type(thing).__name__}"):
            mp.write_results(thing, tmp_path / "other")
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("change", "error", "word"),
    [
        ({"method": "magic"}, UnknownNameError, "icp"),
        ({"robot": "pand"}, UnknownNameError, "'panda'"),
        ({"person": "myarm"}, UnknownNameError, "'myoarm'"),
        ({"damping": -1.0}, InvalidInputError, "damping"),
        ({"speed": 1e-4}, UnknownNameError, "speed_scale"),
        ({"base_rotation": np.ones((3, 3))}, InvalidInputError, "base_rotation"),
        ({"speed_scale": 0}, InvalidInputError, "speed_scale"),
        ({"n_student": 1}, InvalidInputError, "student"),
        ({"seed": -1}, InvalidInputError, "seed"),
    ],
)
def test_wrong_arguments_are_named(clip, change, error, word):
    with pytest.raises(error, match=word):
        transfer_recording(clip, **STILL | change)


@pytest.fixture(scope="module")
def own():
    """A motion of the Panda: the arm, times, ellipsoids and path of the end effector."""
    panda = mp.load_arm("panda")
    phase = np.sin(np.linspace(0.0, np.pi, 21))[:, None]
    joints = np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.0]) + 0.3 * phase * np.array(
        [1, 0.5, -1, 0.7, 0.5, -0.5, 0]
    )
    return (
        panda,
        np.linspace(0.0, 2.0, 21),
        panda.manipulability(joints),
        panda.forward(joints)[:, :3, 3],
    )


@pytest.mark.slow
def test_the_robot_repeats_its_own_motion(own, tmp_path):
    """Ellipsoids to a median distance of 0.05; it is at rest at both ends. The folder can be read back."""
    panda, time, profile, path = own
    targets = mp.motion.TargetTrajectory.checked(panda, time, profile, positions=path)
    execution = follow_profile(panda, targets)
    motion = execution.arm.motion
    assert np.median(motion.distance) < 0.05
    assert np.percentile(motion.distance, 95) < 0.1
    assert np.percentile(motion.position_error, 95) < motion.position_tolerance
    assert execution.arm.placement is None
    mp.write_results(execution, tmp_path / "out")
    assert (
        {"report.html", "summary.md"}
        <= {file.name for file in (tmp_path / "out").iterdir()}
        <= RESULT_FILES
    )
    rows = list(csv.reader((tmp_path / "out" / "joints.csv").open()))
    assert rows[0][:2] == ["time_s", "panda_joint1_rad"]
    np.testing.assert_allclose(
        np.array(rows[1:], float)[:, 1:8], motion.control_positions, atol=1e-8
    )
    np.testing.assert_array_equal(
        load_ellipsoids(tmp_path / "out" / "joints.npz")[0], motion.achieved
    )
    np.testing.assert_array_equal(load_path(tmp_path / "out" / "path.npz")[0], motion.path)
    numbers = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert numbers == json.loads(json.dumps(as_numbers(report_of(execution))))


@pytest.mark.slow
def test_tempo_and_placement(own):
    panda, time, profile, path = own
    targets = mp.motion.TargetTrajectory.checked(panda, time, profile, positions=path + 2.0)
    slow = follow_profile(panda, targets, place=True, speed_scale=0.5)
    assert 2.0 * np.ptp(time) <= slow.arm.motion.control_time[-1] < 2.1 * np.ptp(time)
    np.testing.assert_array_equal(slow.arm.motion.demonstrated_time, time)
    np.testing.assert_allclose(slow.arm.motion.path, slow.arm.placement.path, atol=1e-12)
    np.testing.assert_allclose(slow.arm.motion.target, slow.arm.placement.profile, atol=1e-12)
    assert np.percentile(slow.arm.motion.position_error, 95) < slow.arm.motion.position_tolerance
    assert as_numbers(report_of(slow))["placement"]["scale"] == slow.arm.placement.scale


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"speed_scale": 0.0}, "speed_scale"),
        ({"scale": 0.0, "place": True}, "scale"),
        ({"scale": 0.5}, "scale= is for a path that is placed"),
        ({"orientation": "demonstrated"}, "orientation"),
        ({"part": "full"}, "ellipsoids of the options"),
        ({"targets": 3}, "targets"),
    ],
)
def test_wrong_targets_are_named(own, change, word):
    panda, time, profile, path = own
    targets = mp.motion.TargetTrajectory.checked(panda, time, profile, positions=path)
    arguments = {"targets": targets} | change
    with pytest.raises(InvalidInputError, match=word):
        follow_profile(panda, **arguments)


@pytest.mark.parametrize("name", ["small_result", "two_arm_result"])
def test_each_search_has_the_configurations_of_the_narrower_one(request, name):
    """Feasibility gap, pointwise optimum and distance ascend at every waypoint; parts of the mean are positive."""
    for arm in request.getfixturevalue(name).arms:
        assert (arm.gap <= arm.motion.pointwise_best).all()
        assert (arm.motion.pointwise_best <= arm.motion.distance).all()
        assert min(arm.mean_distance.values()) >= 0.0
        assert sum(arm.mean_distance.values()) == pytest.approx(arm.motion.distance.mean())


def test_a_part_of_a_recording_object_is_what_is_transferred(panda):
    recording = mp.read_recording("freeform", start=2.0, stop=3.0)
    options = {"method": "identity", "n_teacher": 64, "n_student": 64, "move": False}
    result = transfer_recording(recording, robot=panda, start=2.2, stop=2.6, **options)
    assert 2.2 <= result.recording.time[0] < result.recording.time[-1] <= 2.6
    assert (result.config.start, result.config.stop) == (2.2, 2.6)
    whole = transfer_recording(recording, robot=panda, **options)
    assert (whole.config.start, whole.config.stop) == (recording.time[0], recording.time[-1])
