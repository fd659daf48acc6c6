"""Laws of searches, motions and their limits: numbers in any form, arguments left alone, results of their own."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pink.configuration import Configuration

from laws import covers
from laws.strategies import FORMS, fewer, require_same_for_every_form
from maniport import spd
from maniport.bodies import VELOCITY
from maniport.bodies.collisions import Collisions
from maniport.spd.regularization import Regularization
from maniport.tracking import (
    Atlas,
    BrakingLimit,
    CollisionLimit,
    FeasibleProjector,
    ManipulabilityEllipsoidTask,
    MotionLimits,
    Objective,
    OrientationTask,
    Planner,
    PositionTask,
    StartBank,
    feasibility_gap,
    nearest_feasible,
    place_path,
    plan_motion,
    retime,
    robot_model,
    track,
    with_approach,
)
from maniport.transfer.rotation_group import rotation_from_vector
from sizes import few_places

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
seeds = st.integers(0, 2**32 - 1)
form_names = st.sampled_from(sorted(FORMS))
few = {"n_starts": 4, "max_iter": 10}


def arrays_of(result):
    """All arrays of a result, and of what it holds."""
    for field in fields(result):
        value = getattr(result, field.name)
        if isinstance(value, np.ndarray):
            yield f"{type(result).__name__}.{field.name}", value
        elif is_dataclass(value) and not isinstance(value, type):
            yield from arrays_of(value)


def require_same(call, arrays, form):
    """Require of a call with results of arrays the bits that it gives for plain arrays, none of them the caller's."""
    given_to = {name: FORMS[form](array.copy()) for name, array in arrays.items()}
    found, wanted = dict(arrays_of(call(**given_to))), dict(arrays_of(call(**arrays)))
    assert set(found) == set(wanted)
    for name, array in found.items():
        assert_array_equal(array, wanted[name], err_msg=f"{form}: {name}")
        for argument, one in given_to.items():
            assert not (isinstance(one, np.ndarray) and np.may_share_memory(array, one)), (
                f"{form}: {name} is {argument}"
            )
    for name, one in given_to.items():
        assert_array_equal(np.array(one, dtype=np.float64), arrays[name], err_msg=f"{form}: {name} written to")


@pytest.fixture(scope="module")
def apart(panda):
    """What the arm collides with by itself."""
    return Collisions.of(panda)


@pytest.fixture(scope="module")
def motion(panda):
    """A short motion (time, joint positions) of the arm well within its limits."""
    time = np.linspace(0.0, 2.0, 25)
    middle, swing = 0.5 * (panda.lower + panda.upper), 0.15 * (panda.upper - panda.lower)
    return time, middle + swing * np.sin(time[:, None] + np.arange(panda.dof))


@pytest.fixture(scope="module")
def task(panda, motion):
    """What the motion does: profile, time and path."""
    time, q = motion
    return {"profile": panda.ellipsoids(q), "time": time, "path": panda.forward(q)[:, :3, 3].copy()}


# ---- searches ----------------------------------------------------------------------------------------------------


@covers(
    "tracking: StartBank nearest_feasible FeasibleEllipsoids feasibility_gap FeasibleProjector FeasibleSearch",
    "tracking.StartBank: query build save load",
)
@fewer(0.3)
@given(seed=seeds)
def test_searches_see_numbers(panda, bank, seed, tmp_path_factory):
    """The same targets are found alike, bit by bit, in whatever form; a bank's file serves as the bank."""
    q = panda.sample(3, seed)
    targets, tips = panda.ellipsoids(q), panda.forward(q)[:, :3, 3]
    require_same_for_every_form(bank.query, [targets, tips])
    path = tmp_path_factory.mktemp("bank") / "bank.npz"
    bank.save(path)
    assert_array_equal(StartBank.load(path, panda).query(targets, tips), bank.query(targets, tips))
    projector = FeasibleProjector(panda, damping=Regularization.absolute(0.01), bank=bank)
    form = sorted(FORMS)[seed % len(FORMS)]
    require_same_for_every_form(projector, [targets + 0.01 * np.eye(3)], {form: FORMS[form]})
    require_same_for_every_form(
        lambda x: feasibility_gap(panda, x, bank=bank, n_points=2), [targets], {form: FORMS[form]}
    )
    require_same(
        lambda ellipsoids, positions: nearest_feasible(panda, ellipsoids, positions=positions, bank=bank, **few),
        {"ellipsoids": targets, "positions": tips},
        form,
    )


@covers("tracking: nearest_feasible FeasibleProjector Objective feasibility_gap")
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


# ---- limits and times --------------------------------------------------------------------------------------------


@covers("tracking: MotionLimits LimitUse retime Timed with_approach")
@pytest.mark.parametrize("form", ["reversed", "read-only", "nested lists"])
def test_timing_sees_numbers(panda, motion, form):
    """The same motion is timed, judged and led to alike, bit by bit, in whatever form."""
    time, q = motion
    limits = MotionLimits.of(panda)
    timed = retime(limits, time, q, rate=20.0)
    home = q[3] + 0.1
    require_same(lambda time, q: retime(limits, time, q, rate=20.0), {"time": time, "q": q}, form)
    require_same(lambda home: with_approach(timed, limits, home), {"home": home}, form)
    require_same(limits.use, {"time": timed.time, "q": timed.positions}, form)


@covers("tracking: MotionLimits LimitUse retime Timed with_approach")
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


# ---- motions -----------------------------------------------------------------------------------------------------


@covers("tracking: track TrackResult Control")
@pytest.mark.parametrize("form", ["reversed"])
def test_tracking_sees_numbers(panda, motion, task, form):
    """The same task is followed alike, bit by bit, in whatever form."""
    require_same(
        lambda profile, **given_to: track(panda, profile, lm_damping=10.0, **given_to),
        {**{name: array[:4] for name, array in task.items()}, "start": motion[1][0], "reference": motion[1][:4]},
        form,
    )


@covers("tracking: plan_motion PlannedMotion PlanControl Planner Atlas")
@pytest.mark.parametrize("form", ["strided"])
def test_planning_sees_numbers(panda, task, planner, form):
    """The same task is planned alike, bit by bit, in whatever form."""
    rotations = np.broadcast_to(np.diag([1.0, -1.0, -1.0]), (len(task["time"]), 3, 3))
    require_same(
        lambda **given_to: plan_motion(panda, planner=planner, **given_to),
        {**task, "rotations": rotations.copy(), "node_floor": np.zeros(len(task["time"]))},
        form,
    )


@pytest.fixture(scope="module")
def planner(panda):
    """What is known of the arm."""
    return Planner.of(MotionLimits.of(panda), VELOCITY, False, 0)


@covers("tracking: place_path place_paths PlacedPath Place")
@pytest.mark.parametrize("form", ["unaligned"])
def test_placing_sees_numbers(panda, bank, task, form):
    """The same path is placed alike, bit by bit, in whatever form; other points and ellipsoids go along with it."""
    atlas = Atlas(panda, VELOCITY, random_state=0)
    turn = rotation_from_vector(np.array([0.0, 0.0, 0.3]))

    def placed(path, profile, time, turn):
        return place_path(path, profile, panda, time=time, turn=turn, scale=1.0, atlas=atlas, bank=bank)

    with few_places():
        require_same(placed, {**task, "turn": turn}, form)
        place = placed(**task, turn=turn)
    for disguise in FORMS.values():
        assert_array_equal(place.apply(disguise(task["path"])), place.apply(task["path"]))
        assert_array_equal(place.turned(disguise(task["profile"])), place.turned(task["profile"]))
    assert_allclose(place.apply(task["path"]), place.path, atol=1e-9)
    assert_allclose(place.turned(task["profile"]), place.profile, atol=1e-9)


# ---- tasks and limits --------------------------------------------------------------------------------------------


@covers("tracking: ManipulabilityEllipsoidTask PositionTask OrientationTask robot_model BrakingLimit CollisionLimit")
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


@covers("bodies.collisions.Collisions", "bodies.collisions.Collisions: collides clearance")
@fewer(0.3)
@given(seed=seeds)
def test_collisions_see_numbers(panda, apart, seed):
    """What is near or in collision is so in any form, alone and in any batch: less than nothing apart, or free."""
    q = panda.sample(4, seed).reshape(2, 2, panda.dof)
    require_same_for_every_form(apart.clearance, [q])
    collides, clearance = apart.collides(q), apart.clearance(q)
    assert_array_equal(collides, clearance <= 0.0)
    for index in np.ndindex(2, 2):
        assert apart.collides(q[index]) == collides[index]
        assert_allclose(apart.clearance(q[index]), clearance[index], atol=1e-9)
    for disguise in FORMS.values():
        assert_array_equal(apart.collides(disguise(q)), collides)
