"""Either arm: a mirrored recording gives mirrored fits; which arm is taken; lengths from the body height."""

import re

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.arms.human import FRACTIONS, hand_rotations
from maniport.errors import InvalidInputError, RecordingError
from maniport.mocap import Recording, fit_arm, performed, read_recording
from maniport.mocap.roles import find_side
from mirror_images import in_a_mirror

S = np.diag([1.0, -1.0, 1.0])
DIFFER = pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")


@DIFFER
@pytest.mark.parametrize(("name", "person"), [("ladder", "rhuman"), ("freeform", "myoarm")])
def test_a_mirrored_recording_gives_mirrored_angles_and_ellipsoids(name, person):
    """The left arm of the mirrored recording has the right one's joint angles; path and ellipsoids are mirrored."""
    recording = read_recording(name).crop(0, 1)
    right, left = fit_arm(recording, person), fit_arm(in_a_mirror(recording), person)
    assert (right.arm.side, left.arm.side, left.arm.name) == ("right", "left", f"{person}_left")
    assert right.side_reason == left.side_reason == "the only one that the recording shows whole"
    q = right.joint_angles
    np.testing.assert_allclose(left.joint_angles, q, atol=1e-9)
    np.testing.assert_allclose(left.arm.ellipsoids(q), S @ right.arm.ellipsoids(q) @ S, atol=1e-9)
    np.testing.assert_allclose(left.arm.forward(q)[:, :3, 3], right.arm.forward(q)[:, :3, 3] @ S, atol=1e-9)
    np.testing.assert_allclose(left.residual, right.residual, atol=1e-6)
    for segment, twist in right.twist_residual.items():
        np.testing.assert_allclose(left.twist_residual[segment], -twist, atol=1e-6)
    assert left.summary == right.summary.replace("right arm", "left arm")
    assert set(left.reasons) == set(right.reasons)
    np.testing.assert_array_equal(left.seen, right.seen)


@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
def test_a_left_arm_that_performs_is_found_to_be_one(person, slow_motion):
    """A recording of a left arm gives its angles back, and where its points lie tells the side of unnamed ones."""
    arm = load_arm(person, side="left")
    time, q = slow_motion(arm)
    for side, reason in (("left", "as asked for"), ("auto", "the only one that the recording shows whole")):
        fit = fit_arm(performed(arm, q, time), person, side=side)
        np.testing.assert_allclose(fit.joint_angles, q, atol=1e-6)
        assert (fit.arm.side, fit.side_reason) == ("left", reason)
    with pytest.raises(RecordingError, match=r"shoulder of the right arm: .* to the left of trunk_up"):
        fit_arm(performed(arm, q, time), person, side="right")
    np.testing.assert_allclose(hand_rotations(fit.arm, q), hand_rotations(arm, q), atol=1e-12)


def two_arms(left=1.0, jitter=0.0, named="Right Left"):
    """Both arms swing forward and back beside a trunk that walks; the left one `left` times as far."""
    time = np.linspace(0.0, 4.0, 121)
    points = {"Hips": (0, 0, 0.9), "Neck": (0, 0, 1.45)}
    tracks = {name: np.tile(np.array(place, dtype=float), (len(time), 1)) for name, place in points.items()}
    for side, y, much in zip(named.split(), (-0.18, 0.18), (1.0, left), strict=True):
        angle = 0.6 * much * np.sin(2 * np.pi * 0.5 * time)
        down = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
        shoulder = np.tile([0.0, y, 1.4], (len(time), 1))
        bent = np.stack([np.sin(angle + 0.5), 0 * angle, -np.cos(angle + 0.5)], axis=1)
        tracks |= {f"{side}Arm": shoulder, f"{side}ForeArm": shoulder + 0.3 * down}
        tracks[f"{side}Hand"] = shoulder + 0.3 * down + 0.26 * bent
    walk = np.stack([1.2 * time, 0.1 * time, 0 * time], axis=1)
    positions = np.stack([track + walk for track in tracks.values()], axis=1)
    noise = np.random.default_rng(0).normal(scale=jitter, size=positions.shape) if jitter else 0.0
    return Recording(tuple(tracks), positions + noise, time)


@pytest.mark.parametrize(
    ("left", "side", "words"),
    [
        (2.0, "left", r"it moves more: .* its wrist moves 5\.21 m, the right one 2\.60 m; side='right' takes that"),
        (0.5, "right", r"it moves more: .* the left one .*; side='left' takes that"),
        (1.05, "right", "both move alike"),
        (0.95, "right", "both move alike"),
    ],
)
def test_of_two_arms_the_one_that_moves_more_is_taken(left, side, words):
    """Of two arms the one whose wrist goes the longer way beside the trunk; the right one within 10 %; told why."""
    for recording in (two_arms(left), two_arms(left, jitter=0.002)):
        assert find_side(recording)[0] == side
    assert re.match(words, find_side(two_arms(left))[1])


def test_lengths_that_are_not_recorded_come_of_the_height(arm, slow_motion, record):
    """With a height, a hand that is not seen and a forearm that nobody has get fractions of it, and the notes tell."""
    time, q = slow_motion(arm, n=20)
    fit = fit_arm(record(arm, time, q, hand=False), arm.name, height=1.8)
    assert fit.segment_lengths["upper arm"] == pytest.approx(0.31)
    assert fit.segment_lengths["hand"] == pytest.approx(1.8 * FRACTIONS["hand"])
    assert any("hand: 0.062 m by the body height of 1.8 m, as the recording does not show it" in n for n in fit.notes)
    ends = fit.arm.point_positions(np.zeros(7), ("wrist", "hand"))
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(1.8 * FRACTIONS["hand"])
    for wrong in (180, -1, float("nan"), "tall"):
        with pytest.raises(InvalidInputError, match="height"):
            fit_arm(record(arm, time, q), arm.name, height=wrong)
