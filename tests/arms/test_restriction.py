"""Parts of an arm: another base, joints that are held, and which frame is the tip."""

import numpy as np
import pinocchio as pin
import pytest

from maniport.arms import load_arm
from maniport.errors import UnknownNameError


def test_base_and_lock_give_pinocchios_relative_jacobian(urdf):
    """Poses and Jacobians seen from a moving frame, with a joint held, are Pinocchio's relative ones to 1e-9."""
    arm = load_arm(urdf, base="boom", lock={"travel": 0.25})
    assert (arm.chain.base, arm.joint_names, arm.chain.locked) == ("boom", ("raise", "spin"), {"travel": 0.25})
    model = pin.buildModelFromUrdf(str(urdf))
    data = model.createData()
    tip, base = model.getFrameId("hook"), model.getFrameId("boom")
    for lean, spin in arm.sample(5, random_state=0):
        # turn is continuous (cosine, sine); the cable follows the boom: what is seen from there moves with it, too
        q = np.array([1.0, 0.0, lean, 0.25, 0.2 - 0.5 * lean, spin])
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        seen = data.oMf[base].actInv(data.oMf[tip])
        spins = [pin.getFrameJacobian(model, data, one, pin.LOCAL_WORLD_ALIGNED) for one in (tip, base)]
        away = data.oMf[tip].translation - data.oMf[base].translation
        spins[1][:3] -= pin.skew(away) @ spins[1][3:]
        turned = data.oMf[base].rotation.T @ (spins[0] - spins[1]).reshape(2, 3, -1)
        expected = np.stack([-0.5 * turned[..., 3] + turned[..., 1], turned[..., 4]], axis=-1).reshape(6, 2)
        np.testing.assert_allclose(arm.forward([lean, spin]), seen.homogeneous, atol=1e-9)
        np.testing.assert_allclose(arm.jacobian([lean, spin]), expected, atol=1e-9)


def test_a_part_is_the_whole_arm_with_coordinates_held():
    """Joints before a base, held ones and those that are not named as moving stand still; what lies before is gone."""
    whole, part = load_arm("panda"), load_arm("panda", base="panda_link3")
    q = whole.sample(4, random_state=1)
    before = load_arm("panda", frame="panda_link3").forward(q[:, :3])
    np.testing.assert_allclose(before @ part.forward(q[:, 3:]), whole.forward(q), atol=1e-12)
    np.testing.assert_array_equal(part.velocity_limits, whole.velocity_limits[3:])
    assert part.frames[0] == "panda_link3"
    with pytest.raises(UnknownNameError, match="unknown base 'panda_link2'"):
        part.restricted(base="panda_link2")
    some = load_arm("panda", joints=["panda_joint1", "panda_joint2"], lock={"panda_joint4": -1.5})
    q = np.array([0.3, -0.2, 0.0, -1.5, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(some.forward(q[:2]), whole.forward(q), atol=1e-12)
    assert some.chain.locked == pytest.approx(dict(zip(whole.joint_names[2:], q[2:], strict=True)))
    np.testing.assert_array_equal(some.restricted(frame="panda_link3").chain.frames["panda_link0"].placement, np.eye(4))
