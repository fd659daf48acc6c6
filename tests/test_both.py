"""The main job with both arms: what becomes of each, of both together, what is written, and what is refused at once."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

import maniport as mp
from maniport.arms.restriction import standing
from maniport.cli import app
from maniport.errors import InvalidInputError, ManiportError, OutputError, RecordingError
from maniport.report.metrics import report_of
from sizes import SMALL

BASES = [(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)]
SIDES = "left", "right"
GIVEN = {"method": "parallel-transport", **SMALL}


@pytest.fixture(scope="module")
def recording():
    """A third of a second in which both arms are seen."""
    return mp.read_recording("both-arms").crop(5.1, 5.4)


@pytest.fixture(scope="module")
def arms():
    """Two Pandas side by side."""
    return mp.load_arms("panda", bases=BASES)


@pytest.fixture(scope="module")
def moved(recording, arms):
    """A run in which both arms move."""
    return mp.transfer_recording(recording, robot=arms, **GIVEN)


@pytest.fixture(scope="module")
def still(recording):
    """One that ends with the targets."""
    return mp.transfer_recording(recording, robot=mp.load_arms("panda", bases=BASES), move=False, **GIVEN)


def hands_of(result):
    """Paths of both hands in their common frame."""
    return [arm.fit.arm.forward(arm.fit.joint_angles)[:, :3, 3] + arm.person_base for arm in result.arms]


def test_the_left_arm_goes_to_the_left_and_the_right_to_the_right(moved, arms):
    """Each arm of the person becomes the robot's of its side; the demonstrated ellipsoids are its own."""
    for side, one, arm in zip(SIDES, moved.arms, arms.arms, strict=True):
        assert one.fit.arm.side == side
        assert one.robot is arm
        np.testing.assert_allclose(one.demonstrated_profile, one.fit.arm.manipulability(one.fit.joint_angles))
        np.testing.assert_allclose(one.target_profile, one.adapter.transform(one.demonstrated_profile))
    assert not np.array_equal(moved.arms[0].target_profile, moved.arms[1].target_profile)


def test_the_hands_keep_their_relation(moved):
    """Both paths are scaled, turned and moved alike: from tip to tip it is as from hand to hand, scaled and turned."""
    left, right = (one.placement for one in moved.arms)
    assert left.scale == right.scale
    np.testing.assert_array_equal(left.rotation, right.rotation)
    hands = hands_of(moved)[1] - hands_of(moved)[0]
    paths = moved.arms[1].motion.path - moved.arms[0].motion.path
    np.testing.assert_allclose(paths, left.scale * hands @ (left.rotation @ left.turn).T, atol=1e-9)


def test_one_motion_moves_both(moved, arms):
    """The joints of both are those of each, at the same times, within all limits; nothing collides."""
    motion = moved.motion
    q = arms.joined(*(one.motion.joint_positions for one in moved.arms))
    np.testing.assert_allclose(motion.trajectory.joint_positions, q, atol=1e-12)
    for one in moved.arms:
        np.testing.assert_array_equal(one.motion.time, motion.trajectory.time)
        assert np.percentile(one.motion.position_error, 95) < 12e-3
    assert max(share for _, share, _ in motion.limit_use.largest.values()) <= 1.0 + 1e-9
    assert motion.clearance.checked
    assert motion.clearance.share == 0.0


def test_tips_may_leave_their_paths_and_be_turned(recording, arms):
    """Tips that keep the way between them alone are turned as is asked, and what both costs is told."""
    found = mp.transfer_recording(recording, robot=arms, hand_targets="relative", orientation="constant", **GIVEN)
    hands = np.linalg.norm(hands_of(found)[1] - hands_of(found)[0], axis=1)
    np.testing.assert_allclose(np.ptp(np.linalg.norm(found.motion.relative[:, 0], axis=1) / hands), 0.0, atol=1e-9)
    assert np.percentile(found.motion.relative_error, 95) < 5e-3
    for one in found.arms:
        runs = one.motion, one.free
        turned, freely = (np.ptp(one.robot.forward(run.joint_positions)[:, :3, 2], axis=0).max() for run in runs)
        assert turned < freely
        assert one.placement is None
    assert any(one.key == "relative_position_error" and one.unit == "mm" for one in report_of(found).metrics)


def test_the_same_seed_gives_the_same_targets(still, recording, arms, moved):
    """Targets depend on the seed and on nothing else; those of postures without collisions between the arms differ."""
    again = mp.transfer_recording(recording, robot=arms, move=False, **GIVEN)
    for one, other in zip(still.arms, again.arms, strict=True):
        np.testing.assert_array_equal(one.target_profile, other.target_profile)
    assert still.motion is None
    assert "not moved" in repr(still)
    assert not np.array_equal(still.arms[0].student_domain, moved.arms[0].student_domain)


def test_both_are_told_together_and_apart(moved):
    """One section of the pair with a row for each arm, and of each arm the sections of a run of one, by side."""
    facts = report_of(moved)
    keys = [section.key for section in facts.sections]
    assert keys[0] == "arms"
    for side in SIDES:
        assert {f"{side}_motion", f"{side}_placement", f"{side}_adapter", f"{side}_person"} <= set(keys)
    assert keys.count("recording") == 1
    assert re.fullmatch(
        r"Left: position .* waypoints reached\. Right: position .* waypoints reached\.", facts.summary.title
    )
    assert facts.status in ("green", "amber", "red")
    labels = [metric.label for metric in facts.main_metrics[:2]]
    assert labels == ["Left: ellipsoid distance", "Right: ellipsoid distance"]
    own = ("left arm:", "right arm:", "left and right", "frames")
    assert all(text.lower().startswith(("left arm", "right arm")) or any(o in text for o in own)
               for text in facts.warnings)  # fmt: skip


def test_a_folder_holds_both_and_each(moved, tmp_path):
    """One joint file of both; the folder of each arm is that of a run of one; all that is there is replaced at will."""
    folder = tmp_path / "both"
    moved.save(folder)
    header = (folder / "joints.csv").read_text().split("\n", 1)[0]
    assert all(f"{name}_rad," in header for name in moved.robot.joint_names)
    with np.load(folder / "joints.npz") as arrays:
        np.testing.assert_array_equal(arrays["joint_positions"], moved.motion.trajectory.joint_positions)
    for side in SIDES:
        assert {"person.csv", "target_profile.npz", "adapter.npz", "joints.csv"} <= {
            file.name for file in (folder / side).iterdir()
        }
    with pytest.raises(OutputError, match="holds an earlier result"):
        moved.save(folder)
    (folder / "left" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"'mine\.txt'"):
        mp.write_results(moved, folder, overwrite=True)


def test_what_is_shown_of_both_is_in_their_folder(moved, tmp_path):
    """Page and scene of both are next to the folders of the arms; figures have a column for each arm."""
    mp.write_results(moved, tmp_path / "both", exports="rerun")
    found = {file.name for file in (tmp_path / "both").iterdir()}
    assert {"report.html", "motion.rrd", "summary.json", "left", "right"} <= found
    for side in SIDES:
        assert (tmp_path / "both" / side / "target_profile.npz").exists()
    files = mp.write_figures(tmp_path / "both")
    assert {file.name for file in files} == {
        f"{name}.{suffix}" for name in ("arms", "curves", "motion") for suffix in ("png", "svg")
    }
    words = (tmp_path / "both" / "motion.svg").read_text()
    assert "Left: Ellipsoid distance" in words
    assert "right_panda_joint1 [°]" in words
    mp.write_results(moved, tmp_path / "both", overwrite=True)


def test_exports_are_of_a_motion(still, tmp_path):
    """Where nothing moves there is nothing to export: told, and nothing is written."""
    with pytest.raises(InvalidInputError, match="exports are of a robot's motion"):
        mp.write_results(still, tmp_path / "other", exports="ros2")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"recording": "freeform"}, RecordingError, "shows the right"),
        ({"robot": mp.load_arm("panda"), "side": "both"}, InvalidInputError, "side"),
        ({"method": "magic"}, ManiportError, "unknown method 'magic'"),
        ({"markers": {"elbow": "RELB"}}, InvalidInputError, "must be"),
        ({"hand_targets": "absolute"}, InvalidInputError, "unknown hand_targets 'absolute'"),
        (
            {"hand_targets": "relative", "workspace": [(0, 1)] * 3, "move": True},
            InvalidInputError,
            "workspace bounds paths",
        ),
        (
            {"orientation": (0, 0, -1), "orientation_axes": "whole"},
            InvalidInputError,
            "orientation_axes must be 'pointing'",
        ),
        ({"gain": 1.0}, InvalidInputError, "unknown option 'gain'"),
        ({"spec": "velocity"}, InvalidInputError, "unknown option 'spec'"),
    ],
)
def test_wrong_arguments_are_named_before_long_work(recording, arms, given, error, words, monkeypatch):
    """What is wrong is said before anything is sampled."""
    monkeypatch.setattr("maniport.pipeline.stages.sample_domains", lambda *_, **__: pytest.fail("it sampled"))
    ready = {"recording": recording, "robot": arms, "move": False, **GIVEN} | given
    with pytest.raises(error, match=words):
        mp.transfer_recording(**ready)


PANDAS = ("--pose", "0,0.3,0,0", "--pose", "0,-0.3,0,0")


BOTH = ("both-arms", "--side", "both")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ((*BOTH, *PANDAS[:2]), "two"),
        ((*BOTH, *PANDAS, "--base", "panda_link1"), "is for one arm"),
        ((*BOTH, *PANDAS, "--frame", "panda_link8,panda_lnk8"), "unknown frame 'panda_lnk8'"),
        ((*BOTH, *PANDAS, "--hand-targets", "absolute"), "unknown --hand-targets 'absolute'"),
        ((*BOTH, *PANDAS, "--lock", "panda_joint1=10", "--lock", "left_panda_joint1=20"), "is named twice"),
        (BOTH, "must have two arms"),
        ((*BOTH, "--pose", "0,0,0,0", "--pose", "0,0,0,0"), "one place"),
        (("both-arms", "--hand-targets", "relative"), "needs several arms"),
    ],
)
def test_wrong_input_of_the_command_ends_with_one_sentence(monkeypatch, tmp_path, words, found):
    """Exit code 2, a message that names what is wrong, and no file, before anything is sampled."""
    monkeypatch.setattr("maniport.pipeline.stages.sample_domains", lambda *_, **__: pytest.fail("it sampled"))
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["transfer", *words, "-o", "out"])
    assert isinstance(result.exception, ManiportError), result.output
    assert found in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_pair_where_one_arm_is_asked_for_is_told_what_moves_it(recording, arms):
    """The main job of one arm names that of both."""
    with pytest.raises(InvalidInputError, match="ArmGroup"):
        mp.load_arm(arms)
    with pytest.raises(InvalidInputError, match="both"):
        mp.fit_arm(recording, side="both")


def test_one_arm_of_a_person_leads_three_arms(recording, tmp_path):
    """Each Panda moves in front of its own base, with targets, errors and files of its own; the motion has one time."""
    panda, placed = mp.load_arm("panda"), np.tile(np.eye(4), (3, 1, 1))
    placed[:, 1, 3] = (1.2, 0.0, -1.2)
    arms = mp.ArmGroup(*(mp.Arm(standing(panda.chain, pose)) for pose in placed), names=("a", "b", "c"))
    result = mp.transfer_recording(recording, robot=arms, side="right", **GIVEN)
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
