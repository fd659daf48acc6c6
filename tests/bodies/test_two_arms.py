"""Pairs of arms: two robots side by side, two limbs of one robot."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.bodies.chain import Frame, Joint, pose
from maniport.errors import InvalidInputError, UnknownNameError, on_the_command_line
from real_robots import NEEDS_ROBOTS

BASES = ((0.0, 0.3, 0.0), (0.1, -0.3, 0.2, 0.5))


@pytest.fixture(scope="module")
def pandas():
    """Two Pandas, one of them turned."""
    return mp.load_arms("panda", bases=BASES)


@pytest.fixture(scope="module")
def crane():
    """Two arms with four joints each on a trunk that turns and rises."""
    return mp.bodies.Arms(limb("left"), limb("right"))


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


def test_placed_arms_answer_in_the_world(pandas):
    """Poses, Jacobians' rows and ellipsoids of a placed arm are those of the arm, seen from the world."""
    panda = mp.load_arm("panda")
    q = panda.sample(8, 0)
    for arm, (x, y, z, *yaw) in zip(pandas.each, BASES, strict=True):
        base = pose((x, y, z), (0, 0, *yaw) if yaw else (0, 0, 0))
        turn = np.kron(np.eye(2), base[:3, :3])
        np.testing.assert_allclose(arm.forward(q), base @ panda.forward(q), atol=1e-14)
        np.testing.assert_allclose(arm.jacobian(q), turn @ panda.jacobian(q), atol=1e-14)
        np.testing.assert_allclose(arm.skeleton(q)[:, 0], np.broadcast_to(base[:3, 3], (8, 3)), atol=1e-15)
        seen = panda.point_positions(q, ["panda_link0"]) @ base[:3, :3].T + base[:3, 3]
        np.testing.assert_allclose(arm.point_positions(q, ["panda_link0"]), seen, atol=1e-14)


def test_equal_names_of_two_robots_are_told_apart(pandas):
    """Joints of two robots with the same names get the side before theirs; both arms keep their own."""
    assert pandas.joint_names[:7] == tuple(f"left_{name}" for name in pandas.left.joint_names)
    assert pandas.joint_names[7:] == tuple(f"right_{name}" for name in pandas.right.joint_names)
    assert (pandas.dof, pandas.shared) == (14, ())
    assert pandas.left.joint_names == mp.load_arm("panda").joint_names


def test_a_shared_joint_counts_once_and_moves_both(crane):
    """The trunk's joints come first, once; a change of one moves both tips, a change of an arm's own joint only its."""
    assert (crane.shared, crane.dof, crane.trunk) == (("turn", "rise"), 10, 2)
    assert crane.joint_names == (*crane.left.joint_names, *crane.right.joint_names[2:])
    moved = np.any(crane.jacobian(crane.sample(16, 1)) != 0, axis=(0, 2))
    np.testing.assert_array_equal(moved[0], [True] * 6 + [False] * 4)
    np.testing.assert_array_equal(moved[1], [True] * 2 + [False] * 4 + [True] * 4)


def test_split_and_joined_undo_each_other(crane, pandas):
    """What is taken apart is put together again, bit for bit, and each arm's answers are its own."""
    for arms in (crane, pandas):
        q = arms.sample(6, 2).reshape(2, 3, -1)
        left, right = arms.split(q)
        np.testing.assert_array_equal(arms.joined(left, right), q)
        np.testing.assert_array_equal(arms.forward(q)[..., 1, :, :], arms.right.forward(right))
        np.testing.assert_array_equal(arms.manipulability(q)[..., 0, :, :], arms.left.manipulability(left))


def test_jacobians_of_the_pair_are_derivatives_of_its_poses(crane):
    """Central differences of both tips' positions in every joint of the pair."""
    q, h = crane.sample(8, 3), 1e-6
    for k, step in enumerate(h * np.eye(crane.dof)):
        change = (crane.forward(q + step) - crane.forward(q - step))[..., :3, 3] / (2 * h)
        np.testing.assert_allclose(crane.jacobian(q)[..., :3, k], change, atol=1e-8)


def test_joint_weights_of_the_pair_reach_its_arms(crane):
    """Each arm's ellipsoid is weighed with its own columns of the pair's weights."""
    q, weights = crane.sample(4, 4), np.linspace(0.5, 2.0, crane.dof)
    found = crane.manipulability(q, joint_weights=weights)
    for i, (arm, part, columns) in enumerate(zip(crane.each, crane.split(q), crane.columns, strict=True)):
        np.testing.assert_array_equal(found[:, i], arm.manipulability(part, joint_weights=weights[columns]))


def test_a_pair_is_narrowed_pickled_and_shown(crane):
    """Closer limits reach both arms; a copy of a pair answers alike."""
    narrow = crane.narrowed(0.5 * crane.lower, 0.5 * crane.upper)
    np.testing.assert_array_equal(narrow.right.upper, 0.5 * crane.right.upper)
    q = narrow.sample(4, 0)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(narrow)).jacobian(q), crane.jacobian(q))
    assert all(text in crane._repr_html_() for text in ("left_tip", "right_tip", "turn, rise"))
    with pytest.raises(InvalidInputError, match="lower must be 10 numbers"):
        crane.narrowed(np.zeros((2, 10)), crane.upper)
    assert repr(crane) == "Arms('crane', dof=10, frames=('left_tip', 'right_tip'), shared=['turn', 'rise'])"


@pytest.mark.parametrize(("robot", "options", "said"), [
    ("panda", {}, "is no pair: name two tips with frames="),
    ("panda", {"frames": ("panda_link8", "panda_hand")}, "must end two limbs; found both on one chain"),
    (("panda", "panda"), {}, "stand in one place; place them with bases="),
    ("panda", {"bases": [(0, 0, 0)]}, "bases must be two, left and right"),
    ("panda", {"bases": [(0, 0, 0), (0, 1)]}, r"bases: right must be x, y, z .* found \(2,\)"),
    ("panda", {"bases": [(0, 0, 0), 2 * np.eye(4)]}, "bases: right must be a rotation"),
    ("panda", {"bases": [(0, 0, 0), (0, 1e9, 0)]}, "bases: right must be 3 numbers in"),
    ("panda", {"bases": BASES, "lock": {"left_joint1": 0}}, "unknown joint 'left_joint1'.* nearest first"),
    ("panda", {"bases": BASES, "joints": ["left_panda_joint1"]}, "none of left_panda_joint1 moves the right arm"),
    ("panda", {"bases": BASES, "frames": ("panda_link8", "panda_lnk8")}, "unknown frame 'panda_lnk8'"),
    ("panda", {"bases": BASES, "frames": "panda_link8"}, "frames must be two, left and right"),
    ("myoarm", {}, "'myoarm' is a person"),
    (("panda",) * 3, {}, "robot must be two, left and right"),
    ("panda", {"bases": BASES, "lock": {"left_panda_joint1": 0.5, "panda_joint1": 0}}, "found 0.5 for the one, 0 for"),
])  # fmt: skip
def test_what_is_no_pair_is_told(robot, options, said):
    """Wrong robots, frames, bases and joints are named, with what is allowed."""
    with pytest.raises(InvalidInputError, match=said):
        mp.load_arms(robot, **options)


@pytest.mark.parametrize(("robot", "options", "said"), [
    ("panda", {}, "name two tips with --frames, or place two robots with --base-left and --base-right"),
    pytest.param("anymal", {}, "name the tips with --frames; they end at", marks=NEEDS_ROBOTS),
    (("panda", "panda"), {}, "place them with --base-left"),
    ("panda", {"bases": [(0, np.nan, 0), (0, 0, 0)]}, "--base-left must be finite"),
])  # fmt: skip
def test_who_types_a_command_is_told_its_options(robot, options, said):
    """On the command line the options of both arms are named, and none of one arm."""
    with on_the_command_line(), pytest.raises(InvalidInputError, match=said):
        mp.load_arms(robot, **options)


def test_a_pair_is_made_of_arms():
    """Names in place of arms are told."""
    with pytest.raises(InvalidInputError, match=r"left must be an arm, .* found str"):
        mp.bodies.Arms("panda", "ur5")


@pytest.mark.parametrize(("left", "right", "said"), [
    (limb("left"), limb("left"), "must end two limbs"),
    (limb("left").restricted(lock={"turn": 0.1}), limb("right"), "'turn' carries both .* 0.1 on the left alone"),
    (limb("left").restricted(lock={"turn": 0.1}), limb("right").restricted(lock={"turn": 0}), "found 0.1 on the left"),
    (limb("left", upper=np.ones(6)), limb("right"), "'turn' .* one range .* found limits -1.5 to 1 and -1.5 to 1.5"),
    (limb("left").restricted(base="trunk"), limb("right"), "must answer in one frame; found 'trunk' for left"),
])  # fmt: skip
def test_arms_that_claim_a_trunk_differently_are_no_pair(left, right, said):
    """What both arms share must move, be held and be limited alike."""
    with pytest.raises(InvalidInputError, match=said):
        mp.bodies.Arms(left, right)


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
