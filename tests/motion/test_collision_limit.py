"""A limit for Pink that keeps an arm away from itself and from what stands around it."""

import numpy as np
import pink
import pytest

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion import BrakingLimit, CollisionLimit, robot_model, track


@pytest.fixture(scope="module")
def arm():
    """The Panda with its hand."""
    return load_arm("panda", frame="panda_hand_tcp")


@pytest.fixture(scope="module")
def collisions(arm):
    """On a table."""
    return Collisions.of(arm, table=0.0)


def _clearance(collisions, q):
    """Smallest distances at configurations (n, dof), of links with at most two coordinates between four times that."""
    rows, distance, _ = collisions.watch(1.0).gradient(q)
    clearance = np.full(len(q), np.inf)
    np.minimum.at(clearance, rows, distance)
    return clearance


def _reach(arm, collisions, limits, start, goal):
    """Clearances on the way from one posture towards another."""
    model = robot_model(arm)
    configuration = pink.Configuration(model, model.createData(), start)
    task = pink.tasks.PostureTask(cost=1.0, gain=0.1)
    task.set_target(goal)
    bounds = pink.limits.VelocityLimit(model)
    path = []
    for _ in range(150):
        velocity = pink.solve_ik(configuration, [task], 0.02, solver="daqp", limits=[bounds, *limits], damping=1e-6)
        configuration.integrate_inplace(velocity, 0.02)
        path.append(configuration.q)
    return _clearance(collisions, np.array(path))


def test_postures_that_collide_are_not_reached(arm, collisions):
    """Drawn towards postures that collide, the arm stops at the margin; without the limit it goes there."""
    q = arm.sample(256, 0)
    clearance = _clearance(collisions, q)
    starts, goals = q[clearance > 0.03][:2], q[clearance < -0.02][:2]
    limit = CollisionLimit(collisions)
    for start, goal in zip(starts, goals, strict=True):
        path = _reach(arm, collisions, [limit], start, goal)
        assert path.min() > 0.015  # steps of 20 ms at full speed are not straight
        assert _reach(arm, collisions, [], start, goal).min() < 0.0


def test_what_is_too_near_gets_away(arm, collisions):
    """From within the margin the clearance grows up to it, though the task is content."""
    q = arm.sample(512, 1)
    clearance = _clearance(collisions, q)
    for start in q[(clearance > 0.002) & (clearance < 0.015)][:2]:
        path = _reach(arm, collisions, [CollisionLimit(collisions)], start, start)
        assert path[-1] > 0.019
        assert np.all(np.diff(path) > -1e-4)


def test_tracking_takes_the_limit(arm, collisions):
    """Given to track as any other limit it keeps the whole motion out of collision, where without it there is one."""
    q = arm.sample(256, 0)
    clearance = _clearance(collisions, q)
    start, goal = q[clearance > 0.03][0], q[clearance < -0.02][0]
    way = np.linspace(start, goal, 12)
    asked = {"time": np.linspace(0, 4, 12), "path": arm.forward(way)[:, :3, 3], "start": start, "rate": 50.0}
    motions = [track(arm, arm.ellipsoids(way), limits=limits, **asked) for limits in ((), [CollisionLimit(collisions)])]
    clearances = [_clearance(collisions, motion.joint_positions) for motion in motions]
    assert clearances[0].min() < 0.0
    assert clearances[1].min() > 0.015


def test_wrong_arguments(arm, collisions):
    """Ranges are checked, and an arm of which no surface is known has no such limit."""
    assert "joint_limit_margin=0.02" in repr(CollisionLimit(collisions))
    assert BrakingLimit.__module__ == "maniport.motion.limits"
    with pytest.raises(InvalidInputError, match="nothing is known that could collide: 'myoarm'"):
        CollisionLimit(Collisions.of(load_arm("myoarm")))
    with pytest.raises(InvalidInputError, match="must be a Collisions object; found Arm"):
        CollisionLimit(arm)
    with pytest.raises(InvalidInputError, match=r"reach must be a number above 0\.1; found 0\.1"):
        CollisionLimit(collisions, margin=0.1)
    with pytest.raises(InvalidInputError, match=r"gain must be a number in \(0, 1\]; found 2"):
        CollisionLimit(collisions, gain=2)
