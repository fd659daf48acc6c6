"""Parts of an arm: another base, joints that are held, and which frame is the tip."""

import numpy as np
import pinocchio as pin
import pytest

from maniport.arms import load_arm
from maniport.errors import InvalidInputError, UnknownNameError


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


def test_a_base_leaves_out_what_lies_before_it():
    """From the base on nothing changes: its pose times the part's is the whole arm's, and frames before it are gone."""
    whole, part = load_arm("panda"), load_arm("panda", base="panda_link3")
    q = whole.sample(4, random_state=1)
    before = load_arm("panda", frame="panda_link3").forward(q[:, :3])
    np.testing.assert_allclose(before @ part.forward(q[:, 3:]), whole.forward(q), atol=1e-12)
    assert part.frames[0] == "panda_link3"
    assert "panda_link2" not in part.frames
    np.testing.assert_array_equal(part.velocity_limits, whole.velocity_limits[3:])
    with pytest.raises(UnknownNameError, match="unknown base 'panda_link2'"):
        part.restricted(base="panda_link2")


def test_a_held_joint_stands_where_it_is_held():
    """Holding a joint is the whole arm with that coordinate constant, also when others are named as moving."""
    whole = load_arm("panda")
    some = load_arm("panda", joints=["panda_joint1", "panda_joint2"], lock={"panda_joint4": -1.5})
    q = np.array([0.3, -0.2, 0.0, -1.5, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(some.forward(q[:2]), whole.forward(q), atol=1e-12)
    assert some.chain.locked == pytest.approx(dict(zip(whole.joint_names[2:], q[2:], strict=True)))
    np.testing.assert_array_equal(some.restricted(frame="panda_link3").chain.frames["panda_link0"].placement, np.eye(4))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lock": {"panda_joint4": 0.5}}, r"lock: 'panda_joint4' \[rad\] must be a number in \[-3.0718, -0.0698\]"),
        ({"lock": {"panda_joint9": 0.5}}, "unknown joint 'panda_joint9' .*'panda_joint1'"),
        (
            {"lock": dict.fromkeys([f"panda_joint{i}" for i in (1, 2, 3, 5)], 0), "frame": "panda_link3"},
            "not move the fr",
        ),
        ({"lock": {"panda_joint1": 0}, "frame": "panda_link1"}, "no movable joint .* lock contains all"),
        ({"lock": ["panda_joint4"]}, "lock must map names of joints to positions, such as .*; found"),
        (
            {"lock": {"panda_joint4": -1}, "joints": ["panda_joint4"]},
            "in joints or in lock, not in both; found",
        ),
        ({"lock": {"panda_joint1": 0}, "base": "panda_link2"}, "does not move the frame .* seen from 'panda_link2'"),
        ({"base": "panda_hand"}, "no movable joint lies between the base and the frame"),
        (
            {"base": "panda_hand", "frame": "panda_link2"},
            "unknown base 'panda_hand'",
        ),
    ],
)
def test_parts_that_cannot_be_are_named(options, message):
    """A base beyond the tip, joints that are not there or held beyond their limits get one sentence."""
    with pytest.raises(InvalidInputError, match=message):
        load_arm("panda", **options)
