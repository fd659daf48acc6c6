"""A whole motion at once: what is reproduced, what is kept, and what is said where it cannot be."""

import sys

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.bodies import Arm, EllipsoidSpec, load_arm
from maniport.errors import InvalidInputError, ManiportError, MissingPackageError, NotSPDError
from maniport.spd import to_vector
from maniport.spd.regularization import Regularization
from maniport.telling import as_numbers, facts_of
from maniport.tracking import track
from maniport.tracking.offline.offline import optimize_trajectory
from maniport.tracking.offline.symbolic import log_vector, symbolic_kinematics

TIME = np.linspace(0.0, 2.0, 25)
DAMPING = Regularization.absolute(0.003)


@pytest.fixture(scope="module")
def motion(panda):
    """A smooth motion of the Panda, its own ellipsoids, its hand path, and a rough motion near it."""
    start = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.7])
    joints = start + 0.3 * np.sin(np.outer(TIME, [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.5]))
    rough = joints + 0.05 * np.random.default_rng(0).normal(size=joints.shape)
    return joints, panda.manipulability(joints), panda.forward(joints)[:, :3, 3], rough


def sliding_arm():
    """An arm of three hinges and a slide."""
    rows = [[0.1, 0.2, 0.3, 0.5], [0.0, 0.1, 0.4, -1.0], [0.3, 0.0, 0.1, 1.2], [0.0, 0.2, 0.3, 0.0]]
    return Arm.from_dh("sliding", rows, kinds=["revolute", "revolute", "prismatic", "revolute"])


@pytest.mark.parametrize("name", ["panda", "myoarm", "rhuman", "sliding"])
def test_symbolic_chain_is_the_arm(name):
    """Symbolic pose and Jacobian equal the arm's to 1e-10, for coupled joints and slides too."""
    arm = sliding_arm() if name == "sliding" else load_arm(name)
    q = casadi.SX.sym("q", arm.dof)
    evaluate = casadi.Function("kinematics", [q], symbolic_kinematics(arm, q))
    for joints in arm.sample(8, 0):
        pose, jacobian = evaluate(joints)
        assert_allclose(np.array(pose), arm.forward(joints), atol=1e-10)
        assert_allclose(np.array(jacobian), arm.jacobian(joints), atol=1e-10)


@pytest.mark.parametrize("d", [3, 6])
def test_symbolic_logarithm_is_the_matrix_logarithm(d):
    """The rational function equals log X to 1e-6 for eigenvalues from 0.1 to 10, equal ones included."""
    x = casadi.SX.sym("x", d, d)
    evaluate = casadi.Function("log", [x], [log_vector(x)])
    generator = np.random.default_rng(0)
    for spread in np.linspace(0.0, np.log(10.0), 12):
        turn = np.linalg.qr(generator.normal(size=(d, d)))[0]
        logs = generator.uniform(-spread, spread, d)
        logs[:2] = logs[0]
        expected = (turn * logs) @ turn.T
        found = np.array(evaluate((turn * np.exp(logs)) @ turn.T)).ravel()
        assert_allclose(found, to_vector(0.5 * (expected + expected.T)), atol=1e-6)


def test_distance_has_derivatives_where_eigenvalues_meet():
    """At X = 2 I, where eigenvalues have none, the gradient of |log X|² is (log 2) I and the Hessian is finite."""
    x = casadi.SX.sym("x", 3, 3)
    hessian, gradient = casadi.hessian(casadi.sumsqr(log_vector(x)), casadi.vec(x))
    evaluate = casadi.Function("derivatives", [x], [gradient, hessian])
    slope, curvature = (np.array(part) for part in evaluate(2.0 * np.eye(3)))
    assert_allclose(slope.reshape(3, 3)[np.diag_indices(3)], np.log(2.0), atol=1e-6)
    assert np.all(np.isfinite(curvature))


@pytest.mark.parametrize("part", ["translation", "rotation", "full"])
def test_own_motion_is_reproduced(panda, motion, part):
    """From a rough start, the arm's own ellipsoids are made to 0.01 and its own path is kept to 0.01 mm."""
    joints, _, path, rough = motion
    rows = slice(0, 12) if part == "full" else slice(None)
    profile = panda.manipulability(joints[rows], part=part)
    result = optimize_trajectory(
        panda,
        profile,
        TIME[rows],
        path=path[rows],
        damping=DAMPING,
        spec=EllipsoidSpec(part=part),
        start=rough[rows],
        smoothness=1e-6,
    )
    assert result.converged
    assert result.solver_status == "converged"
    assert result.violations == {}
    assert result.distance.max() < 0.01
    assert result.position_error.max() < 1e-5
    assert set(result.status) == {"followed"}


def test_without_start_one_is_found(panda, bank, motion):
    """Without a start the arm finds into its own motion."""
    _, profile, path, _ = motion
    result = optimize_trajectory(panda, profile, TIME, path=path, damping=DAMPING, bank=bank, smoothness=1e-6)
    assert result.distance.max() < 0.01
    assert result.position_error.max() < 1e-5


def test_result_is_smoother_than_the_tracker_and_no_worse(panda, bank, motion):
    """On ellipsoids out of reach, d is at most 5 % worse than the tracker's, and jerk at most a fifth."""
    _, profile, path, _ = motion
    wanted = 0.5 * profile[::-1] + 0.1 * np.diag([1.0, 0.3, 0.1])
    tracked = track(panda, wanted, time=TIME, path=path, damping=DAMPING, bank=bank)
    result = optimize_trajectory(panda, wanted, TIME, path=path, damping=DAMPING, start=tracked.joint_positions)
    assert np.median(result.distance) > 0.1
    assert np.sqrt(np.mean(result.distance**2)) <= 1.05 * np.sqrt(np.mean(tracked.distance**2))
    assert result.rms_jerk <= 0.2 * tracked.rms_jerk


def test_limits_hold_between_the_times(panda, motion):
    """Position, velocity and acceleration stay within their limits to 1e-6 at every control step."""
    joints, profile, _, _ = motion
    narrow = Arm(panda.chain)
    narrow.lower, narrow.upper = joints.min(axis=0) + 0.05, joints.max(axis=0) - 0.05
    result = optimize_trajectory(
        narrow, profile, TIME, damping=DAMPING, start=np.clip(joints, narrow.lower, narrow.upper),
        velocity_limits=0.2, acceleration_limits=0.3, rate=1000.0,
    )  # fmt: skip
    q, step = result.control_positions, np.diff(result.control_time)[:, None]
    velocity = np.diff(q, axis=0) / step
    assert np.all((q >= narrow.lower - 1e-6) & (q <= narrow.upper + 1e-6))
    assert np.abs(velocity).max() <= 0.2 + 1e-6
    assert np.abs(np.diff(velocity, axis=0) / step[1:]).max() <= 0.3 + 1e-6
    assert result.violations == {}
    assert_array_equal(np.isin(TIME, result.control_time), True)


def test_a_larger_smoothness_gives_less_jerk(panda, motion):
    """More smoothness gives less jerk and more distance."""
    joints, profile, _, _ = motion
    rough, smooth = (
        optimize_trajectory(panda, profile, TIME, damping=DAMPING, start=joints, smoothness=weight)
        for weight in (1e-5, 1e-1)
    )
    assert smooth.rms_jerk < rough.rms_jerk
    assert np.mean(smooth.distance**2) > np.mean(rough.distance**2)


def test_free_offset_finds_back(panda, motion):
    """A path that was shifted by 10 cm is shifted back to where the arm can make the ellipsoids."""
    joints, profile, path, _ = motion
    shift = np.array([0.1, 0.0, -0.05])
    result = optimize_trajectory(
        panda, profile, TIME, path=path + shift, damping=DAMPING, start=joints, free_offset=True, smoothness=1e-6
    )
    assert_allclose(result.offset, -shift, atol=2e-3)
    assert_allclose(result.path, path + shift + result.offset, atol=1e-12)
    assert result.distance.max() < 0.02


def test_tolerance_is_used_and_kept(panda, motion):
    """With a tolerance of 5 mm the hand stays within it, and a noisy path takes less jerk than without."""
    joints, profile, path, _ = motion
    noisy = path + 1e-3 * np.random.default_rng(1).uniform(-1.0, 1.0, path.shape)
    exact, loose = (
        optimize_trajectory(
            panda, profile, TIME, path=noisy, path_tolerance=tolerance, damping=DAMPING, start=joints, smoothness=1e-6
        )
        for tolerance in (0.0, 5e-3)
    )
    assert exact.position_error.max() < 1e-5
    assert loose.position_error.max() <= 5e-3 + 1e-6
    assert loose.rms_jerk < 0.2 * exact.rms_jerk


def test_weights_choose_what_counts(panda, motion):
    """Identity weights are the distance; where the first three directions alone count, they come nearer."""
    joints, profile, path, _ = motion
    wanted = 0.6 * profile
    asked = {"path": path, "damping": DAMPING, "start": joints}
    plain = optimize_trajectory(panda, wanted, TIME, **asked)
    same = optimize_trajectory(panda, wanted, TIME, weights=np.tile(np.eye(6), (len(TIME), 1, 1)), **asked)
    part = np.tile(np.diag([1.0, 1.0, 1.0, 0.01, 0.01, 0.01]), (len(TIME), 1, 1))
    chosen = optimize_trajectory(panda, wanted, TIME, weights=part, **asked)
    assert_allclose(same.distance, plain.distance, rtol=1e-3)
    assert np.mean(chosen.distance**2) > np.mean(plain.distance**2)


def test_far_path_is_reported(panda, motion):
    """Out of reach at some times: no error, the rest is kept, and where and by how much is told."""
    joints, profile, path, _ = motion
    far = path.copy()
    far[12:] += [1.5, 0.0, 0.0]
    result = optimize_trajectory(panda, profile, TIME, path=far, damping=DAMPING, start=joints)
    assert set(result.violations) == {"path"}
    assert_allclose(result.violations["path"], result.position_error.max())
    assert result.position_error[:8].max() < 0.02
    assert result.position_error[16:].min() > 0.5
    assert all("missed" in word or "limit" in word for word in result.status[16:])
    assert np.all(panda.within_limits(result.control_positions))
    assert as_numbers(facts_of(result))["motion"]["violations"] == result.violations


def test_limits_go_before_the_path(panda, motion):
    """Too slow for the path: the velocity limit is kept, and what the path lacks is told."""
    joints, profile, path, _ = motion
    result = optimize_trajectory(panda, profile, TIME, path=path, damping=DAMPING, start=joints, velocity_limits=0.05)
    assert set(result.violations) == {"path"}
    assert result.violations["path"] > 0.05


def test_stopping_early_is_told(panda, motion):
    """After too few iterations the status says so in words, and what does not hold is listed."""
    _, profile, path, rough = motion
    result = optimize_trajectory(panda, profile, TIME, path=path, damping=DAMPING, start=rough, max_iter=2)
    assert not result.converged
    assert result.solver_status == "stopped at the largest number of iterations"
    assert result.violations["path"] > 1e-3


def test_absent_casadi_says_how_to_install_it(panda, motion, monkeypatch):
    """Without CasADi the error names the extra."""
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(MissingPackageError, match=r'pip install "maniport\[offline\]"') as caught:
        optimize_trajectory(panda, motion[1], TIME)
    assert isinstance(caught.value, ManiportError)
    assert isinstance(caught.value, ImportError)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": TIME[::-1]}, "time must increase"),
        ({"time": TIME[:-1]}, "profile must have shape"),
        ({"path": np.zeros((3, 3))}, "path must have shape"),
        ({"path": np.full((25, 3), np.nan)}, "path must be finite"),
        ({"start": np.zeros((25, 3))}, "start must have shape"),
        ({"start": np.full((25, 7), 9.0)}, "outside the limits"),
        ({"damping": 0.0}, "damping must be a number above 0"),
        ({"smoothness": 0.0}, "smoothness must be a number above 0"),
        ({"velocity_limits": -1.0}, "velocity_limits must be positive"),
        ({"acceleration_limits": np.ones(3)}, "acceleration_limits must be positive"),
        ({"weights": np.eye(6)}, "weights must have shape"),
        ({"path_tolerance": -0.1}, "path_tolerance must be a number"),
        ({"max_iter": 0}, "max_iter must be a whole number of at least 1"),
        ({"rate": np.inf}, "rate must be a number above 0; found"),
    ],
)
def test_bad_input_is_refused(panda, motion, change, message):
    """What cannot be used is named, with what was found."""
    arguments = {"profile": motion[1], "time": TIME} | change
    with pytest.raises(InvalidInputError, match=message):
        optimize_trajectory(panda, **arguments)


def test_indefinite_profile_is_refused(panda, motion):
    """An ellipsoid that is none is an error."""
    with pytest.raises(NotSPDError, match="profile with damping"):
        optimize_trajectory(panda, -motion[1], TIME, damping=DAMPING)
