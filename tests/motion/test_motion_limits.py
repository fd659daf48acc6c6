import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import Arm
from maniport.errors import FileFormatError, InvalidInputError
from maniport.motion.motion_limits import MotionLimits


@pytest.fixture(scope="module")
def crane():
    return Arm.from_dh(
        "crane", [[0, 0, 0.5, 0], [0, 0, 0, 0]], [-2, 0], [2, 1], kinds=["revolute", "prismatic"]
    )


def test_the_pandas_limits_are_those_of_its_maker(panda):
    limits = MotionLimits.of(panda)
    assert_array_equal(limits.acceleration, [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
    assert_array_equal(limits.jerk, [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0])
    assert_array_equal(limits.velocity, panda.velocity_limits)
    assert "Franka" in limits.sources["acceleration"]
    assert "Franka" in limits.sources["effort_rate"]
    assert limits.sources["effort"] == "the robot's description"
    assert not any(limits.assumed.values())
    assert_allclose(limits.arm.lower - panda.lower, 0.02 * (panda.upper - panda.lower))
    assert_allclose(panda.upper - limits.arm.upper, 0.02 * (panda.upper - panda.lower))
    some = MotionLimits.of(panda.restricted(joints=panda.joint_names[1:4]), joint_limit_margin=0.0)
    assert_array_equal(some.jerk, [3750.0, 5000.0, 6250.0])
    assert_array_equal(some.arm.lower, panda.lower[1:4])


def test_what_nobody_knows_is_assumed_and_said(crane):
    limits = MotionLimits.of(crane)
    assert_allclose(limits.velocity, [1.0, 0.25])
    assert_allclose(limits.acceleration, [4.0, 1.0])
    assert_allclose(limits.jerk, [100.0, 25.0])
    assert limits.sources["velocity"] == "assumed: 1 rad/s; assumed: 0.25 m/s"
    assert limits.sources["jerk"] == "assumed: acceleration limit reached in 0.04 s"
    assert np.all(np.isinf([limits.effort, limits.effort_rate]))
    assert "effort" not in limits.sources
    both = ("joint1", "joint2")
    assert limits.assumed == {"position": (), "velocity": both, "acceleration": both, "jerk": both}
    some = MotionLimits.of(crane, {"joints": {"joint2": {"velocity": 1.0, "acceleration": 2.0}}})
    assert some.assumed == {
        "position": (),
        "velocity": both[:1],
        "acceleration": both[:1],
        "jerk": both,
    }


def test_a_file_goes_before_everything_else(panda, tmp_path):
    file = tmp_path / "limits.yaml"
    file.write_text(
        "joints:\n  panda_joint1: {jerk: 1e3, effort: 40, lower: -1}\ndefault: {velocity: 0.5}\n"
    )
    limits = MotionLimits.of(panda, file)
    assert_array_equal(limits.velocity, np.full(7, 0.5))
    assert_array_equal(limits.jerk[:2], [1000.0, 3750.0])
    assert_array_equal(limits.effort[:2], [40.0, panda.effort_limits[1]])
    assert limits.arm.lower[0] == -1.0
    assert limits.arm.upper[0] < panda.upper[0]
    assert limits.sources["velocity"] == f"{file} (default)"
    assert limits.sources["jerk"].startswith(f"{file}; Franka")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"joints": {"panda_joint9": {}}},
            "joints of 'panda': unknown key 'panda_joint9'; allowed are, nearest first",
        ),
        ({"default": {"jerk": 0}}, "default: jerk must be a number above 0; found 0"),
        ({"joints": {"panda_joint1": {"lower": -3}}}, "panda_joint1: lower must be a number in"),
        ({"joints": {"panda_joint1": {"lower": 1, "upper": 0.5}}}, "lower"),
        ({"joints": {"panda_joint1": 3}}, "joints: panda_joint1 must be a mapping"),
        ([1, 2], "limits"),
    ],
)
def test_limits_that_cannot_be_are_refused(panda, tmp_path, given, message):
    with pytest.raises(InvalidInputError, match=message):
        MotionLimits.of(panda, given)
    file = tmp_path / "limits.json"
    file.write_text(str(given).replace("'", '"'))
    with pytest.raises(FileFormatError, match=message.replace("limits must", "must")):
        MotionLimits.of(panda, file)


def test_use_is_found_where_it_is(crane):
    limits = MotionLimits.of(
        crane,
        {"default": {"velocity": 2.0, "acceleration": 10.0, "jerk": 100.0}},
        joint_limit_margin=0.0,
    )
    time = np.arange(1201) / 1000.0
    q = np.column_stack([np.sin(2.0 * time + 1.0), np.full(len(time), 0.75)])
    use = limits.use(time, q)
    joints, shares, times = zip(*use.values(), strict=True)
    assert tuple(use) == ("position", "velocity", "acceleration", "jerk")
    assert joints[1:] == ("joint1",) * 3
    assert_allclose(shares, [0.5, 1.0, 0.4, 0.08], atol=1e-4)
    assert_allclose(times[1:], [np.pi / 2 - 0.5, np.pi / 4 - 0.5, np.pi / 2 - 0.5], atol=2e-2)
    assert max(share for _, share, _ in use.values()) <= 1.0 + 1e-9
    assert limits.use(time, 1.01 * q)["velocity"][1] > 1.0


def test_use_asks_for_a_constant_rate_and_fitting_shapes(crane):
    limits = MotionLimits.of(crane)
    with pytest.raises(InvalidInputError, match=r"^time.*rate.*0\.1"):
        limits.use([0.0, 0.1, 1.1], np.zeros((3, 2)))
    with pytest.raises(InvalidInputError, match=r"^q.*\(3, 2\)"):
        limits.use([0.0, 0.1, 0.2], np.zeros((3, 3)))
