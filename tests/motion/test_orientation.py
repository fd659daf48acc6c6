"""How the tip is turned: in nodes, plans and the tracker, and what the person's hand says of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from maniport.arms import load_arm
from maniport.arms.human import hand_rotations
from maniport.errors import InvalidInputError, UnknownNameError
from maniport.motion import Objective, plan_motion, track
from maniport.motion.costs.orientation import POINTING, WHOLE, axis_weights
from maniport.pipeline.options import MotionOptions

TIME = np.linspace(0.0, 2.0, 12)


@pytest.fixture(scope="module")
def motion(panda):
    """A small motion of the arm's own: ellipsoids, path, and how the tip is turned."""
    swing = np.array([0.4, 0.2, -0.3, 0.3, 0.3, 0.2, 0.2]) * np.sin(0.8 * TIME)[:, None]
    q = np.array([0.1, -0.5, 0.1, -2.0, 0.1, 1.7, 0.5]) + swing
    return panda.manipulability(q), panda.forward(q)[:, :3, 3], panda.forward(q)[:, :3, :3]


@pytest.mark.parametrize("name", ["myoarm", "rhuman"])
def test_the_hand_points_from_the_wrist_along_itself(name):
    """The z axis is the way from wrist to hand at any angles; hanging, y, out of the palm, is to the left."""
    person = load_arm(name)
    q = person.sample(5, 0)
    found, points = hand_rotations(person, q), person.point_positions(q, ("wrist", "hand"))
    along = points[:, 1] - points[:, 0]
    assert_allclose(found[:, :, 2], along / np.linalg.norm(along, axis=1, keepdims=True), atol=1e-9)
    assert_allclose(found @ np.swapaxes(found, 1, 2), np.broadcast_to(np.eye(3), found.shape), atol=1e-9)
    assert hand_rotations(person, np.zeros(7))[1, 1] > 0.95


@pytest.mark.parametrize("keep", [POINTING, WHOLE])
def test_nodes_are_turned_as_they_shall_be(planner, motion, keep):
    """Some nodes of each stage are within 0.1 rad, with the tip in place; the last joint serves where all counts."""
    objective = replace(Objective.of(planner.limits.arm), axis_weights=axis_weights(keep))
    targets = objective.targets(*motion[:2], rotations=motion[2])
    nodes = planner.arms[0].reachability_map.nodes(targets, 60, np.random.default_rng(0))
    owner = np.repeat(np.arange(len(TIME)), np.diff(nodes.first))
    angles = targets[owner].orientation_cost.angles(nodes.q)
    assert all(angles[owner == i].min() < 0.1 for i in range(len(TIME)))
    assert targets[owner].position_error(nodes.q).max() < 1e-3
    assert_allclose(nodes.cost, targets[owner].cost(nodes.q))
    middle = 0.5 * (planner.limits.lower + planner.limits.upper)[6]
    assert (np.ptp(nodes.q[:, 6]) > 1.0) == (keep == WHOLE)
    assert keep == WHOLE or np.abs(nodes.q[:, 6] - middle).max() < 1e-9


def test_a_plan_and_the_tracker_keep_the_orientation(panda, planner, motion):
    """Asked to point elsewhere than a free plan does, plan and tracker come near it, and the limits are kept."""
    profile, path, rotations = motion
    rotations = rotations @ Rotation.from_euler("x", 30.0, degrees=True).as_matrix()
    given = {"time": 2.0 * TIME, "path": path, "damping": 0.01}
    planned = {"time": 2.0 * TIME, "paths": path, "damping": 0.01, "planner": planner, "planning_effort": "quick"}
    free = plan_motion(panda, profile, **planned).arms[0]
    assert free.orientation_error is None
    kept = plan_motion(panda, profile, rotations=rotations, **planned).arms[0]
    tips = panda.forward(free.joint_positions)[:, :3, 2]
    beside = np.arccos(np.clip(np.sum(tips * rotations[:, :, 2], axis=1), -1.0, 1.0))
    assert np.median(kept.orientation_error) < 0.1 < np.median(beside)
    tracked = track(
        panda, profile, rotations=rotations, reference=kept.joint_positions, rate=50.0, **{**given, "time": kept.time}
    ).arms[0]
    assert np.median(tracked.orientation_error) < 0.1
    assert kept.limit_use.within


def test_wrong_orientations_are_told(panda, motion):
    """What is no rotation, no direction or not to be kept is named."""
    profile, path, rotations = motion
    given = {"time": TIME, "path": path}
    with pytest.raises(InvalidInputError, match=r"rotations\[0\] must be a rotation"):
        plan_motion(panda, profile, rotations=2.0 * rotations, time=TIME, paths=path)
    with pytest.raises(InvalidInputError, match=r"rotations must have shape \(12, 3, 3\)"):
        track(panda, profile, rotations=rotations[:5], **given)
    with pytest.raises(UnknownNameError, match="orientation_axes"):
        plan_motion(panda, profile, rotations=rotations, orientation_axes="all", time=TIME, paths=path)
    with pytest.raises(InvalidInputError, match="orientation"):
        MotionOptions(orientation=(0.0, 0.0, 0.0))
