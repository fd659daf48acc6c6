"""A person's arm frame by frame: compiled as written, and causal."""

import numpy as np
import pytest

import maniport as mp
from maniport.arms.human import human_arm
from maniport.live.person import Person
from maniport.mocap import synthetic_recording


def moving(side):
    """An arm that moves, its joint angles, a recording of it, and their times."""
    time, arm = np.arange(0.0, 2.0, 1 / 120.0), human_arm("myoarm", side)
    rest, way = [40.0, 50.0, -20.0, 60.0, 5.0, 2.0, 5.0], [20.0, 25.0, 15.0, 30.0, 20.0, 5.0, 10.0]
    return arm, np.radians(rest + way * np.sin(2.0 * time[:, None] + np.arange(7))), time


def estimates(person, recording, hidden=(), near=None):
    """Estimates of each frame of a recording, in which some points are hidden."""
    shown = np.stack([recording.point(name) for name in person.points], axis=1)
    shown[:, [person.points.index(name) for name in hidden]] = np.nan
    found = [person.begin(person.directions(shown[0]), near)]
    for points, dt in zip(shown[1:], np.diff(recording.time), strict=True):
        found.append(person.follow(found[-1], person.directions(points), dt))
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
    found = estimates(Person(mp.fit_arm(recording)), recording, ("elbow_medial", "wrist_radial"), q[0])
    assert np.isfinite([estimate.covariance for estimate in found]).all()
    assert np.abs(found[-1].velocity).max() < 5.0
    assert np.linalg.norm(arm.forward(found[-1].q)[:3, 3] - arm.forward(q[-1])[:3, 3]) < 0.03
