"""Pairs of arms: two robots side by side, two limbs of one robot."""

from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.arms.chain import Frame, Joint, pose
from maniport.errors import InvalidInputError, UnknownNameError

BASES = ((0.0, 0.3, 0.0), (0.1, -0.3, 0.2, 0.5))


@pytest.fixture(scope="module")
def pandas():
    """Two Pandas, one of them turned."""
    return mp.load_arms("panda", bases=BASES)


@pytest.fixture(scope="module")
def crane():
    """Two arms with four joints each on a trunk that turns and rises."""
    return mp.arms.ArmGroup(limb("left"), limb("right"))


def limb(side, **changes):
    """One arm of the crane."""
    sign = 1.0 if side == "left" else -1.0
    turn, up, across = np.eye(3)[2], np.eye(3)[2], np.eye(3)[1]
    joints = [
        Joint("turn", "revolute", turn, pose((0, 0, 0.2))),
        Joint("rise", "prismatic", up, pose((0, 0, 0.3))),
        Joint(f"{side}_1", "revolute", turn, pose((0.1, sign * 0.2, 0.1))),
        Joint(f"{side}_2", "revolute", across, pose((0, sign * 0.1, 0))),
        Joint(f"{side}_3", "revolute", turn, pose((0.3, 0, 0))),
        Joint(f"{side}_4", "revolute", across, pose((0.25, 0, 0.05))),
    ]
    coordinates = tuple(joint.name for joint in joints)
    frames = {"base": Frame(0, np.eye(4)), "trunk": Frame(2, np.eye(4)), f"{side}_tip": Frame(6, pose((0.2, 0, 0)))}
    chain = mp.Arm.from_dh("crane", np.zeros((6, 4)), -1.5, 1.5).chain
    return mp.Arm(replace(
        chain, joints=tuple(joints), frames=frames, frame=f"{side}_tip", coordinates=coordinates, **changes
    ))  # fmt: skip


def test_a_shared_joint_counts_once_and_moves_both(crane):
    """The trunk's joints come first, once; a change of one moves both tips, a change of an arm's own joint only its."""
    assert (crane.shared, crane.dof, crane.trunk) == (("turn", "rise"), 10, 2)
    assert crane.joint_names == (*crane.left.joint_names, *crane.right.joint_names[2:])
    moved = np.any(crane.jacobian(crane.sample(16, 1)) != 0, axis=(0, 2))
    np.testing.assert_array_equal(moved[0], [True] * 6 + [False] * 4)
    np.testing.assert_array_equal(moved[1], [True] * 2 + [False] * 4 + [True] * 4)


@pytest.mark.parametrize(("robot", "options", "said"), [
    ("panda", {}, "is no pair: name two tips with frames="),
    ("panda", {"frames": ("panda_link8", "panda_hand")}, "must end two limbs; found both on one chain"),
    (("panda", "panda"), {}, "stand in one place; place them with bases="),
    ("panda", {"bases": [(0, 0, 0)]}, "bases must be two, left and right"),
    ("panda", {"bases": [(0, 0, 0), (0, 1e9, 0)]}, "bases: right must be 3 numbers in"),
    ("panda", {"bases": BASES, "lock": {"left_joint1": 0}}, "unknown joint 'left_joint1'.* nearest first"),
    ("panda", {"bases": BASES, "joints": ["left_panda_joint1"]}, "none of left_panda_joint1 moves the right arm"),
    ("panda", {"bases": BASES, "frames": ("panda_link8", "panda_lnk8")}, "unknown frame 'panda_lnk8'"),
    ("myoarm", {}, "'myoarm' is a person"),
    ("panda", {"bases": BASES, "lock": {"left_panda_joint1": 0.5, "panda_joint1": 0}}, "named twice"),
])  # fmt: skip
def test_what_is_no_pair_is_told(robot, options, said):
    """Wrong robots, frames, bases and joints are named, with what is allowed."""
    with pytest.raises(InvalidInputError, match=said):
        mp.load_arms(robot, **options)


def test_postures_of_arms_that_do_not_agree_are_refused(crane):
    """A shared joint has one position; both arms have as many configurations."""
    left, right = crane.split(crane.sample(4, 0))
    with pytest.raises(InvalidInputError, match="shared joint 'rise'"):
        crane.joined(left, right + 0.1 * np.eye(6)[1])
    with pytest.raises(InvalidInputError, match="same leading shape"):
        crane.joined(left, right[:2])


def test_single_joints_of_a_pair_are_held():
    """A name without a side is that of both robots; with one it is that of its own."""
    arms = mp.load_arms("panda", bases=BASES, lock={"panda_joint1": 0.1, "right_panda_joint3": 0.2})
    assert arms.left.chain.locked == {"panda_joint1": 0.1}
    assert arms.right.chain.locked == {"panda_joint1": 0.1, "panda_joint3": 0.2}
    with pytest.raises(UnknownNameError):
        arms.manipulability(arms.sample(2, 0), of="both")
