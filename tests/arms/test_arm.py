"""Configurations, kinematics, ellipsoids of single arms and of two arms as one, and their derivatives."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from maniport.arms import EllipsoidSpec, load_arm
from maniport.arms.arm import Arm
from maniport.arms.chain import PRISMATIC
from maniport.arms.manipulability import manipulability
from maniport.errors import InvalidInputError, NotSPDError


@pytest.fixture(scope="module")
def panda():
    """The embedded robot."""
    return load_arm("panda")


def test_wrong_arguments_are_named(panda):
    """Sampling arguments, and configurations for every method that takes them, are checked."""
    for options, message in (
        ({"n": 2.5}, "n must be a whole number of at least 1; found 2.5"),
        ({"n": 4, "sequence": "halton"}, "unknown sequence 'halton'"),
        ({"n": 4, "random_state": "seed"}, "random_state .*found 'seed'"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            panda.sample(**options)
    with pytest.raises(InvalidInputError, match=r"unknown frame 'panda_hnd' on the arm 'panda'; .*first: 'panda_hand'"):
        panda.point_positions(np.zeros(7), ["panda_hand", "panda_hnd"])
    for method in (panda.forward, panda.jacobian, panda.manipulability, panda.skeleton, panda.require_within_limits):
        for q, message in (
            (np.zeros(6), r"q must have shape \(\.\.\., 7\).*'panda' \(panda_joint1, .*\); found shape \(6,\)"),
            (0.0, r"q must have shape \(\.\.\., 7\).*found shape \(\)"),
            ([[0, 0, np.nan, 0, 0, 0, 0]], r"q must be finite; found nan at index \(0, 2\)"),
        ):
            with pytest.raises(InvalidInputError, match=message):
                method(q)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "speed"}, "unknown kind 'speed'"),
        ({"part": "linear"}, "unknown part 'linear'"),
        ({"joint_weights": [1.0, 2.0]}, r"joint_weights must be 7 numbers above 0; found shape \(2,\)"),
        ({"joint_weights": [1, 1, 0, 1, 1, 1, 1]}, "joint_weights must be .* numbers above 0; found 0 at index 2"),
        ({"joint_weights": [[1.0]]}, r"joint_weights must be a sequence of numbers above 0; found shape \(1, 1\)"),
        ({"joint_weights": "limits"}, "unknown joint_weights 'limits'"),
    ],
)
def test_wrong_options_of_ellipsoids_are_named(panda, options, message):
    """A wrong option gets an error that says what was found and what is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        panda.manipulability(panda.sample(2, random_state=0), **options)


def test_unknown_velocity_limits_are_named(urdf):
    """Weights by velocity limits need them all: the joints without one are listed."""
    for arm, joints in (("myoarm", "elv_angle, .*flexion"), (urdf, "turn, spin")):
        with pytest.raises(InvalidInputError, match=f"has no velocity limits above 0 for {joints}; add"):
            load_arm(arm).manipulability(np.zeros(load_arm(arm).dof), joint_weights="joint-limits")


def test_singular_force_ellipsoid_is_refused(planar):
    """An unbounded force ellipsoid is an error that names the configuration and the way out."""
    with pytest.raises(NotSPDError, match=r"jacobian\[0\] is singular.*\(2 of 2\).*kind='velocity'"):
        planar.manipulability([[0.3, 0.5], [0.0, 0.0]], kind="force")
    with pytest.raises(NotSPDError, match=r"jacobian\[1\] is singular"):
        manipulability(np.stack([np.eye(6), np.diag([1.0, 0, 1, 1, 1, 1])]), "force")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rows": [[0, 0, 1]]}, r"rows must have shape \(n, 4\).*found shape \(1, 3\)"),
        ({"lower": [0, 0, 0]}, r"lower must be one number or 2 numbers; found shape \(3,\)"),
        ({"lower": 1.0, "upper": [2.0, 0.5]}, "lower of .joint2. must be below upper"),
        ({"joint_names": ["a", "a"]}, "joint_names must name each once"),
        ({"kinds": ["revolute", "ball"]}, r"unknown kinds\[1\] 'ball'"),
        ({"base": 2 * np.eye(3)}, "base must be a rotation"),
    ],
)
def test_wrong_tables_are_refused(arguments, message):
    """Each wrong argument of a Denavit-Hartenberg arm is named."""
    with pytest.raises(InvalidInputError, match=message):
        Arm.from_dh("planar", **{"rows": [[0, 0, 1, 0], [0, 0, 1, 0]]} | arguments)


def mixed() -> Arm:
    """An arm of eight joints, three of them prismatic, so that all parts are regular."""
    kinds = ["revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute", "revolute", "prismatic"]
    return Arm.from_dh("mixed", np.random.default_rng(0).uniform(-1, 1, (8, 4)), kinds=kinds)


@pytest.fixture(params=["panda", "myoarm", "rhuman", "urdf", "mjcf", "planar", "restricted", "mixed"])
def arm(request: pytest.FixtureRequest) -> Arm:
    """One arm of each kind."""
    if request.param in ("urdf", "mjcf"):
        return load_arm(request.getfixturevalue(request.param))
    made = {
        "planar": lambda: request.getfixturevalue("planar"),
        "mixed": mixed,
        "restricted": lambda: load_arm("myoarm", frame="wrist", joints=["shoulder_elv", "elbow_flexion"]),
    }
    return made.get(request.param, lambda: load_arm(request.param))()


def test_kinematics_agrees_with_pinocchio(arm):
    """Poses and Jacobians are those of Pinocchio's model of the same chain, points those of arms that end there."""
    chain, model, parent = arm.chain, pin.Model(), 0
    for joint in chain.joints:
        kind = pin.JointModelPrismaticUnaligned if joint.kind == PRISMATIC else pin.JointModelRevoluteUnaligned
        parent = model.addJoint(parent, kind(joint.axis), pin.SE3(joint.placement), joint.name)
    frame = chain.frames[chain.frame]
    placed = pin.Frame(chain.frame, frame.joint, 0, pin.SE3(frame.placement), pin.FrameType.OP_FRAME)
    index, data, q = model.addFrame(placed), model.createData(), arm.sample(600, random_state=3)
    poses, jacobians = arm.forward(q), arm.jacobian(q)
    for row, positions in enumerate(q[:16] @ chain.coupling.T + chain.offset):
        expected = pin.computeFrameJacobian(model, data, positions, index, pin.LOCAL_WORLD_ALIGNED)
        assert_allclose(poses[row], data.oMf[index].homogeneous, atol=1e-12)
        assert_allclose(jacobians[row], expected.reshape(6, -1) @ chain.coupling, atol=1e-12)
    values, slopes = arm.point_positions(q, arm.frames), arm.point_jacobians(q, arm.frames)
    for k, name in enumerate(arm.frames):
        if np.any(chain.coupling[: chain.frames[name].joint]):
            part = arm.restricted(frame=name)
            own = [arm.joint_names.index(joint) for joint in part.joint_names]
            assert_allclose(values[:, k], part.forward(q[:, own])[:, :3, 3], atol=1e-13)
            assert_allclose(slopes[:, k][..., own], part.jacobian(q[:, own])[:, :3], atol=1e-13)


@pytest.fixture(params=["panda", "myoarm", "rhuman", "mixed"])
def regular(request):
    """An arm with plain, coupled, many or prismatic joints."""
    return mixed() if request.param == "mixed" else load_arm(request.param)


@pytest.mark.parametrize("kind", ["velocity", "force"])
@pytest.mark.parametrize("part", ["translation", "rotation", "full"])
def test_derivatives_of_ellipsoids_are_finite_differences(regular, kind, part):
    """Every entry agrees with central differences of fourth order, weighted or not."""
    q, step = regular.sample(128 if kind == "force" else 20, random_state=1), 1e-5
    shifts = step * np.eye(regular.dof)
    for weights in (None, np.linspace(0.5, 2, regular.dof)):
        spec = EllipsoidSpec(kind, part, weights)
        if kind == "force":
            q = q[np.linalg.cond(regular.ellipsoids(q, spec.bounded)) < 100]
        assert len(q) > 5 or part == "full"
        m = {n: regular.ellipsoids(q[:, None] + n * shifts, spec) for n in (-20, -10, 10, 20)}
        expected = (8 * (m[10] - m[-10]) - (m[20] - m[-20])) / (120 * step)
        scale = np.abs(expected).max(axis=(1, 2, 3), keepdims=True) if kind == "force" else 1.0
        assert_allclose(regular.posed_differentials(q, spec)[3] / scale, expected / scale, rtol=0, atol=1e-7)
