"""A person's arm frame by frame: compiled as written, and causal."""

import dataclasses

import numpy as np
import pytest

import maniport as mp
from maniport.arms.chain import rotation_about
from maniport.arms.human import human_arm
from maniport.live.person import HiddenPoints, OneEuroFilter, Person
from maniport.mocap import synthetic_recording


def moving(side):
    """An arm that moves, its joint angles, a recording of it, and their times."""
    time = np.arange(0.0, 2.0, 1 / 120.0)
    arm = human_arm("myoarm", side)
    rest = [40.0, 50.0, -20.0, 60.0, 5.0, 2.0, 5.0]
    way = [20.0, 25.0, 15.0, 30.0, 20.0, 5.0, 10.0]
    return arm, np.radians(rest + way * np.sin(2.0 * time[:, None] + np.arange(7))), time


def estimates(person, recording, hidden=(), near=None):
    """Estimates of each frame of a recording, in which some points are hidden."""
    shown = np.stack([recording.point(name) for name in person.points], axis=1)
    shown[:, [person.points.index(name) for name in hidden]] = np.nan
    found = [person.begin(person.directions(person.vectors(shown[0])), near)]
    for points, dt in zip(shown[1:], np.diff(recording.time), strict=True):
        found.append(person.follow(found[-1], person.directions(person.vectors(points)), dt))
    return found


@pytest.mark.parametrize("side", ["right", "left"])
def test_joint_angles_are_those_that_move_the_arm(side):
    arm, q, time = moving(side)
    recording = synthetic_recording(arm, q, time)
    found = estimates(Person(mp.fit_arm(recording.crop(0.0, 0.5))), recording)
    assert np.degrees(np.abs([estimate.q for estimate in found] - q)).max() < 0.1


def test_unseen_joints_come_to_rest():
    arm, q, time = moving("right")
    q[:, 3] = 0.0
    recording = synthetic_recording(arm, q, time)
    found = estimates(
        Person(mp.fit_arm(recording)), recording, ("elbow_medial", "wrist_radial"), q[0]
    )
    assert np.isfinite([estimate.covariance for estimate in found]).all()
    assert np.abs(found[-1].velocity).max() < 5.0
    assert np.linalg.norm(arm.forward(found[-1].q)[:3, 3] - arm.forward(q[-1])[:3, 3]) < 0.03


def turning(speed, time):
    """A unit vector that turns at a constant speed [rad/s], shape (1, 3)."""
    return np.array([[np.cos(speed * time), np.sin(speed * time), 0.0]])


def test_filter_reduces_noise_at_rest_and_lags_by_its_cutoff():
    time = np.arange(0.0, 4.0, 1 / 30.0)
    noise = np.random.default_rng(0).normal(0.0, 0.04, (120, 1, 3))
    low_pass = OneEuroFilter(1)
    still = np.array([low_pass(turning(0.0, t) + noise[i], t) for i, t in enumerate(time)])
    assert still[60:].std(axis=0).max() < 0.02
    low_pass = OneEuroFilter(1)
    filtered = [low_pass(turning(2.0, t), t)[0] for t in time]
    lag = 2.0 * time - np.unwrap([np.arctan2(y, x) for x, y, _ in filtered])
    assert 0.1 < lag[-1] < 0.3  # [rad], 0.05 to 0.15 s


def test_filter_skips_what_is_not_seen_and_begins_anew_after_a_gap():
    low_pass = OneEuroFilter(2)
    hidden = np.array([[1.0, 0.0, 0.0], [np.nan] * 3])
    assert np.isnan(low_pass(hidden, 0.0)[1]).all()
    low_pass(np.eye(3)[:2], 0.1)
    filtered = low_pass(np.eye(3)[1:], 1.0)
    np.testing.assert_array_equal(filtered, np.eye(3)[1:])


def test_noisy_recordings_are_filtered():
    arm, q, time = moving("right")
    recording = synthetic_recording(arm, q, time)
    noise = np.random.default_rng(0).normal(0.0, 0.008, recording.positions.shape)
    noisy = dataclasses.replace(recording, positions=recording.positions + noise)
    assert Person(mp.fit_arm(noisy)).is_noisy
    assert not Person(mp.fit_arm(noisy, smooth="off")).is_noisy
    assert not Person(mp.fit_arm(recording)).is_noisy


def test_hidden_points_move_with_the_points_around_them():
    linear = np.array(
        [[-1.0, 0.5, 0.5, 0.0], [0.0, -0.5, -0.5, 1.0]]
    )  # shoulder, two markers of the elbow, wrist
    frame = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3, 0.05, 0.01], [0.5, 0.2, 0]])
    turn = rotation_about(2, 0.5)
    moved = frame @ turn.T + 0.1
    points = HiddenPoints(linear)
    points.remember(frame, frame, 0.0)
    for i, longest in ((2, 2.0), (3, 0.1)):
        hidden = moved.copy()
        hidden[i] = np.nan
        np.testing.assert_allclose(points.fill(hidden, longest), moved, atol=1e-6)
        np.testing.assert_array_equal(points.fill(hidden, longest + 0.01), hidden)
    nothing = np.full((4, 3), np.nan)
    np.testing.assert_array_equal(points.fill(nothing, 0.01), nothing)
