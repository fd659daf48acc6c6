"""Two arms follow step by step: one model, one programme, each arm as by itself where they do not meet."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from maniport.motion import robot_model, track, track_arms
from maniport.motion.arm_model import tip_frames
from real_robots import NEEDS_ROBOTS

TIME = np.linspace(0.0, 2.0, 9)
MIDDLE = np.array([0.2, -0.4, 0.3, -1.9, 0.4, 1.8, 0.5])
SWING = MIDDLE + 0.3 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))


@pytest.fixture(scope="module")
def pandas():
    """Two Pandas side by side."""
    return mp.load_arms("panda", bases=[(0.0, 0.3, 0.0), (0.1, -0.3, 0.0, 0.2)])


def task(arms, *joints, smaller=1.0):
    """What the arms make in these postures, or smaller ellipsoids, and where their tips are then."""
    each = list(zip(arms.arms, joints, strict=True))
    return {
        "profiles": [smaller * arm.manipulability(q) for arm, q in each],
        "paths": [arm.forward(q)[:, :3, 3] for arm, q in each],
        "time": TIME,
        "reference": arms.joined(*joints),
    }


@pytest.mark.parametrize("robot", ["pandas", pytest.param("talos", marks=NEEDS_ROBOTS)])
def test_one_model_has_both_arms(robot, pandas):
    """Poses and Jacobians of both tips are the pair's, column by column; shared joints are there once."""
    arms = pandas if robot == "pandas" else mp.load_arms("talos")
    model = robot_model(arms)
    assert tuple(model.names)[1:] == arms.joint_names
    assert_array_equal(model.lowerPositionLimit, arms.lower)
    data = model.createData()
    for q in arms.sample(4, 0):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for name, pose, jacobian in zip(tip_frames(arms), arms.forward(q), arms.jacobian(q), strict=True):
            index = model.getFrameId(name)
            assert_allclose(data.oMf[index].homogeneous, pose, atol=1e-12)
            found = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)
            assert_allclose(found, jacobian, atol=1e-12)


def test_arms_that_do_not_meet_follow_as_each_alone(pandas):
    """One programme for both has the same answer as one for each, to what the solver's tolerance makes of it."""
    asked = task(pandas, SWING, SWING[::-1], smaller=0.9)
    both = track_arms(pandas, **asked, rate=50.0, lm_damping=10.0, acceleration_limits=10.0)
    for i, motion in enumerate(both.arms):
        alone = track(
            pandas.arms[i], asked["profiles"][i], time=TIME, path=asked["paths"][i], rate=50.0, lm_damping=10.0,
            reference=asked["reference"][:, pandas.columns[i]], acceleration_limits=10.0,
        )  # fmt: skip
        assert_allclose(motion.control_positions, alone.control_positions, atol=1e-4)
    assert_array_equal(both.arms[0].control_positions, both.trajectory.control_positions[:, :7])
    assert not both.arms[0].held.any()


def test_arms_keep_away_from_one_another(pandas):
    """With a collision limit hands that are sent into one another stop before they touch; without it they meet."""
    apart = mp.Collisions.of(pandas)
    end = np.array([0.9, 0.2, 0.3, -1.9, 0.4, 1.8, 0.5])
    share = np.linspace(0.0, 1.0, len(TIME))[:, None]
    left, right = MIDDLE + share * (end * [-1, 1, 1, 1, 1, 1, 1] - MIDDLE), MIDDLE + share * (end - MIDDLE)
    asked = task(pandas, left, right)
    through = track_arms(pandas, **asked, rate=25.0, lm_damping=10.0)
    assert apart.collides(through.trajectory.control_positions).any()
    kept = track_arms(pandas, **asked, rate=25.0, lm_damping=10.0, collisions=apart)
    assert not apart.collides(kept.trajectory.control_positions).any()
