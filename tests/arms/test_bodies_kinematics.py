"""Laws of forward kinematics and Jacobians, on every kind of arm."""

import numpy as np
import pinocchio as pin
import pytest

from maniport.arms import load_arm
from maniport.arms.arm import Arm
from maniport.arms.chain import PRISMATIC

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
