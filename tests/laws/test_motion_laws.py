"""Laws of searches, motions and their limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pink.configuration import Configuration

from laws.strategies import FORMS, fewer
from maniport import spd
from maniport.bodies.collisions import Collisions
from maniport.tracking import (
    BrakingLimit,
    CollisionLimit,
    ManipulabilityEllipsoidTask,
    MotionLimits,
    Objective,
    OrientationTask,
    PositionTask,
    feasibility_gap,
    nearest_feasible,
    retime,
    robot_model,
    with_approach,
)

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
seeds = st.integers(0, 2**32 - 1)
few = {"n_starts": 4, "max_iter": 10}


@pytest.fixture(scope="module")
def apart(panda):
    """What the arm collides with by itself."""
    return Collisions.of(panda)


@fewer(0.3)
@given(seed=seeds)
def test_what_is_found_is_what_the_arm_makes(panda, bank, seed):
    """Ellipsoids found belong to their postures, within limits, and no search makes a start of its own worse."""
    q = panda.sample(4, seed)
    targets = panda.ellipsoids(q)
    found = nearest_feasible(panda, targets, bank=bank, **few)
    assert np.all(panda.within_limits(found.joint_positions))
    assert_array_equal(found.ellipsoids, panda.ellipsoids(found.joint_positions))
    objective = Objective.of(panda)
    apart = spd.distance(objective.damped(targets), objective.damped(found.ellipsoids))
    assert_allclose(found.distance, apart, atol=1e-7)
    assert_allclose(objective.undamped(objective.damped(targets)), targets, atol=1e-12)
    gap = feasibility_gap(panda, targets, bank=bank)
    assert np.all(gap <= found.distance + 1e-6)
    order = np.random.default_rng(seed).permutation(4)
    assert_allclose(
        nearest_feasible(panda, targets[order], bank=bank, **few).distance, found.distance[order], atol=1e-6
    )


@fewer(0.2)
@given(seed=seeds, slower=st.floats(1.0, 20.0), origin=st.sampled_from([0.0, -3.0, 1e6]))
def test_timed_motions_keep_their_limits(panda, seed, slower, origin):
    """Whatever the pace, postures are passed in order, from rest to rest, within every limit, from any time on."""
    limits = MotionLimits.of(panda)
    time = slower * np.linspace(0.0, 1.0, 6)
    ends = np.sort(panda.sample(2, seed), axis=0)
    q = np.clip(ends[0] + np.linspace(0.0, 1.0, 6)[:, None] * (ends[1] - ends[0]), limits.lower, limits.upper)
    timed = retime(limits, time, q, rate=20.0)
    assert_allclose(retime(limits, time + origin, q, rate=20.0).positions, timed.positions, atol=1e-6)
    assert np.all(np.diff(timed.at) > 0.0)
    assert timed.end - timed.begin >= slower * (1.0 - 1e-6) - 0.1
    assert limits.use(timed.time, timed.positions).within
    led = with_approach(timed, limits, q[-1])
    assert limits.use(led.time, led.positions).within
    assert_allclose(led.positions[[0, -1]], q[[-1, -1]], atol=1e-9)
    assert led.end - led.begin == pytest.approx(timed.end - timed.begin)


@fewer(0.3)
@given(seed=seeds)
def test_tasks_see_numbers_and_are_done_at_their_targets(panda, apart, seed):
    """Targets in any form are the same targets, the task's own; where the frame is there, nothing is left to do."""
    model, tip = robot_model(panda), panda.frame
    q = panda.sample(2, seed)
    there = Configuration(model, model.createData(), q[0])
    pose, ellipsoid = panda.forward(q[0]), panda.ellipsoids(q[0])
    for task, target in (
        (ManipulabilityEllipsoidTask(tip), ellipsoid),
        (PositionTask(tip), pose[:3, 3]),
        (OrientationTask(tip, cost=(1.0, 1.0, 1.0)), pose[:3, :3]),
    ):
        task.set_target(target)
        wanted = task.target.copy()
        assert_allclose(task.compute_error(there), 0.0, atol=1e-6)
        for form, disguise in FORMS.items():
            given_to = disguise(target.copy())
            task.set_target(given_to)
            assert_array_equal(task.target, wanted, err_msg=form)
            assert not (isinstance(given_to, np.ndarray) and np.may_share_memory(task.target, given_to)), form
    braking = BrakingLimit(model, np.ones(panda.dof), np.ones(panda.dof))
    for limit in (braking, CollisionLimit(apart)):
        found = limit.compute_qp_inequalities(there, 0.01)
        assert found is None or all(np.all(np.isfinite(one)) for one in found[:1])
