"""A person's arm frame by frame: compiled as written, and causal."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport.arms.human import human_arm
from maniport.live.person import Person
from maniport.mocap import synthetic_recording
from maniport.mocap.directions import Directions, frame_terms


def moving(side, rate=120.0):
    """Joint angles of an arm that moves, and their times."""
    time = np.arange(0.0, 2.0, 1 / rate)
    rest, way = (
        np.radians([40.0, 50.0, -20.0, 60.0, 5.0, 2.0, 5.0]),
        np.radians([20.0, 25.0, 15.0, 30.0, 20.0, 5.0, 10.0]),
    )
    return human_arm("myoarm", side), rest + way * np.sin(2.0 * time[:, None] + np.arange(7)), time


def found_in(person, recording):
    """Joint angles of each frame of a recording."""
    shown = np.stack([recording.point(name) for name in person.points], axis=1)
    posture, angles = person.begin(person.directions(shown[0])), []
    for i, points in enumerate(shown):
        if i:
            posture = person.follow(posture, person.directions(points), recording.time[i] - recording.time[i - 1])
        angles.append(posture.q)
    return np.array(angles)


@pytest.mark.parametrize("side", ["right", "left"])
def test_joint_angles_are_those_that_move_the_arm(side):
    """A model's own motion is found to a tenth of a degree, causally, of either arm."""
    arm, q, time = moving(side)
    recording = synthetic_recording(arm, q, time)
    found = found_in(Person(mp.fit_arm(recording.crop(0.0, 0.5))), recording)
    assert np.degrees(np.abs(found - q)).max() < 0.1


def test_unseen_joints_come_to_rest():
    """Where markers of the elbow's axis are missing and the arm is straight, nothing drifts away."""
    arm, q, time = moving("right")
    q[:, 3] = 0.0
    recording = synthetic_recording(arm, q, time)
    person = Person(mp.fit_arm(recording))
    shown = np.stack([recording.point(name) for name in person.points], axis=1)
    shown[:, [person.points.index(name) for name in ("elbow_medial", "wrist_radial")]] = np.nan
    posture = person.begin(person.directions(shown[0]), q[0])
    for i in range(1, len(time)):
        posture = person.follow(posture, person.directions(shown[i]), time[i] - time[i - 1])
        assert np.isfinite(posture.covariance).all()
    assert np.abs(posture.velocity).max() < 5.0
    assert np.linalg.norm(arm.forward(posture.q)[:3, 3] - arm.forward(q[-1])[:3, 3]) < 0.03


@pytest.mark.parametrize(
    "names", [("upper arm", "forearm"), ("upper arm", "forearm", "hand", "elbow_axis", "wrist_axis")]
)
@pytest.mark.parametrize("person", ["myoarm", "rhuman"])
def test_one_frame_is_compiled_as_many_are(person, names):
    """Cost, gradient and Hessian are those of `Directions.residual`, unseen markers included."""
    arm, draw = human_arm(person), np.random.default_rng(0)
    q, targets = arm.sample(4, 1), draw.normal(size=(4, len(names), 3))
    targets /= np.linalg.norm(targets, axis=-1, keepdims=True)
    targets[3, -1] = np.nan
    directions = Directions(arm, names, targets)
    residuals, slopes = directions.residual(q)
    body, weights = directions.arrays()
    for i, (r, j) in enumerate(zip(residuals, slopes, strict=True)):
        gradient, hessian = np.zeros(arm.dof), np.zeros((arm.dof, arm.dof))
        seen = np.where(np.isnan(targets[i, :, 0]), 0.0, weights)
        cost = frame_terms(q[i], *body, np.nan_to_num(targets[i]), seen, gradient, hessian)
        assert_allclose(cost, r @ r)
        assert_allclose(gradient, j.T @ r, atol=1e-12)
        assert_allclose(hessian, j.T @ j, atol=1e-12)
