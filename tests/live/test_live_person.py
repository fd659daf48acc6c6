"""A person's arm frame by frame: compiled as written, and causal as stated."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport.bodies.human import human_arm
from maniport.demonstrations import frame_kernel, performed
from maniport.demonstrations.directions import Directions
from maniport.demonstrations.roles import SHORTEST, trunk_axes, unit
from maniport.live import kernels
from maniport.live.person import Person


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
    posture, angles = person.begin(person.seen(shown[0])), []
    for i, points in enumerate(shown):
        if i:
            posture = person.follow(posture, person.seen(points), recording.time[i] - recording.time[i - 1])
        angles.append(posture.q)
    return np.array(angles)


@pytest.mark.parametrize("side", ["right", "left"])
def test_joint_angles_are_those_that_move_the_arm(side):
    """A model's own motion is found to a tenth of a degree, causally, of either arm."""
    arm, q, time = moving(side)
    recording = performed(arm, q, time)
    found = found_in(Person(mp.fit_arm(recording.crop(0.0, 0.5))), recording)
    assert np.degrees(np.abs(found - q)).max() < 0.1


@pytest.mark.parametrize("forward", [True, False])
def test_directions_are_compiled_as_the_offline_fit_has_them(forward):
    """They are those of `trunk_axes` and `unit`; what needs a point that is not seen is nan, without a trunk all is."""
    draw = np.random.default_rng(0)
    points, linear = draw.normal(size=(6, 3)), np.zeros((5, 6))
    linear[range(5), range(5)], linear[range(5), range(1, 6)] = -1.0, 1.0
    vectors, found, needed = linear @ points, np.empty((3, 3)), np.array([False] * 3 + [True] * 3)
    expected = unit(vectors[:3] @ trunk_axes(vectors[3], vectors[4], forward))
    assert kernels.show(points, linear, needed, 1, forward, SHORTEST, found)
    assert_allclose(found, expected, atol=1e-14)
    points[2] = np.nan
    assert kernels.show(points, linear, needed, 1, forward, SHORTEST, found)
    assert_allclose(found, [expected[0], [np.nan] * 3, [np.nan] * 3], atol=1e-14)
    assert not kernels.show(points, linear, needed, 2, forward, SHORTEST, found)
    points[2], points[4:] = 0.0, points[3]
    assert not kernels.show(points, linear, needed, 1, forward, SHORTEST, found)
    points[4] = np.nan
    assert not kernels.show(points, linear, needed, 0, forward, SHORTEST, found)


def test_unseen_joints_come_to_rest():
    """Where markers of the elbow's axis are missing and the arm is straight, nothing drifts away."""
    arm, q, time = moving("right")
    q[:, 3] = 0.0
    recording = performed(arm, q, time)
    person = Person(mp.fit_arm(recording))
    shown = np.stack([recording.point(name) for name in person.points], axis=1)
    shown[:, [person.points.index(name) for name in ("elbow_medial", "wrist_radial")]] = np.nan
    posture = person.begin(person.seen(shown[0]), q[0])
    for i in range(1, len(time)):
        posture = person.follow(posture, person.seen(shown[i]), time[i] - time[i - 1])
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
        cost = frame_kernel.frame_terms(q[i], *body, np.nan_to_num(targets[i]), seen, gradient, hessian)
        assert_allclose(cost, r @ r)
        assert_allclose(gradient, j.T @ r, atol=1e-12)
        assert_allclose(hessian, j.T @ j, atol=1e-12)


def test_what_a_frame_tells_is_learned_as_kalman_says():
    """The covariance after an information of the angles is the inverse of the sum of informations."""
    draw = np.random.default_rng(1)
    root, told = draw.normal(size=(6, 6)), draw.normal(size=(3, 3))
    covariance, information = root @ root.T + np.eye(6), told @ told.T
    whole = np.linalg.inv(covariance)
    whole[:3, :3] += information
    kernels.learn(covariance, information)
    assert_allclose(covariance, np.linalg.inv(whole), atol=1e-10)
