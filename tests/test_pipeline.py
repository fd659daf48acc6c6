"""The main job: recording in, frozen result and folder out."""

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError, OutputError, UnknownNameError
from maniport.files import load_ellipsoids
from maniport.pipeline import transfer_recording
from maniport.telling import as_numbers, facts_of
from maniport.telling.renderings import files_of
from maniport.telling.write import EXPORTS, FIGURES, RUN_FILES
from sizes import few_places

SMALL = {"n_teacher": 64, "n_student": 128, "move": False}


@pytest.fixture(scope="module")
def motion(second):
    """A third of a second of the shipped ladder recording."""
    return second.crop(10.0, 10.35)


@pytest.fixture(scope="module")
def result(small_result):
    """The main job on a small scale, the robot's motion included."""
    return small_result


@pytest.fixture(scope="module")
def forces(motion):
    """The main job by force ellipsoids, the robot's motion included."""
    options = SMALL | {"move": True, "method": "parallel-transport", "spec": mp.EllipsoidSpec("force")}
    with few_places():
        return transfer_recording(motion, **options)


@pytest.fixture(scope="module")
def steps():
    """What was told while `moved` was made."""
    return []


@pytest.fixture(scope="module")
def moved(motion, steps):
    """The main job on the smallest scale, the robot's motion included."""
    with few_places():
        return transfer_recording(motion, progress=lambda *call: steps.append(call), **SMALL | {"move": True})


def test_where_no_method_is_named_one_is_chosen_and_told(moved):
    """The choice and its reason are among the metrics; the adapter is the chosen one."""
    result, choice, numbers = moved, moved.choice, as_numbers(facts_of(moved))
    assert result.adapter is choice.adapter
    assert result.method == choice.method
    assert numbers["evaluation"]["choice"] == {"method": result.method, "failures": list(choice.failures)}
    assert set(numbers["evaluation"]["rows"]) >= {"raw-copy", "recentring", "parallel-transport", "lengths-field"}


def test_a_method_that_is_named_is_taken(motion):
    """Nothing is chosen then; names that are none are refused with all that there are."""
    named = transfer_recording(motion, method="recentring", **SMALL)
    assert (named.method, named.choice) == ("recentring", None)
    with pytest.raises(UnknownNameError, match="unknown method 'best'"):
        transfer_recording(motion, method="best", **SMALL)


def test_every_frame_of_the_person_gets_an_ellipsoid_for_the_robot(result):
    """Times, angles, the person's and the robot's ellipsoids are equally many, and the robot's are SPD."""
    n = len(result.time)
    assert n == len(result.fit.joint_angles) == 31
    assert result.demonstrated_profile.shape == result.target_profile.shape == (n, 3, 3)
    assert np.linalg.eigvalsh(result.target_profile).min() > 0
    assert (np.diff(result.time) > 0).all()


def test_teacher_profile_is_what_the_fitted_arm_can_do(result):
    """The person's profile holds the ellipsoids of the fitted arm at the fitted angles, which lie within the limits."""
    arm, angles = result.fit.arm, result.fit.joint_angles
    np.testing.assert_array_equal(result.demonstrated_profile, arm.manipulability(angles))
    assert (angles >= arm.lower - 1e-9).all()
    assert (angles <= arm.upper + 1e-9).all()


def test_result_is_the_adapters_work(result):
    """The adapted profile is what the adapter makes of the person's, and the adapter takes it back."""
    np.testing.assert_array_equal(result.target_profile, result.adapter.transform(result.demonstrated_profile))
    back = result.adapter.inverse_transform(result.target_profile)
    scale = np.abs(result.demonstrated_profile).max()
    np.testing.assert_allclose(back, result.demonstrated_profile, atol=1e-9 * scale)


def test_same_seed_gives_the_same_result(motion, moved, tmp_path):
    """A second run gives the same bytes of every data file and the same JSON, told of or not; another seed others."""
    with few_places():
        first, again = moved, transfer_recording(motion, **SMALL | {"move": True})
    assert np.array_equal(again.target_profile, first.target_profile)
    told = [json.dumps(as_numbers(facts_of(one))) for one in (first, again)]
    assert told[0] == told[1]
    for one, folder in ((first, "first"), (again, "again")):
        one.save(tmp_path / folder)
    files = sorted(file.name for file in (tmp_path / "first").iterdir())
    assert {"joints.csv", "joints.npz", "path.npz", "target_profile.npz"} <= set(files)
    for file in files:
        assert (tmp_path / "first" / file).read_bytes() == (tmp_path / "again" / file).read_bytes(), file
    other = transfer_recording(motion, **SMALL, random_state=7)
    assert not np.array_equal(other.target_profile, first.target_profile)


@pytest.mark.parametrize("method", ["parallel-transport", "nearest-neighbor"])
def test_every_method_goes_the_whole_way(motion, method):
    """Methods other than the default also end in SPD ellipsoids and a summary."""
    other = transfer_recording(motion, method=method, **SMALL)
    assert np.linalg.eigvalsh(other.target_profile).min() > 0
    assert as_numbers(facts_of(other))["run"]["method"] == method


@pytest.mark.parametrize(("part", "d"), [("rotation", 3), ("full", 6)])
def test_other_parts_go_the_whole_way(motion, part, d, tmp_path):
    """Rotational and full ellipsoids are transferred and written too."""
    other = transfer_recording(motion, method="parallel-transport", spec=mp.EllipsoidSpec(part=part), **SMALL)
    assert other.target_profile.shape[1:] == (d, d)
    mp.write_results(other, tmp_path / "out")
    assert "diffusion_map.svg" in {file.name for file in mp.write_figures(tmp_path / "out")}


def test_robot_follows_to_the_end(result):
    """The motion has a configuration within the limits for every frame, and stays near its hand path where it can."""
    motion, robot = result.execution.motion, result.robot
    assert len(motion.joint_positions) == len(result.time)
    assert robot.within_limits(motion.control_positions).all()
    np.testing.assert_allclose(motion.target, result.execution.placement.profile, atol=1e-12)
    np.testing.assert_allclose(motion.achieved, robot.manipulability(motion.joint_positions))
    assert np.percentile(motion.position_error, 95) < result.execution.plan.tip_tolerance


def test_force_ellipsoids_are_followed_as_their_inverses(forces):
    """What the robot follows are the velocity ellipsoids that belong to the adapted force ellipsoids."""
    yaw = forces.execution.placement.yaw
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    wanted = turn @ np.linalg.inv(forces.target_profile) @ turn.T
    np.testing.assert_allclose(forces.execution.motion.target, wanted, rtol=1e-6, atol=1e-9)


def test_robot_that_cannot_follow_is_not_moved(motion):
    """A robot of two joints still gets its ellipsoids, and the result says why it was not moved."""
    planar = mp.Arm.from_dh("planar", [[0, 0, 0.4, 0], [0, 0, 0.4, 0]])
    result = transfer_recording(motion, robot=planar, **SMALL | {"move": True})
    assert result.execution is None
    assert any("was not moved: 'planar' has 2 joints" in warning for warning in result.warnings)


@pytest.mark.parametrize("method", ["parallel-transport", "nearest-neighbor"])
def test_doing_nothing_is_judged_in_the_robots_frame(motion, method):
    """A raw copy of a person's ellipsoids is turned by the mounting before it is measured, and so is every method."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    turned = transfer_recording(motion, method=method, mounting=turn, **SMALL)
    plain = transfer_recording(motion, method=method, **SMALL)
    copy = turn @ turned.demonstrated_profile @ turn.T
    gaps = mp.nearest_feasible(turned.robot, copy, damping=turned.adapter.student_regularization).distance
    assert turned.evaluation.row("raw-copy").feasibility_gap.mean == pytest.approx(gaps.mean(), rel=0.02)
    assert not np.allclose(turned.target_profile, plain.target_profile, rtol=1e-3)


def test_mounting_turns_the_result(motion, result):
    """A robot that stands turned gets the same ellipsoids in its turned frame, up to the pull of its own domain."""
    half_turn = np.diag([-1.0, -1.0, 1.0])
    turned = transfer_recording(motion, method="parallel-transport", mounting=half_turn, **SMALL)
    plain = transfer_recording(motion, method="parallel-transport", **SMALL)
    as_seen = half_turn @ turned.target_profile @ half_turn
    assert np.median(mp.spd.distance(as_seen, plain.target_profile)) < 0.3
    assert np.median(mp.spd.distance(turned.target_profile, plain.target_profile)) > 0.3


def test_result_and_its_parts_are_frozen(result):
    """A result cannot be changed by accident."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.method = "icp"


def test_progress_tells_every_step_to_its_end(moved, steps):
    """Each step is announced, never runs backwards, and ends with a fact or at least with one."""
    names = list(dict.fromkeys(call[0] for call in steps))
    assert len(names) >= 9
    for name in names:
        fractions = [call[1] for call in steps if call[0] == name]
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0


def test_earlier_result_is_replaced_and_all_that_was_promised_is_there(result, tmp_path):
    """Where it may be: data over data, and all files over a part of them, leave one result, no temporary folders.

    Angles in degrees, both profiles with time, the adapter and both summaries can be read back.
    """
    folder = tmp_path / "out"
    result.save(folder)
    result.save(folder, overwrite=True)
    assert {entry.name for entry in folder.iterdir()} < set(RUN_FILES)
    mp.write_results(result, folder, overwrite=True)
    assert {entry.name for entry in folder.iterdir()} == set(RUN_FILES) - set(EXPORTS) - set(files_of(*FIGURES))
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]
    rows = list(csv.reader((folder / "person.csv").open()))
    assert rows[0] == ["time_s", *(f"{name}_deg" for name in result.fit.joint_names)]
    np.testing.assert_allclose(np.array(rows[1:], float)[:, 1:], np.degrees(result.fit.joint_angles), atol=1e-4)
    for name, profile in (("demonstrated", result.demonstrated_profile), ("target", result.target_profile)):
        ellipsoids, time = load_ellipsoids(folder / f"{name}_profile.npz")
        assert np.array_equal(ellipsoids, profile)
        assert np.array_equal(time, result.time)
    adapter = mp.load_adapter(folder / "adapter.npz")
    assert np.array_equal(adapter.transform(result.demonstrated_profile), result.target_profile)
    assert json.loads((folder / "summary.json").read_text())["run"]["ellipsoids"]["count"] == len(result.time)
    page = (folder / "summary.md").read_text()
    assert "pro_sup" in page


def test_folder_with_other_things_is_left_alone(result, tmp_path):
    """The message names what is there; nothing is written or removed."""
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(OutputError, match=r"thesis\.tex"):
        mp.write_results(result, tmp_path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("thing", [3, None, "results"])
def test_what_is_no_result_is_refused(thing, tmp_path):
    """The message names the argument and the type; nothing is written."""
    with pytest.raises(InvalidInputError, match=f"result.*found {type(thing).__name__}"):
        mp.write_results(thing, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_failed_save_keeps_the_earlier_result(result, tmp_path, monkeypatch):
    """When writing fails in the middle, the earlier folder stays as it was and no part of the new one is seen."""
    folder = tmp_path / "out"
    result.save(folder)
    before = (folder / "person.csv").read_bytes()

    def disk_full(self, path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(result.adapter), "save", disk_full)
    with pytest.raises(OutputError, match="No space left"):
        mp.write_results(result, folder, overwrite=True)
    assert (folder / "person.csv").read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"method": "magic"}, InvalidInputError, "icp"),
        ({"robot": "pand"}, UnknownNameError, "'panda'"),
        ({"person": "myarm"}, UnknownNameError, "'myoarm'"),
        ({"damping": -1.0}, InvalidInputError, "damping"),
        ({"floor": 1e-4}, InvalidInputError, "exclude"),
        ({"mounting": np.ones((3, 3))}, InvalidInputError, "mounting"),
        ({"tempo": 0}, InvalidInputError, "tempo"),
        ({"n_student": 1}, InvalidInputError, "student"),
        ({"random_state": -1}, InvalidInputError, "random_state"),
    ],
)
def test_wrong_arguments_are_named(motion, change, error, words):
    """The message names the argument or lists what there is."""
    with pytest.raises(error, match=words):
        transfer_recording(motion, **{**SMALL, **change})


def test_summary_has_no_nan(result):
    """The summary is valid JSON in the strict sense."""
    text = json.dumps(as_numbers(facts_of(result)), allow_nan=False)
    assert str(Path.home()) not in text
