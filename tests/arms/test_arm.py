"""Configurations, kinematics and ellipsoids of single arms."""

import numpy as np
import pinocchio as pin
import pytest

from maniport import arms
from maniport.arms import EllipsoidSpec, load_arm
from maniport.arms.arm import Arm
from maniport.arms.chain import PRISMATIC
from maniport.arms.manipulability import manipulability
from maniport.errors import InvalidInputError, NotSPDError


@pytest.fixture
def panda():
    """The embedded robot."""
    return load_arm("panda")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n must be a whole number of at least 1; found 0"),
        ({"n": 2.5}, "n must be a whole number of at least 1; found 2.5"),
        ({"n": 4, "sequence": "halton"}, "unknown sequence 'halton'"),
        ({"n": 4, "random_state": "seed"}, "random_state .*found 'seed'"),
    ],
)
def test_wrong_sampling_arguments_are_named(panda, arguments, message):
    """Each wrong argument gets an error that says what is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        panda.sample(**arguments)


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(6), r"q must have shape \(\.\.\., 7\).*'panda' \(panda_joint1, .*\); found shape \(6,\)"),
        (0.0, r"q must have shape \(\.\.\., 7\).*found shape \(\)"),
        ([[0, 0, np.nan, 0, 0, 0, 0]], r"q must be finite; found nan at index \(0, 2\)"),
        ("home", "q must be an array of numbers; found str"),
    ],
)
def test_wrong_configurations_are_refused(panda, q, message):
    """Shape, nan and type of a configuration are checked by every method that takes one."""
    methods = (panda.forward, panda.jacobian, panda.manipulability, panda.skeleton, panda.require_within_limits)
    for method in methods:
        with pytest.raises(InvalidInputError, match=message):
            method(q)


STEP = 1e-6


@pytest.fixture(params=["panda", "myoarm", "rhuman", "urdf", "mjcf", "planar", "restricted"])
def arm(request: pytest.FixtureRequest) -> Arm:
    """One arm of each kind."""
    if request.param in ("urdf", "mjcf"):
        return load_arm(request.getfixturevalue(request.param))
    if request.param == "planar":
        return request.getfixturevalue("planar")
    if request.param == "restricted":
        return load_arm("myoarm", frame="wrist", joints=["shoulder_elv", "elbow_flexion"])
    return load_arm(request.param)


def differences(function, q: np.ndarray) -> np.ndarray:
    """Central differences of a function of q, the derivative's direction last."""
    steps = STEP * np.eye(q.shape[-1])
    return np.stack([(function(q + s) - function(q - s)) / (2 * STEP) for s in steps], axis=-1)


def test_angular_jacobian_is_the_derivative_of_orientation(arm):
    """The lower rows are the angular velocity: [ω]× = Ṙ Rᵀ in the axes of the base."""
    q = arm.sample(8, random_state=1)
    change = differences(lambda x: arm.forward(x)[..., :3, :3], q)
    spin = np.einsum("nijk,nlj->nilk", change, arm.forward(q)[:, :3, :3])
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    np.testing.assert_allclose(arm.jacobian(q)[:, 3:], omega, atol=1e-8)


def test_modified_dh_table_gives_the_panda():
    """Craig's table of the Panda, as its maker publishes it, gives the embedded arm."""
    half = np.pi / 2
    rows = [
        [0, 0.333, 0, 0], [0, 0, 0, -half], [0, 0.316, 0, half], [0, 0, 0.0825, half],
        [0, 0.384, -0.0825, -half], [0, 0, 0, half], [0, 0, 0.088, half],
    ]  # fmt: skip
    panda = load_arm("panda", frame="panda_link7")
    table = Arm.from_dh("table", rows, panda.lower, panda.upper, convention="modified")
    q = panda.sample(10, random_state=0)
    np.testing.assert_allclose(table.forward(q), panda.forward(q), atol=1e-14)


def test_poses_and_jacobians_agree_with_pinocchio(arm):
    """The compiled chain gives the poses and Jacobians of Pinocchio's model of the same chain."""
    chain, model, parent = arm.chain, pin.Model(), 0
    for joint in chain.joints:
        kind = pin.JointModelPrismaticUnaligned if joint.kind == PRISMATIC else pin.JointModelRevoluteUnaligned
        parent = model.addJoint(parent, kind(joint.axis), pin.SE3(joint.placement), joint.name)
    frame = chain.frames[chain.frame]
    placed = pin.Frame(chain.frame, frame.joint, 0, pin.SE3(frame.placement), pin.FrameType.OP_FRAME)
    index, data, q = model.addFrame(placed), model.createData(), arm.sample(16, random_state=3)
    for row, positions in enumerate(q @ chain.coupling.T + chain.offset):
        expected = pin.computeFrameJacobian(model, data, positions, index, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(arm.forward(q)[row], data.oMf[index].homogeneous, atol=1e-12)
        np.testing.assert_allclose(arm.jacobian(q)[row], expected.reshape(6, -1) @ chain.coupling, atol=1e-12)


def test_singular_force_ellipsoid_is_refused(planar):
    """An unbounded force ellipsoid is an error that names the configuration and the way out."""
    with pytest.raises(NotSPDError, match=r"jacobian\[0\] is singular.*\(2 of 2\).*kind='velocity'"):
        planar.manipulability([[0.3, 0.5], [0.0, 0.0]], kind="force")
    with pytest.raises(NotSPDError, match=r"jacobian\[1\] is singular"):
        manipulability(np.stack([np.eye(6), np.diag([1.0, 0, 1, 1, 1, 1])]), EllipsoidSpec("force"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "speed"}, "unknown kind 'speed'"),
        ({"part": "linear"}, "unknown part 'linear'"),
        ({"joint_weights": [1.0, 2.0]}, r"joint_weights must be 7 numbers above 0; found shape \(2,\)"),
        ({"joint_weights": [1, 1, 0, 1, 1, 1, 1]}, "joint_weights must be .* numbers above 0; found 0 at index 2"),
        ({"joint_weights": [[1.0]]}, r"joint_weights must be a sequence of numbers above 0; found shape \(1, 1\)"),
        ({"joint_weights": "limits"}, "unknown joint_weights 'limits'"),
    ],
)
def test_wrong_options_are_named(arguments, message):
    """A wrong option gets an error that says what was found and what is allowed."""
    panda = load_arm("panda")
    with pytest.raises(InvalidInputError, match=message):
        panda.manipulability(panda.sample(2, random_state=0), **arguments)


def test_unknown_velocity_limits_are_named(urdf):
    """Weights by velocity limits need them all: the joints without one are listed."""
    with pytest.raises(InvalidInputError, match=r"'myoarm' has no velocity limits for elv_angle, .*flexion; give"):
        load_arm("myoarm").manipulability(np.zeros(7), joint_weights="velocity-limits")
    with pytest.raises(InvalidInputError, match="'crane' has no velocity limits for turn, spin; give"):
        load_arm(urdf).manipulability(np.zeros(4), joint_weights="velocity-limits")


def sliding():
    """An arm whose second joint slides."""
    rows = [[0.1, 0.3, 0.2, 0.5], [0.4, 0.1, 0.3, -1.0], [0.2, 0.0, 0.4, 0.7]]
    return arms.Arm.from_dh("sliding", rows, kinds=["revolute", "prismatic", "revolute"])


@pytest.mark.parametrize("arm", [arms.myoarm(), arms.rhuman(), sliding()], ids=lambda arm: arm.name)
def test_points_agree_with_pinocchio(arm):
    """Positions and derivatives are those that Pinocchio finds of the tips of arms that end there, to 1e-13."""
    q = arm.sample(600, random_state=0)  # more than are worked on together
    values, slopes = arm.point_positions(q, arm.frames), arm.point_jacobians(q, arm.frames)
    for k, name in enumerate(arm.frames):
        if arm.chain.frames[name].joint:
            part = arm.restricted(frame=name)
            own = [arm.joint_names.index(joint) for joint in part.joint_names]
            np.testing.assert_allclose(values[:, k], part.forward(q[:, own])[:, :3, 3], atol=1e-13)
            np.testing.assert_allclose(slopes[:, k][..., own], part.jacobian(q[:, own])[:, :3], atol=1e-13)
