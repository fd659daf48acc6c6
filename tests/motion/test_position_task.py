"""The position task in Pink, and the models that arms become for it."""

import numpy as np
import pytest
from configurations import at
from numpy.testing import assert_allclose
from pink.exceptions import TargetNotSet

from maniport.errors import InvalidInputError, UnknownNameError
from maniport.motion import BrakingLimit, PositionTask, robot_model


def test_jacobian_is_the_derivative_of_the_error(panda, model):
    """Three rows, which agree with finite differences of the error."""
    task = PositionTask(panda.frame)
    task.set_target([0.3, 0.2, 0.5])
    q, h = panda.sample(1, 0)[0], 1e-6
    moved = [task.compute_error(at(model, q + h * e)) - task.compute_error(at(model, q - h * e)) for e in np.eye(7)]
    assert_allclose(task.compute_jacobian(at(model, q)), np.array(moved).T / (2 * h), atol=1e-8)
    assert_allclose(task.compute_error(at(model, q)), panda.forward(q)[:3, 3] - [0.3, 0.2, 0.5], atol=1e-12)


def test_bad_input_is_told(panda, model):
    """Missing targets, wrong shapes and unknown frames raise errors that say what is wrong."""
    here = at(model, panda.sample(1, 0)[0])
    with pytest.raises(TargetNotSet):
        PositionTask(panda.frame).compute_error(here)
    for position in ([1.0, 2.0], [np.nan, 0, 0], "here"):
        with pytest.raises(InvalidInputError, match="position"):
            PositionTask(panda.frame).set_target(position)
    for options, message in [
        ({"cost": -1.0}, "cost must be one number or 3 numbers of at least 0; found -1"),
        ({"cost": [1.0, 2.0]}, r"cost must be one number or 3 numbers of at least 0; found shape \(2,\)"),
        ({"gain": 3}, r"gain must be a number in \(0, 1\]; found 3"),
        ({"lm_damping": -1e-9}, "lm_damping must be a number of at least 0; found -1e-09"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            PositionTask(panda.frame, **options)
    with pytest.raises(UnknownNameError, match="panda_link8"):
        PositionTask("panda_link9").set_target_from_configuration(here)


def test_model_has_the_kinematics_and_limits_of_its_arm(panda, model):
    """Every frame of the model lies where the arm has it; limits of position and velocity are the arm's."""
    q = panda.sample(3, 2)
    for one in q:
        for frame in panda.frames:
            found = at(model, one).get_transform_frame_to_world(frame).translation
            assert_allclose(found, panda.point_positions(one, [frame])[0], atol=1e-14)
    assert_allclose(model.lowerPositionLimit, panda.lower)
    assert_allclose(model.upperPositionLimit, panda.upper)
    assert_allclose(model.velocityLimit, panda.velocity_limits)


def test_locked_joints_are_fixed_in_the_model(panda):
    """An arm with some joints locked becomes a model with the others only, and the same kinematics."""
    few = panda.restricted(joints=["panda_joint1", "panda_joint2", "panda_joint4", "panda_joint6"])
    model = robot_model(few)
    assert model.nq == 4
    for q in few.sample(3, 3):
        assert_allclose(at(model, q).get_transform_frame_to_world(few.frame).homogeneous, few.forward(q), atol=1e-14)


@pytest.mark.parametrize("seed", range(2))
def test_braking_limit_never_contradicts_itself(panda, model, seed):
    """Driven by any wish, joints keep limits of position, velocity and acceleration, and some step is always left."""
    rng, dt = np.random.default_rng(seed), 0.01
    accelerations = rng.uniform(1, 20, 7)
    limit = BrakingLimit(model, panda.velocity_limits, accelerations)
    q = panda.sample(1, seed)[0]
    wish = np.zeros(7)
    for i in range(1500):
        if i % 200 == 0:
            wish = rng.choice([-1.0, 1.0], 7)
        least, most = limit.bounds(q, dt)
        assert np.all(least <= most + 1e-15)
        step = np.clip(wish, least, most)
        assert np.all(np.abs(step - limit.last_step) <= accelerations * dt**2 * (1 + 1e-9) + 1e-15)
        assert np.all(np.abs(step) <= panda.velocity_limits * dt * (1 + 1e-12))
        q, limit.last_step = q + step, step
        assert np.all((q >= panda.lower - 1e-12) & (q <= panda.upper + 1e-12))
