"""Configurations, kinematics, ellipsoids of single arms and of two arms as one, and their derivatives."""

import numpy as np
import pinocchio as pin
import pytest
from drawn_arms import model_of
from numpy.testing import assert_allclose

from maniport.arms import EllipsoidSpec, load_arm
from maniport.arms.arm import Arm
from maniport.arms.manipulability import manipulability
from maniport.errors import InvalidInputError, NotSPDError

WRONG = [  # method, arguments, options, message
    ("sample", (2.5,), {}, "n must be a whole"),
    ("sample", (4,), {"sequence": "halton"}, "unknown sequence 'halton'"),
    ("sample", (4,), {"random_state": "seed"}, "random_state"),
    (
        "point_positions",
        (np.zeros(7), ["panda_hnd"]),
        {},
        "unknown frame 'panda_hnd' .*first: 'panda_hand'",
    ),
    *(
        (name, (q,), {}, "^q must")
        for q in (np.zeros(6), 0.0, [[0, 0, np.nan, 0, 0, 0, 0]])
        for name in ("forward", "jacobian", "manipulability", "skeleton", "require_within_limits")
    ),
    *(
        ("manipulability", (np.zeros(7),), options, next(iter(options)))
        for options in (
            {"kind": "speed"},
            {"part": "linear"},
            {"joint_weights": [1.0, 2.0]},
            {"joint_weights": [1, 1, 0, 1, 1, 1, 1]},
            {"joint_weights": [[1.0]]},
            {"joint_weights": "limits"},
        )
    ),
    *(
        ("from_dh", ("planar",), {"rows": [[0, 0, 1, 0]] * 2} | options, next(iter(options)))
        for options in (
            {"rows": [[0, 0, 1]]},
            {"lower": [0, 0, 0]},
            {"lower": 1.0, "upper": [2.0, 0.5]},
            {"joint_names": ["a", "a"]},
            {"kinds": ["revolute", "ball"]},
            {"base": 2 * np.eye(3)},
        )
    ),
]


@pytest.mark.parametrize(("method", "arguments", "options", "message"), WRONG)
def test_wrong_arguments_are_named(method, arguments, options, message):
    with pytest.raises(InvalidInputError, match=message):
        getattr(load_arm("panda"), method)(*arguments, **options)


def test_singular_force_ellipsoid_is_refused(planar):
    with pytest.raises(NotSPDError, match=r"jacobian\[0\].*\(2 of 2\).*kind='velocity'"):
        planar.manipulability([[0.3, 0.5], [0.0, 0.0]], kind="force")
    with pytest.raises(NotSPDError, match=r"jacobian\[1\].*singular"):
        manipulability(np.stack([np.eye(6), np.diag([1.0, 0, 1, 1, 1, 1])]), "force")


def mixed() -> Arm:
    """An arm of eight joints, three of them prismatic, so that all parts are regular."""
    kinds = [
        "revolute",
        "prismatic",
        "revolute",
        "revolute",
        "prismatic",
        "revolute",
        "revolute",
        "prismatic",
    ]
    return Arm.from_dh("mixed", np.random.default_rng(0).uniform(-1, 1, (8, 4)), kinds=kinds)


@pytest.fixture(
    params=["panda", "myoarm", "rhuman", "urdf", "mjcf", "planar", "restricted", "mixed"]
)
def arm(request: pytest.FixtureRequest) -> Arm:
    if request.param in ("urdf", "mjcf"):
        return load_arm(request.getfixturevalue(request.param))
    made = {
        "planar": lambda: request.getfixturevalue("planar"),
        "mixed": mixed,
        "restricted": lambda: load_arm(
            "myoarm", frame="wrist", joints=["shoulder_elv", "elbow_flexion"]
        ),
    }
    return made.get(request.param, lambda: load_arm(request.param))()


def test_kinematics_agrees_with_pinocchio(arm):
    """Poses and Jacobians are those of Pinocchio's model of the same chain, points those of arms that end there."""
    chain = arm.chain
    model = model_of(arm.chain)
    frame = chain.frames[chain.frame]
    placed = pin.Frame(
        chain.frame, frame.joint, 0, pin.SE3(frame.placement), pin.FrameType.OP_FRAME
    )
    index = model.addFrame(placed)
    data = model.createData()
    q = arm.sample(600, random_state=3)
    poses = arm.forward(q)
    jacobians = arm.jacobian(q)
    for row, positions in enumerate(q[:16] @ chain.coupling.T + chain.offset):
        expected = pin.computeFrameJacobian(model, data, positions, index, pin.LOCAL_WORLD_ALIGNED)
        assert_allclose(poses[row], data.oMf[index].homogeneous, atol=1e-12)
        assert_allclose(jacobians[row], expected.reshape(6, -1) @ chain.coupling, atol=1e-12)
    values = arm.point_positions(q, arm.frames)
    slopes = arm.point_jacobians(q, arm.frames)
    for k, name in enumerate(arm.frames):
        if np.any(chain.coupling[: chain.frames[name].joint]):
            part = arm.restricted(frame=name)
            own = [arm.joint_names.index(joint) for joint in part.joint_names]
            assert_allclose(values[:, k], part.forward(q[:, own])[:, :3, 3], atol=1e-13)
            assert_allclose(slopes[:, k][..., own], part.jacobian(q[:, own])[:, :3], atol=1e-13)


@pytest.mark.parametrize("name", ["panda", "myoarm", "rhuman", "mixed"])
@pytest.mark.parametrize("kind", ["velocity", "force"])
@pytest.mark.parametrize("part", ["translation", "rotation", "full"])
def test_derivatives_of_ellipsoids_are_finite_differences(name, kind, part):
    regular = mixed() if name == "mixed" else load_arm(name)
    q = regular.sample(128 if kind == "force" else 20, random_state=1)
    step = 1e-5
    shifts = step * np.eye(regular.dof)
    for weights in (None, np.linspace(0.5, 2, regular.dof)):
        spec = EllipsoidSpec(kind, part, weights)
        if kind == "force":
            q = q[np.linalg.cond(regular.ellipsoids(q, spec.bounded)) < 100]
        assert len(q) > 5 or part == "full"
        m = {n: regular.ellipsoids(q[:, None] + n * shifts, spec) for n in (-20, -10, 10, 20)}
        expected = (8 * (m[10] - m[-10]) - (m[20] - m[-20])) / (120 * step)
        scale = np.abs(expected).max(axis=(1, 2, 3), keepdims=True) if kind == "force" else 1.0
        assert_allclose(
            regular.posed_differentials(q, spec)[3] / scale, expected / scale, rtol=0, atol=1e-7
        )
