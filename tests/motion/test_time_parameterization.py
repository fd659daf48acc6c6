"""A path is passed as soon as the person did or the limits allow, from rest to rest, and from a home posture."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import Arm, load_arm
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import robot_model
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.plan.time_parameterization import retime, with_approach

PLANAR = Arm.from_dh("planar", [[0, 0, 0.5, 0]] * 3)
CRANE = Arm.from_dh(
    "crane", [[0, 0, 0, 0], [0, 0, 0.5, 0]], [0, -2], [1, 2], kinds=["prismatic", "revolute"]
)
SIX = Arm.from_dh("six", [[0, 0.1, 0.3, 1.5]] * 6, -6, 6).with_limits(velocity=3.0)
HARD = {"default": {"velocity": 2.0, "acceleration": 10.0, "jerk": 5000.0}}


def waves(limits, time, share=0.5, pace=0.7):
    middle = 0.5 * (limits.arm.lower + limits.arm.upper)
    half = 0.5 * (limits.arm.upper - limits.arm.lower)
    return middle + share * half * np.sin(pace * np.outer(time, np.arange(1, limits.arm.dof + 1)))


def require_laws(limits, time, q, timed, rate=1000.0):
    positions = timed.control_positions
    assert (
        max(share for _, share, _ in limits.use(timed.control_time, positions).values())
        <= 1.0 + 1e-9
    )
    assert_allclose(np.diff(timed.control_time), 1.0 / rate)
    assert timed.control_time[0] == 0.0
    assert_allclose(positions[[0, -1]], q[[0, -1]], atol=1e-9)
    for values in (positions, timed.control_velocities, timed.control_accelerations):
        assert values.shape == (len(timed.control_time), limits.arm.dof)
    assert_array_equal(np.diff(positions[:4], axis=0), 0.0)  # at rest
    assert_array_equal(np.diff(positions[-4:], axis=0), 0.0)
    assert np.all(
        np.diff(timed.time) >= np.diff(time) * (1.0 - 1e-9)
    )  # never faster than the person
    assert 0.0 <= timed.time[0] < timed.time[-1] <= timed.control_time[-1]


@pytest.mark.parametrize(("payload", "share"), [(0.0, 1.0), (3.0, 1.0), (0.0, 0.45)])
def test_torques_of_samples_keep_their_limits(payload, share):
    arm = load_arm("panda").with_payload(payload)
    entries = {
        name: {"effort": share * own}
        for name, own in zip(arm.joint_names, arm.effort_limits, strict=True)
    }
    limits = MotionLimits.of(arm, {"joints": entries})
    q = np.array([[0, -0.6, 0, -2.2, 0, 1.6, 0.5]] * 9)
    q[:, :6] += 0.4 * np.sin(np.outer(np.linspace(0.0, 3.0, 9), np.arange(1, 7)))
    timed = retime(limits, np.linspace(0.0, 1.0, 9), q)
    require_laws(limits, timed.time, q, timed)
    model = robot_model(arm)
    states = zip(
        timed.control_positions, timed.control_velocities, timed.control_accelerations, strict=True
    )
    torques = np.array([pin.rnea(model, model.createData(), *state) for state in states])
    assert_allclose(timed.control_torques, torques, atol=1e-9)
    assert np.all(np.abs(torques) <= limits.effort)
    assert timed.limit_use["torque"][1] == pytest.approx(np.max(np.abs(torques) / limits.effort))


def test_a_joint_that_gravity_overloads_is_reported():
    arm = load_arm("panda")
    q = [[0.0, 0.5, 0.0, -1.5, 0.0, 1.5, 0.0], [0.2, 0.6, 0.0, -1.3, 0.0, 1.5, 0.0]]
    weak = {"joints": {"panda_joint2": {"effort": 20.0}}}
    limits = MotionLimits.of(arm, weak)
    timed = retime(limits, [0.0, 1.0], q)
    joint, share, at = timed.limit_use["torque"]
    gravity = np.abs(arm.gravity_torques(timed.control_positions)[:, 1]).max() / 20.0
    assert joint == "panda_joint2"
    assert 1.2 < gravity <= share < 1.06 * gravity
    assert 0.0 <= at <= timed.control_time[-1]
    assert max(share for name, (_, share, _) in timed.limit_use.items() if name != "torque") <= 1.0
    loaded = retime(MotionLimits.of(arm.with_payload(1.0), weak), [0.0, 1.0], q)
    assert loaded.limit_use["torque"][1] > share


@pytest.mark.parametrize("arm", [CRANE, SIX, PLANAR], ids=lambda arm: arm.name)
@pytest.mark.parametrize(
    "name",
    [
        "assumed",
        "slow",
        "fast",
        "still",
        "pause",
        "tiny",
        "one step",
        "hurried",
        "along the limits",
    ],
)
def test_samples_keep_all_limits(arm, name):
    """Slow or fast, at rest, with equal postures, rounding, or a person ten thousand times faster."""
    limits = MotionLimits.of(arm, None if name == "assumed" else HARD)
    time = np.linspace(3.0, 9.0, 61)
    q = waves(
        limits,
        time,
        1.3 if name == "along the limits" else 0.5,
        {"slow": 0.05, "fast": 5.0}.get(name, 0.7),
    )
    q = np.clip(q, limits.arm.lower, limits.arm.upper)
    if name == "still":
        q[:] = q[0]
    if name == "pause":
        q[20:40] = q[20]
    if name == "tiny":
        q = q[0] + 1e-7 * np.random.default_rng(0).normal(size=q.shape)
    if name == "one step":
        time = time[:2]
        q = q[[0, 30]]
    if name == "hurried":
        time = 1e-4 * time
    timed = retime(limits, time, q)
    require_laws(limits, time, q, timed)
    if name == "along the limits":
        assert np.abs(timed.joint_positions - q).max() < 2e-3


@settings(max_examples=5)
@given(
    seed=st.integers(0, 1000), n=st.integers(2, 30), step=st.sampled_from([1 / 120, 1 / 30, 1.0])
)
def test_jerky_noise_is_passed_slowly(seed, n, step):
    generator = np.random.default_rng(seed)
    limits = MotionLimits.of(CRANE, HARD)
    time = step * np.cumsum(generator.uniform(0.5, 1.5, n))
    q = generator.uniform(limits.arm.lower, limits.arm.upper, (n, 2))
    require_laws(limits, time, q, retime(limits, time, q))


def test_a_straight_line_takes_as_long_as_it_must():
    """One joint over 1 rad at 2 rad/s and 10 rad/s²: 0.2 s up to speed, 0.3 s at speed, 0.2 s to rest."""
    limits = MotionLimits.of(PLANAR, HARD)
    timed = retime(limits, [0.0, 1e-3], [[0, 0, 0], [1.0, 0, 0]])
    assert timed.control_time[-1] == pytest.approx(0.7, abs=0.02)
    use = limits.use(timed.control_time, timed.control_positions)
    assert min(use["velocity"][1], use["acceleration"][1]) > 0.99


def test_little_jerk_takes_long_and_stays_on_the_path():
    limits = MotionLimits.of(PLANAR, {"default": {"jerk": 0.1}})
    time = np.linspace(0.0, 2.0, 41)
    q = waves(limits, time)
    timed = retime(limits, time, q, rate=200.0)
    require_laws(limits, time, q, timed, 200.0)
    assert np.abs(timed.joint_positions - q).max() <= 0.01 * 0.3**2 / 24
    assert timed.control_time[-1] > 10.0


@pytest.mark.parametrize(("duration", "jerk"), [(1e6, 1.0), (1.0, 1e-9)])
def test_too_long_motions_are_refused(duration, jerk):
    limits = MotionLimits.of(PLANAR, {"default": {"jerk": jerk}})
    with pytest.raises(InvalidInputError, match=r"samples.*3000000"):
        retime(limits, [0.0, duration], [[0, 0, 0], [0, 1, 0]])


def test_home_and_back():
    """Approach and return are calm straight lines from rest to rest, and shift what is between them unchanged."""
    limits = MotionLimits.of(PLANAR, HARD)
    time = np.linspace(0.0, 2.0, 41)
    timed = retime(limits, time, waves(limits, time))
    home = np.array([0.5, -1.0, 1.5])
    longer = with_approach(timed, limits, home)
    positions = longer.control_positions
    assert (
        max(share for _, share, _ in limits.use(longer.control_time, positions).values())
        <= 1.0 + 1e-9
    )
    assert_allclose(np.diff(longer.control_time), 1e-3)
    assert_allclose(positions[[0, -1]], [home, home], atol=1e-9)
    shift = longer.time - timed.time
    assert_allclose(shift, shift[0])
    first = round(1e3 * shift[0])
    own = timed.control_positions
    assert_array_equal(positions[first : first + len(own)], own)
    assert_allclose(longer.joint_positions, timed.joint_positions, atol=1e-9)
    ahead = positions[:first] - home
    line = own[0] - home
    assert_allclose(ahead, np.outer(ahead @ line / (line @ line), line), atol=1e-9)
    use = limits.use(longer.control_time[:first], positions[:first])
    assert (
        0.25 < max(share for name, (_, share, _) in use.items() if name != "position") <= 0.3 + 1e-6
    )
