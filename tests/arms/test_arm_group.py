"""Groups of arms: robots side by side, limbs of one robot, cooperative ellipsoids of two arms."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.arms.chain import Frame, point_mass, pose
from maniport.arms.restriction import carried_inertia
from maniport.errors import InvalidInputError
from maniport.motion.arm_model import InverseDynamics

BASES = ((0.0, 0.3, 0.0), (0.1, -0.3, 0.2, 0.5))


def test_three_arms_have_their_own_joints_frames_and_collisions():
    """Names are prefixed, results have an axis of arms, and hulls of different arms are checked with one another."""
    three = mp.load_arms("panda", bases=[(0.0, 0.8 * i, 0.0, 0.7 * i) for i in range(3)])
    assert (len(three), three.dof, three.names, three.shared) == (
        3,
        21,
        ("arm1", "arm2", "arm3"),
        (),
    )
    assert three.joint_names[7] == "arm2_panda_joint1"
    q = three.sample(8, 0)
    parts = three.split(q)
    np.testing.assert_array_equal(three.joined(*parts), q)
    for i, (arm, part) in enumerate(zip(three.arms, parts, strict=True)):
        np.testing.assert_array_equal(three.forward(q)[:, i], arm.forward(part))
        np.testing.assert_array_equal(three.manipulability(q)[:, i], arm.manipulability(part))
        np.testing.assert_array_equal(
            three.jacobian(q)[:, i, :, three.columns[i]].transpose(1, 2, 0), arm.jacobian(part)
        )
    collisions = mp.Collisions.of(three)
    between = {frozenset(name[:4] for name in pair) for pair in collisions.between.pairs}
    assert between == {
        frozenset(("arm1", "arm2")),
        frozenset(("arm2", "arm3")),
        frozenset(("arm1", "arm3")),
    }
    alone = np.min(
        [own.clearance(part) for own, part in zip(collisions.of_arms, parts, strict=True)], axis=0
    )
    expected = np.minimum(alone, collisions.between.clearance(q))
    np.testing.assert_allclose(collisions.clearance(q), expected, atol=1e-9)


def test_three_arms_share_a_trunk_and_two_of_them_a_joint_more(crane):
    """The third arm has the first three joints of the second; columns, Jacobians and links agree with each chain."""
    second = crane.arms[1]
    joints = [
        *second.chain.joints[:3],
        *(
            replace(joint, name=f"third_{i}", placement=pose((0, 0, 0.3)))
            for i, joint in enumerate(second.chain.joints[3:])
        ),
    ]
    names = tuple(joint.name for joint in joints)
    frames = {
        "base": Frame(0, np.eye(4)),
        "trunk": Frame(2, np.eye(4)),
        "third_tip": Frame(6, pose((0.2, 0, 0))),
    }
    chain = replace(
        second.chain, joints=tuple(joints), coordinates=names, frames=frames, frame="third_tip"
    )
    group = mp.ArmGroup(*crane.arms, mp.Arm(chain))
    assert (group.dof, group.shared) == (13, ("turn", "rise", "right_1"))
    np.testing.assert_array_equal(group.common, [[6, 2, 2], [2, 6, 3], [2, 3, 6]])
    q = group.sample(4, 0)
    rotations, origins = group.kinematics.link_poses(q)
    for arm, part, links in zip(group.arms, group.split(q), group.kinematics.links, strict=True):
        expected = arm.link_poses(part)
        np.testing.assert_allclose(rotations[:, links], expected[..., :3, :3], atol=1e-12)
        np.testing.assert_allclose(origins[:, links], expected[..., :3, 3], atol=1e-12)


def test_payloads_of_a_group_pull_its_end_effectors_down(crane):
    """Also on shared joints, of the group and of each arm, which has the other arm's payload in its resting pose."""
    inertia = np.array(
        [point_mass(1.0, np.array([0.1, 0.0, 0.1])) + 0.1 * np.diag([0, 0, 0, 1, 1, 1])] * 7
    )
    chains = [replace(arm.chain, inertia=inertia.copy()) for arm in crane.arms]
    for chain, other in zip(chains, chains[::-1], strict=True):  # two joints are shared
        chain.inertia[2] += carried_inertia(other, 2)
    arms = map(mp.Arm, chains)
    group = mp.ArmGroup(*arms, names=crane.names)
    center = np.array([0.0, 0.05, 0.1])
    masses = np.array([2.0, 0.5])
    loaded = group.with_payload(masses, center)
    q = group.sample(4, 0)
    q[0] = np.clip(0.0, group.lower, group.upper)
    turns = group.forward(q)[..., :3, :3]
    jacobians = group.jacobian(q)
    linear = jacobians[..., :3, :] + np.cross(
        jacobians[..., 3:, :], (turns @ center)[..., None], axis=-2
    )
    pulled = 9.81 * np.einsum("a,naj->nj", masses, linear[..., 2, :])
    torques = (InverseDynamics(own).gravity(q) for own in (loaded, group))
    np.testing.assert_allclose(np.subtract(*torques), pulled, atol=1e-9)
    for arm, own, part, columns in zip(
        loaded.arms, group.arms, loaded.split(q[:1]), group.columns, strict=True
    ):
        added = arm.gravity_torques(part) - own.gravity_torques(part)
        np.testing.assert_allclose(added[0], pulled[0, columns], atol=1e-9)
    assert np.abs(pulled[0]).max() > 1.0


def test_a_single_arm_is_a_group_of_one():
    arm = mp.load_arm("panda")
    group = mp.arms.as_group(arm)
    assert group.joint_names == arm.joint_names
    q = arm.sample(4, 0)
    np.testing.assert_array_equal(group.forward(q)[:, 0], arm.forward(q))
    assert mp.arms.as_group(group) is group
    again = pickle.loads(pickle.dumps(mp.ArmGroup(arm, names=("right",))))
    assert (again.names, again.joint_names) == (("right",), arm.joint_names)
    with pytest.raises(InvalidInputError, match="two arms"):
        group.cooperative_ellipsoids(q)


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        ("panda", {}, "must have two arms; found one arm: name both end effectors with frames="),
        (
            "panda",
            {"frames": ("panda_link8", "panda_hand")},
            "must end two limbs; found both on one chain",
        ),
        (("panda", "panda"), {}, "stand in one place; place them with bases="),
        (
            "panda",
            {"bases": BASES, "frames": ["panda_link8"]},
            "frames must be a sequence of 2, one for each arm",
        ),
        ("panda", {"bases": [(0, 0, 0), (0, 1e9, 0)]}, "bases: right must be 3 numbers in"),
        (
            "panda",
            {"bases": BASES, "lock": {"left_joint1": 0}},
            "unknown joint 'left_joint1'.* nearest first",
        ),
        (
            "panda",
            {"bases": BASES, "joints": ["left_panda_joint1"]},
            "none of left_panda_joint1 moves the right arm",
        ),
        (
            "panda",
            {"bases": BASES, "frames": ("panda_link8", "panda_lnk8")},
            "unknown frame 'panda_lnk8'",
        ),
        ("myoarm", {}, "'myoarm' is a person"),
        (
            "panda",
            {"bases": BASES, "lock": {"panda_joint1": 0}},
            "unknown joint 'panda_joint1'.*'left_panda_joint1'",
        ),
    ],
)
def test_what_is_no_pair_is_named(robot, options, message):
    with pytest.raises(InvalidInputError, match=message):
        mp.load_arms(robot, **options)


def test_postures_of_arms_that_do_not_agree_are_refused(crane):
    left, right = crane.split(crane.sample(4, 0))
    with pytest.raises(InvalidInputError, match="'rise'"):
        crane.joined(left, right + 0.1 * np.eye(6)[1])
    with pytest.raises(InvalidInputError, match="leading shape"):
        crane.joined(left, right[:2])


def test_single_joints_of_a_pair_are_held():
    arms = mp.load_arms(
        "panda", bases=BASES, lock={"left_panda_joint1": 0.1, "right_panda_joint3": 0.2}
    )
    assert [arm.chain.locked for arm in arms.arms] == [{"panda_joint1": 0.1}, {"panda_joint3": 0.2}]


def test_ellipsoids_of_arms_without_shared_joints_are_sums():
    """M_r = M_left + M_right and M_a = (M_left + M_right) / 4 to 1e-12."""
    pandas = mp.load_arms("panda", bases=BASES)
    q = pandas.sample(64, 0)
    for part in ("translation", "rotation", "full"):
        together = pandas.manipulability(q, part=part).sum(axis=1)
        for kind, factor in (("relative", 1.0), ("absolute", 0.25)):
            actual = pandas.cooperative_ellipsoids(q, kind, part)
            np.testing.assert_allclose(actual, factor * together, rtol=0, atol=1e-12)


def test_jacobians_of_two_arms_are_combined(crane):
    q = crane.sample(4, 0)
    left, right = np.moveaxis(crane.jacobian(q), 1, 0)
    moved = np.any(crane.jacobian(q) != 0, axis=(0, 2))
    np.testing.assert_array_equal(
        moved, [[True] * 6 + [False] * 4, [True] * 2 + [False] * 4 + [True] * 4]
    )
    moves = (right - left)[:, :3]
    expected = moves @ np.swapaxes(moves, -1, -2)
    np.testing.assert_allclose(crane.cooperative_ellipsoids(q), expected, atol=1e-12)
    assert np.linalg.norm(expected - crane.manipulability(q).sum(axis=1), axis=(1, 2)).min() > 0.01
