"""Fits of recordings with faults, beside those of the same motion without."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from maniport import arms, spd
from maniport.errors import UnknownNameError
from maniport.mocap import Recording, fit_arm, performed, read_recording

POSES = np.radians([[20, 60, 0, 70, 0, 5, 0], [40, 35, 30, 40, 20, 8, 20]])
"""A posture, and by how much joints wander beside it."""
KEYPOINTS = ("shoulder", "elbow", "wrist", "hand", "trunk_right", "trunk_left", "trunk_low")


@pytest.fixture(scope="module")
def arm():
    """A person's arm."""
    return arms.myoarm(0.3, 0.26, 0.06)


def wandering(arm, rate=30.0, seconds=12.0, seed=0):
    """Times and joint angles of a motion that is the same at every frame rate."""
    time, knots = np.arange(int(seconds * rate) + 1) / rate, np.arange(0.0, seconds + 2.0, 0.8)
    ways = np.random.default_rng(seed).uniform(-1, 1, (len(knots), arm.dof))
    return time, POSES[0] + POSES[1] * CubicSpline(knots, ways)(time)


def keypoints(arm, time, q):
    """What a video shows: the arm, both shoulders and the middle of the hips."""
    ends = arm.point_positions(q, KEYPOINTS[:4])
    right, left, low = (np.tile(place, (len(time), 1, 1)) for place in ([0, -0.15, 0], [0, 0.15, 0], [0, 0, -0.5]))
    return Recording((*KEYPOINTS, "trunk_high"), np.concatenate([ends, right, left, low, 0 * low], axis=1), time)


def errors(fit, truth):
    """Root mean square of the first four joints' errors [degrees], and the mean distance of the ellipsoids."""
    joints = np.degrees(fit.joint_angles - truth.joint_angles)[:, :4]
    ours, theirs = (one.arm.manipulability(one.joint_angles) for one in (fit, truth))
    return float(np.sqrt(np.mean(joints**2))), float(np.mean(spd.distance(ours, theirs)))


@pytest.mark.filterwarnings("ignore:the model of the arm and the person differ")
def test_keypoints_of_video_are_fitted_several_times_closer(arm):
    """With 10 mm of noise and 3 % of points 0.2 m off, angles and ellipsoids come twice as near to the truth."""
    clean = keypoints(arm, *wandering(arm, seconds=5.0))
    generator = np.random.default_rng(1)
    noisy = clean.positions + generator.normal(0.0, 0.01, clean.positions.shape)
    away = generator.normal(size=noisy.shape)
    away *= 0.2 / np.linalg.norm(away, axis=-1, keepdims=True)
    off = generator.random(noisy.shape[:2]) < 0.03
    noisy = np.where(off[..., None], noisy + away, noisy)
    video = replace(clean, positions=noisy)
    truth, mended = fit_arm(clean, side="right"), fit_arm(video, side="right")
    raw = fit_arm(video, side="right", smooth="off")
    (joints, ellipsoids), (raw_joints, raw_ellipsoids) = errors(mended, truth), errors(raw, truth)
    assert joints < 0.5 * raw_joints
    assert ellipsoids < 0.5 * raw_ellipsoids
    assert joints < 2.5
    assert any("jitter by" in doubt and "were smoothed" in doubt for doubt in mended.quality_warnings)
    assert any("elsewhere for a moment" in note for note in mended.notes)


def test_mended_faults_leave_the_fit_as_it_is(arm):
    """Zeros for missing, a second unit and exchanged wrists in one recording: the angles of the clean one."""
    time, q = wandering(arm)
    clean = performed(arm, q, time)
    names = tuple({"wrist": "RightWrist"}.get(name, name) for name in clean.names)
    left = clean.positions[:, [clean.names.index("wrist")]] * [1.0, -1.0, 1.0]
    positions = np.concatenate([clean.positions, left], axis=1)
    positions[40:43, names.index("hand")] = 0.0
    wrist = names.index("RightWrist")
    positions[100:120, [wrist, -1]] = positions[100:120, [-1, wrist]]
    positions[300:] *= 1000.0
    faulty = Recording((*names, "LeftWrist"), positions, time)
    markers = {"wrist": "RightWrist"}
    fit = fit_arm(faulty, markers=markers, side="right")
    assert np.degrees(np.abs(fit.joint_angles - fit_arm(clean, side="right").joint_angles).max()) < 0.3
    assert any("hand: exactly at the origin in 3 frames" in note for note in fit.notes)
    assert [text for text in fit.quality_warnings if "each other's places in 20 frames" in text]
    assert [text for text in fit.quality_warnings if "1000 times as large" in text]
    assert not fit_arm(clean, side="right").quality_warnings


def test_leaps_of_a_real_recording_are_told_smoothed_or_cut(arm):
    """Where the arm hangs, joints of the ladder leap: kept and told, or gone by either option, elsewhere unchanged."""
    recording = read_recording("ladder").crop(11, 14)
    kept = fit_arm(recording)
    assert kept.largest_step[0] > 60
    assert "joints leap in" in kept.quality_warnings[-1]
    assert "most elv_angle" in kept.quality_warnings[-1]
    assert "jumps='smooth' goes over them evenly" in kept.quality_warnings[-1]
    smooth, split = fit_arm(recording, jumps="smooth"), fit_arm(recording, jumps="split")
    assert smooth.largest_step[0] < 50
    assert "All joints go evenly from 0.15 s before" in smooth.quality_warnings[-1]
    np.testing.assert_array_equal(smooth.joint_angles[70:], kept.joint_angles[70:])
    assert split.largest_step[0] < 50
    assert len(split) < len(kept)
    np.testing.assert_array_equal(split.joint_angles, kept.joint_angles[split.frames])
    assert "The longest part between them is used" in split.quality_warnings[-1]
    with pytest.raises(UnknownNameError, match=r"unknown jumps 'smoth'; there are, nearest first: 'smooth'"):
        fit_arm(recording, jumps="smoth")
