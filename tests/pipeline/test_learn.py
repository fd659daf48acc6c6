"""Several demonstrations become one profile, from recordings to files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport.arms import VELOCITY
from maniport.arms.human import human_arm
from maniport.errors import InvalidInputError
from maniport.learning.alignment import axis_deviations
from maniport.mocap import Recording, shipped_recording, synthetic_recording
from maniport.pipeline.results import RESULT_FILES
from maniport.report.describe import report_of
from maniport.report.render import as_numbers
from maniport.util.files import load_ellipsoids, load_path
from sizes import SMALL, little_search

REPORTS = "report.html", "summary.md", "summary.json"

REACHES = [(1.4, 2.1), (2.5, 3.2), (6.8, 7.7)]
"""Times at which the person of the shipped recording reaches out to the right."""


def reach(side="right", scale=1.0, lift=0.0, name="reach"):
    arm = human_arm(
        "myoarm",
        side,
        lengths={"upper arm": 0.3 * scale, "forearm": 0.25 * scale, "hand": 0.08 * scale},
    )
    time = np.linspace(0.0, 1.0, 31)
    way = np.sin(np.pi * time**scale)[:, None]
    q = np.radians([40.0, 40.0, -20.0, 60.0, 5.0, 2.0, 5.0]) + way * np.radians(
        [20.0, 30.0 + lift, 10.0, -20.0, 0, 0, 0]
    )
    return synthetic_recording(arm, q, time, name)


def reach_with_both(scale=1.0, lift=0.0):
    right = reach("right", scale, lift)
    left = reach("left", scale, lift)
    between = right.point("trunk_low") - left.point(
        "trunk_low"
    )  # both stand before their own shoulder
    points = {f"right_{name}": right.point(name) for name in right.names if "trunk" not in name}
    points |= {
        f"left_{name}": left.point(name) + between for name in left.names if "trunk" not in name
    }
    points |= {name: right.point(name) for name in right.names if "trunk" in name}
    return Recording(
        tuple(points), np.stack(list(points.values()), axis=1), right.time, source="both"
    )


@pytest.fixture(scope="module")
def people():
    """What three people of unequal size teach, one of them with the left arm."""
    return mp.learn(
        [reach(), reach(scale=1.2), reach("left", lift=3.0, name="lefty")], components=2
    )


def test_reaches_of_one_recording_are_more_alike_than_the_motion_changes():
    reached = mp.learn([shipped_recording("freeform")], segments=[REACHES], components=4)
    n = len(reached.time)
    agreement = reached.agreement
    start, stop = REACHES[reached.alignment.reference]
    assert start <= reached.time[0] < reached.time[-1] <= stop
    assert (len(reached.demonstrations), reached.profile.shape, reached.path.shape) == (
        3,
        (n, 3, 3),
        (n, 3),
    )
    assert_allclose(reached.profile, reached.model.predict(reached.time), rtol=1e-12)
    assert agreement.after < agreement.before
    assert agreement.share < 0.5
    assert np.mean(agreement.held_out["learned"]) < np.mean(agreement.held_out["one_for_all_times"])


def test_both_arms_are_learned_together(tmp_path):
    """The ellipsoids of the arms are blocks, each aligned with the other; a robot of two arms takes them."""
    learned = mp.learn(
        [reach_with_both(), reach_with_both(1.2), reach_with_both(lift=3.0)],
        side="both",
        components=2,
    )
    n = len(learned.time)
    assert (learned.profile.shape, learned.path.shape) == ((n, 6, 6), (n, 6))
    assert_allclose(learned.profile[:, :3, 3:], 0.0, atol=1e-9)
    assert [part.arms[0].side for part in learned.each_arm()] == ["left", "right"]
    left, right = learned.each_arm()
    mirror = np.diag([1.0, -1.0, 1.0])
    assert_allclose(left.profile, mirror @ right.profile @ mirror, atol=1e-6)
    assert_allclose(left.path, right.path @ mirror, atol=1e-6)
    for part, hand in zip((left, right), learned.reference.motion.hands, strict=True):
        assert np.abs(part.path - hand).max() < 0.05
        assert axis_deviations(part.profile, part.covariance).max() < 0.5
    assert learned.agreement.after < 0.2
    held_out = learned.agreement.held_out
    assert np.mean(held_out["learned"]) < 0.7 * np.mean(held_out["one_for_all_times"])
    mp.write_results(learned, tmp_path / "both")
    right, _ = load_ellipsoids(tmp_path / "both" / "profile-right.npz")
    assert_allclose(right, learned.profile[:, 3:, 3:])
    pandas = mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)])
    result = mp.transfer_recording(learned, robot=pandas, method="identity", move=False, **SMALL)
    assert_allclose(result.arms[1].demonstrated_profile, learned.profile[:, 3:, 3:])
    with pytest.raises(InvalidInputError, match="2 arms"):
        mp.transfer_recording(learned, robot="panda", method="identity", move=False)


def test_left_and_right_are_mirrored_and_said(people):
    assert people.arms[0].side == "right"
    assert people.agreement.after < 0.2
    assert any(
        "irrored to the right arm: lefty" in text for text in as_numbers(report_of(people))["notes"]
    )


def test_a_robot_follows_what_was_learned(people):
    with little_search():
        result = mp.transfer_recording(people, method="identity", **SMALL)
    assert_allclose(result.arm.demonstrated_profile, people.profile)
    placed = result.arm.placement
    assert_allclose(placed.apply(people.path), result.arm.motion.path, atol=1e-9)
    assert result.arm.fit.arm is people.arms[0]
    with pytest.raises(InvalidInputError, match="spec"):
        mp.transfer_recording(people, ellipsoids="force", move=False, **SMALL)
    assert people.config.spec == VELOCITY


def test_files_are_whole_and_can_be_read(people, tmp_path):
    """What is written is what was learned; data alone are written by `save`."""
    mp.write_results(people, tmp_path / "all")
    files = {file.name for file in (tmp_path / "all").iterdir()}
    assert (
        files
        == {"profile.npz", "path.npz", "model.npz", "demonstrations.npz", "run.yaml", *REPORTS}
        <= RESULT_FILES
    )
    assert {file.name for file in mp.write_figures(tmp_path / "all")} == {
        "learned.png",
        "learned.svg",
    }
    ellipsoids, time = load_ellipsoids(tmp_path / "all" / "profile.npz")
    path, path_time = load_path(tmp_path / "all" / "path.npz")
    assert_allclose(ellipsoids, people.profile)
    assert_allclose(path, people.path)
    assert_allclose(time, path_time)
    people.save(tmp_path / "data")
    model = np.load(tmp_path / "data" / "model.npz")
    assert_allclose(model["covariances"], people.model.covariances_)
    with pytest.raises(InvalidInputError, match=r"exports.*motion"):
        mp.write_results(people, tmp_path / "more", exports=["ros2"])


@pytest.mark.filterwarnings("ignore::maniport.errors.ManiportWarning")
@pytest.mark.parametrize(
    ("recordings", "segments", "message"),
    [
        ([], None, "at least one recording"),
        (["freeform"], [[(1.0, 2.0)]], "at least two demonstrations are needed; found 1"),
        (["freeform"], [[(1.0, 2.0), (1.5, 3.0)]], "must not overlap"),
        (["freeform"], [[(2.0, 1.0), (2.5, 3.0)]], "must begin before they end"),
        (
            ["freeform"],
            [[(1.0, 2.0), (2.5, 99.0)]],
            "must lie between 0.00 and 9.15 s; found 2.5 to 99 s",
        ),
        (["freeform"], [[(1.0, 2.0), (2.5, 2.6)]], "has 5 frames .* needs at least 10"),
        (["freeform"], "all", "must be auto or times such as 2:4.*; found 'all'"),
        (["freeform"], [None, None], "one list for each of the 1"),
    ],
)
def test_what_is_wrong_is_said(recordings, segments, message):
    with pytest.raises(InvalidInputError, match=message):
        mp.learn(recordings, segments=segments)


def test_repetitions_are_demonstrations(repeated):
    learned = mp.learn([repeated], segments="auto", components=2)
    assert len(learned.demonstrations) == 4
    assert learned.agreement.after < 0.1
