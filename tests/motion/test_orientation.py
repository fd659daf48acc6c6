"""How the tip is turned: in nodes, plans and the tracker, and what the person's hand says of it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport.arms import load_arm
from maniport.arms.human import hand_rotations
from maniport.errors import InvalidInputError
from motion_plans import planned_arm, tracked_arm

TIME = np.linspace(0.0, 2.0, 12)


@pytest.fixture(scope="module")
def motion(panda):
    """A small motion of the arm's own: ellipsoids, path, and how the tip is turned."""
    swing = np.array([0.4, 0.2, -0.3, 0.3, 0.3, 0.2, 0.2]) * np.sin(0.8 * TIME)[:, None]
    q = np.array([0.1, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5]) + swing
    return panda.manipulability(q), panda.forward(q)[:, :3, 3], panda.forward(q)[:, :3, :3]


@pytest.mark.parametrize("name", ["myoarm", "rhuman"])
def test_the_hand_points_from_the_wrist_along_itself(name):
    person = load_arm(name)
    q = person.sample(5, 0)
    rotations = hand_rotations(person, q)
    points = person.point_positions(q, ("wrist", "hand"))
    along = points[:, 1] - points[:, 0]
    assert_allclose(
        rotations[:, :, 2], along / np.linalg.norm(along, axis=1, keepdims=True), atol=1e-9
    )
    assert_allclose(
        rotations @ np.swapaxes(rotations, 1, 2),
        np.broadcast_to(np.eye(3), rotations.shape),
        atol=1e-9,
    )
    assert hand_rotations(person, np.zeros(7))[1, 1] > 0.95


@pytest.mark.parametrize("axes", ["pointing", "whole"])
def test_a_plan_and_the_tracker_keep_the_orientation(panda, planner, motion, axes):
    profile, path, rotations = motion
    rotations = rotations @ Rotation.from_euler("x", 30.0, degrees=True).as_matrix()
    options = {"time": 2.0 * TIME, "path": path, "damping": 0.01, "planner": planner}
    free = planned_arm(panda, profile, **options).arms[0]
    assert free.orientation_error is None
    kept = planned_arm(panda, profile, rotations=rotations, orientation_axes=axes, **options).arms[
        0
    ]
    assert max(share for _, share, _ in kept.limit_use.values()) <= 1.0 + 1e-9
    tips = panda.forward(free.joint_positions)[:, :3, 2]
    free_error = np.arccos(np.clip(np.sum(tips * rotations[:, :, 2], axis=1), -1.0, 1.0))
    options = {
        "time": kept.time,
        "path": path,
        "damping": 0.01,
        "rotations": rotations,
        "orientation_axes": axes,
    }
    tracked = tracked_arm(
        panda, profile, reference=kept.joint_positions, rate=50.0, **options
    ).arms[0]
    for motion in (kept, tracked):
        assert np.median(motion.orientation_error) < 0.1 < np.median(free_error)


def test_wrong_orientations_are_named(panda, motion):
    profile, path, rotations = motion
    with pytest.raises(InvalidInputError, match=r"^rotations\[0\]"):
        planned_arm(panda, profile, rotations=2.0 * rotations, time=TIME, path=path)
    with pytest.raises(InvalidInputError, match=r"^rotations.*\(12, 3, 3\)"):
        tracked_arm(panda, profile, rotations=rotations[:5], time=TIME, path=path)
