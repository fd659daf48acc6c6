"""The main job with several arms: what each gets, what both share, what is written, and what is refused at once."""

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport.arms.restriction import standing
from maniport.cli import app
from maniport.errors import InvalidInputError, ManiportError, OutputError, RecordingError
from maniport.report.describe import report_of
from sizes import SMALL, little_search

pytestmark = pytest.mark.slow

SIDES = "left", "right"
OPTIONS = {"method": "parallel-transport", **SMALL}


@pytest.fixture(scope="module")
def recording():
    return mp.read_recording("both-arms").crop(5.1, 5.4)


@pytest.fixture(scope="module")
def arms(two_arm_result):
    return two_arm_result.robot


@pytest.fixture(scope="module")
def still(recording, arms):
    return mp.transfer_recording(recording, robot=arms, move=False, **OPTIONS)


def hands_of(result):
    return [
        arm.fit.arm.forward(arm.fit.joint_angles)[:, :3, 3] + arm.person_base for arm in result.arms
    ]


def test_each_arm_of_the_person_leads_the_arm_of_its_side(two_arm_result, arms):
    for side, result, arm in zip(SIDES, two_arm_result.arms, arms.arms, strict=True):
        assert result.fit.arm.side == side
        assert result.robot is arm
        demonstrated = result.fit.arm.manipulability(result.fit.joint_angles)
        np.testing.assert_allclose(result.demonstrated_profile, demonstrated)
        np.testing.assert_allclose(result.target_profile, result.adapter.transform(demonstrated))
    assert not np.array_equal(
        two_arm_result.arms[0].target_profile, two_arm_result.arms[1].target_profile
    )


def test_the_hands_keep_their_relation(two_arm_result):
    left, right = (result.placement for result in two_arm_result.arms)
    assert left.scale == right.scale
    np.testing.assert_array_equal(left.rotation, right.rotation)
    hands = hands_of(two_arm_result)[1] - hands_of(two_arm_result)[0]
    paths = two_arm_result.arms[1].motion.path - two_arm_result.arms[0].motion.path
    np.testing.assert_allclose(
        paths, left.scale * hands @ (left.rotation @ left.map_rotation).T, atol=1e-9
    )


def test_both_arms_share_one_safe_motion(two_arm_result, arms):
    motion = two_arm_result.motion
    q = arms.joined(*(result.motion.joint_positions for result in two_arm_result.arms))
    np.testing.assert_allclose(motion.trajectory.joint_positions, q, atol=1e-12)
    for result in two_arm_result.arms:
        np.testing.assert_array_equal(result.motion.time, motion.trajectory.time)
        assert np.percentile(result.motion.position_error, 95) < 12e-3
    assert max(share for _, share, _ in motion.trajectory.limit_use.values()) <= 1.0 + 1e-9
    assert motion.clearance.checked
    assert motion.clearance.share == 0.0


def test_relative_end_effectors_leave_their_paths_and_keep_an_orientation(recording, arms):
    with little_search():
        result = mp.transfer_recording(
            recording, robot=arms, hand_targets="relative", orientation="constant", **OPTIONS
        )
    hands = np.linalg.norm(hands_of(result)[1] - hands_of(result)[0], axis=1)
    np.testing.assert_allclose(
        np.ptp(np.linalg.norm(result.motion.relative[:, 0], axis=1) / hands), 0.0, atol=1e-9
    )
    assert np.percentile(result.motion.relative_error, 95) < 5e-3
    for arm in result.arms:
        assert np.median(arm.motion.orientation_error) < np.radians(10.0)
        assert arm.placement is None
    assert any(
        metric.key == "relative_position_error" and metric.unit == "mm"
        for metric in report_of(result).metrics
    )


def test_a_robot_that_is_not_moved_has_targets_by_its_seed(still, two_arm_result):
    assert still.motion is None
    assert "not moved" in repr(still)
    assert not np.array_equal(still.arms[0].student_domain, two_arm_result.arms[0].student_domain)


def test_warnings_of_several_arms_name_their_arm(two_arm_result):
    report = report_of(two_arm_result)
    assert report.status in ("green", "amber", "red")
    own = ("left arm", "right arm", "left arm:", "right arm:", "left and right", "frames")
    assert all(any(words in text.lower() for words in own) for text in report.warnings)


def test_a_folder_holds_the_motion_of_all_and_the_data_of_each(two_arm_result, tmp_path):
    folder = tmp_path / "both"
    mp.write_results(two_arm_result, folder, exports="rerun")
    header = (folder / "joints.csv").read_text().split("\n", 1)[0]
    assert all(f"{name}_rad," in header for name in two_arm_result.robot.joint_names)
    with np.load(folder / "joints.npz") as arrays:
        np.testing.assert_array_equal(
            arrays["joint_positions"], two_arm_result.motion.trajectory.joint_positions
        )
    assert {"report.html", "motion.rrd", "summary.json", *SIDES} <= {
        file.name for file in folder.iterdir()
    }
    for side in SIDES:
        files = {file.name for file in (folder / side).iterdir()}
        assert {"person.csv", "target_profile.npz", "adapter.npz", "joints.csv"} <= files
    figures = {file.name for file in mp.write_figures(folder)}
    assert figures == {
        f"{name}.{suffix}" for name in ("arms", "curves", "motion") for suffix in ("png", "svg")
    }
    drawn = (folder / "motion.svg").read_text()
    assert "Left: Ellipsoid distance" in drawn
    assert "right_panda_joint1 [°]" in drawn
    with pytest.raises(OutputError, match="overwrite="):  # figures are part of it
        mp.write_results(two_arm_result, folder)
    (folder / "left" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"'left/mine\.txt'"):
        mp.write_results(two_arm_result, folder, overwrite=True)


def test_targets_without_a_motion_cannot_be_exported(still, tmp_path):
    with pytest.raises(InvalidInputError, match=r"exports.*motion"):
        mp.write_results(still, tmp_path / "other", exports="ros2")
    assert not (tmp_path / "other").exists()


@pytest.fixture
def no_sampling(monkeypatch):
    monkeypatch.setattr(
        "maniport.pipeline.following.sample_domain", lambda *_, **__: pytest.fail("it sampled")
    )


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"recording": "freeform"}, RecordingError, "shows the right"),
        ({"robot": mp.load_arm("panda"), "side": "both"}, InvalidInputError, "side"),
        ({"method": "magic"}, ManiportError, "unknown method 'magic'"),
        ({"markers": {"elbow": "RELB"}}, InvalidInputError, "must be"),
        ({"hand_targets": "absolute"}, InvalidInputError, "unknown hand_targets 'absolute'"),
        (
            {"hand_targets": "relative", "workspace": [(0, 1)] * 3, "move": True},
            InvalidInputError,
            "workspace",
        ),
        (
            {"orientation": (0, 0, -1), "orientation_axes": "whole"},
            InvalidInputError,
            "orientation_axes",
        ),
        ({"gain": 1.0}, InvalidInputError, "unknown option 'gain'"),
        ({"spec": "velocity"}, InvalidInputError, "unknown option 'spec'"),
    ],
)
@pytest.mark.usefixtures("no_sampling")
def test_wrong_arguments_are_named_before_long_work(recording, arms, options, error, words):
    ready = {"recording": recording, "robot": arms, "move": False, **OPTIONS} | options
    with pytest.raises(error, match=words):
        mp.transfer_recording(**ready)


PANDAS = ("--pose", "0,0.3,0,0", "--pose", "0,-0.3,0,0")
BOTH = ("both-arms", "--side", "both")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*BOTH, *PANDAS[:2]), "two"),
        ((*BOTH, *PANDAS, "--base", "panda_link1"), "is for one arm"),
        ((*BOTH, *PANDAS, "--frame", "panda_link8,panda_lnk8"), "unknown frame 'panda_lnk8'"),
        ((*BOTH, *PANDAS, "--hand-targets", "absolute"), "unknown --hand-targets 'absolute'"),
        ((*BOTH, *PANDAS, "--lock", "panda_joint1=10"), "unknown joint"),
        (BOTH, "must have two arms"),
        ((*BOTH, "--pose", "0,0,0,0", "--pose", "0,0,0,0"), "one place"),
        (("both-arms", "--hand-targets", "relative"), "needs several arms"),
    ],
)
@pytest.mark.usefixtures("no_sampling")
def test_wrong_options_of_the_command_are_named_before_long_work(
    monkeypatch, tmp_path, words, message
):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["transfer", *words, "-o", "out"])
    assert isinstance(result.exception, ManiportError), result.output
    assert message in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_functions_of_one_arm_refuse_two(recording, arms):
    with pytest.raises(InvalidInputError, match="ArmGroup"):
        mp.load_arm(arms)
    with pytest.raises(InvalidInputError, match="both"):
        mp.fit_arm(recording, side="both")


def test_one_arm_of_a_person_leads_three_arms(recording, tmp_path):
    """Each Panda moves in front of its own base, with targets, errors and files of its own; the motion has one time."""
    panda = mp.load_arm("panda")
    placed = np.tile(np.eye(4), (3, 1, 1))
    placed[:, 1, 3] = (1.2, 0.0, -1.2)
    arms = mp.ArmGroup(
        *(mp.Arm(standing(panda.chain, pose)) for pose in placed), names=("a", "b", "c")
    )
    with little_search():
        result = mp.transfer_recording(recording, robot=arms, side="right", **OPTIONS)
    assert [arm.name for arm in result.arms] == ["a", "b", "c"]
    assert result.motion.trajectory.joint_positions.shape == (len(result.time), 21)
    assert result.motion.clearance.share == 0.0
    for arm, pose in zip(result.arms, placed, strict=True):
        assert np.percentile(arm.motion.position_error, 95) < 12e-3
        assert np.abs(arm.motion.path - pose[:3, 3]).max() < 0.9
        assert arm.evaluation is not None
    with pytest.raises(InvalidInputError, match="arms"):
        _ = result.arm
    result.save(tmp_path / "three")
    assert {"a", "b", "c", "joints.csv"} <= {file.name for file in (tmp_path / "three").iterdir()}
