"""Human arms and the Panda against their references; mirror images."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from maniport.arms import Arm, load_arm
from maniport.arms.chain import PRISMATIC, Shape
from maniport.arms.human import myoarm, rhuman
from maniport.arms.restriction import mirrored

POINTS = ["shoulder", "elbow", "wrist", "hand"]
ZERO = np.zeros(7)
FORWARD, LEFT, UP = np.eye(3)


@pytest.fixture(scope="module")
def reference():
    """MuJoCo's model of the right arm."""
    myo_sim = pytest.importorskip("myo_sim")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, _ = myo_sim.load("myoarm_r")
    return model


def couplings(model, names) -> np.ndarray:
    """How the joint positions of the model follow the seven coordinates, from its equality constraints."""
    G = np.zeros((model.nv, len(names)))
    for j, name in enumerate(names):
        G[model.jnt_dofadr[model.joint(f"{name}_r").id], j] = 1.0
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            follower, leader = (model.jnt_dofadr[k] for k in (model.eq_obj1id[i], model.eq_obj2id[i]))
            G[follower] = model.eq_data[i][1] * G[leader]
    return G


def test_myoarm_equals_mujoco(reference):
    """Hand pose and both parts of the Jacobian agree with MuJoCo over 1000 random poses, to 1e-9."""
    model = reference
    arm = myoarm()
    G = couplings(model, arm.joint_names)
    q = arm.sample(1000, random_state=0, sequence="uniform")
    poses, jacobians = arm.forward(q), arm.jacobian(q)
    data = mujoco.MjData(model)
    root, hand = model.body("myoarm_r_root").id, model.body("thirdmc_r").id
    to_trunk = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # x forward, y up, z right → x forward, y left, z up
    worst = np.zeros(4)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for i in range(len(q)):
        data.qpos[:] = G @ q[i]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacBody(model, data, linear, angular, hand)
        turn = to_trunk @ data.xmat[root].reshape(3, 3).T
        position = turn @ (data.xpos[hand] - data.xpos[root])
        rotation = turn @ data.xmat[hand].reshape(3, 3)
        gaps = (
            poses[i, :3, 3] - position,
            poses[i, :3, :3] - rotation,
            jacobians[i, :3] - turn @ linear @ G,
            jacobians[i, 3:] - turn @ angular @ G,
        )
        worst = np.maximum(worst, [np.abs(gap).max() for gap in gaps])
    assert worst.max() < 1e-9, worst


@pytest.mark.parametrize(
    ("joints", "hand"),
    [
        ({}, (0, 0, -0.6315)),
        ({"shoulder_elv": 90}, (0, -0.6315, 0)),
        ({"elv_angle": 90, "shoulder_elv": 90}, (0.6315, 0, 0)),
        ({"elbow_flexion": 90}, (0.3295, 0, -0.302)),
    ],
)
def test_rhuman_equals_the_paper(joints, hand):
    """The hand is where the published table puts it (base turned by −90° about z)."""
    arm = rhuman()
    q = np.radians([joints.get(name, 0.0) for name in arm.joint_names])
    np.testing.assert_allclose(arm.forward(q)[:3, 3], hand, atol=1e-12)


@pytest.mark.parametrize("build", [myoarm, rhuman])
def test_human_arms_share_one_trunk_frame(build):
    """In both models the arm hangs down, rises to the right or forward, and turns about the same axes."""
    arm = build()

    def direction(**degrees):
        q = np.radians([degrees.get(name, 0.0) for name in arm.joint_names])
        shoulder, *_, hand = arm.point_positions(q, POINTS)
        return (hand - shoulder) / np.linalg.norm(hand - shoulder)

    assert direction() @ -UP > 0.99
    assert direction(shoulder_elv=90) @ -LEFT > 0.98
    assert direction(shoulder_elv=90, elv_angle=90) @ FORWARD > 0.98
    assert direction(elbow_flexion=90) @ FORWARD > 0.6
    assert (direction(elbow_flexion=90, shoulder_rot=30) - direction(elbow_flexion=90)) @ LEFT > 0.2
    assert (direction(flexion=30) - direction()) @ LEFT > 0.02
    assert (direction(flexion=30, pro_sup=60) - direction(pro_sup=60)) @ -FORWARD > 0.01
    for name, axis in (("elv_angle", UP), ("shoulder_elv", -FORWARD), ("shoulder_rot", UP), ("elbow_flexion", -LEFT)):
        assert arm.axis_direction(ZERO, name) @ axis > 0.99
        assert abs(np.linalg.norm(arm.axis_direction(ZERO, name)) - 1) < 1e-12


def test_panda_equals_its_urdf():
    """Flange, hand point, Jacobian and limits agree with the golden numbers, whose file says how they were made."""
    golden = json.loads((Path(__file__).parent / "panda_golden.json").read_text())
    panda, tcp = load_arm("panda", frame="panda_link8"), load_arm("panda")
    for case in golden["cases"]:
        np.testing.assert_allclose(panda.forward(case["q"]), case["flange"], atol=1e-9)
        np.testing.assert_allclose(panda.jacobian(case["q"]), case["jacobian"], atol=1e-9)
        np.testing.assert_allclose(tcp.forward(case["q"]), case["hand_tcp"], atol=1e-9)
    np.testing.assert_array_equal(panda.lower, golden["lower"])
    np.testing.assert_array_equal(panda.upper, golden["upper"])
    np.testing.assert_array_equal(panda.velocity_limits, golden["velocity"])


S = np.diag([1.0, -1.0, 1.0])
ENDS = ("shoulder", "elbow", "wrist", "hand")


@pytest.mark.parametrize("name", ["myoarm", "rhuman"])
def test_equal_angles_are_mirrored_postures(name):
    """Poses are S T S, ellipsoids of turning and moving S M S, joint axes −S a, at the same joint angles."""
    right, left = load_arm(name), load_arm(name, side="left")
    q = right.sample(64, random_state=0)
    np.testing.assert_array_equal(left.sample(64, random_state=0), q)
    one, other = right.forward(q), left.forward(q)
    np.testing.assert_allclose(other[:, :3, :3], S @ one[:, :3, :3] @ S, atol=1e-14)
    np.testing.assert_allclose(other[:, :3, 3], one[:, :3, 3] @ S, atol=1e-14)
    np.testing.assert_allclose(left.point_positions(q, ENDS), right.point_positions(q, ENDS) @ S, atol=1e-14)
    for part in ("translation", "rotation"):
        np.testing.assert_allclose(
            left.manipulability(q, part=part), S @ right.manipulability(q, part=part) @ S, atol=1e-13
        )
    np.testing.assert_allclose(left.axis_direction(q, "pro_sup"), -right.axis_direction(q, "pro_sup") @ S, atol=1e-14)
    np.testing.assert_allclose(left.skeleton(q), right.skeleton(q) @ S, atol=1e-14)


def test_the_mirror_image_of_the_mirror_image_is_the_arm():
    """Mirroring twice gives the same chain, bit for bit, its name and side included; slides and shapes turn, too."""
    mesh = (np.array([[0.0, 0.1, 0.2], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]], np.int32))
    chain = load_arm("rhuman").chain
    slide = replace(chain.joints[2], kind=PRISMATIC)
    chain = replace(chain, joints=(*chain.joints[:2], slide, *chain.joints[3:]), shapes=_shapes_of(mesh))
    left, again = mirrored(chain), mirrored(mirrored(chain))
    assert (chain.name, left.name, again.name) == ("rhuman", "rhuman_left", "rhuman")
    assert (chain.side, left.side, again.side) == ("right", "left", "right")
    for one, other in zip(chain.joints, again.joints, strict=True):
        np.testing.assert_array_equal(one.placement, other.placement)
        np.testing.assert_array_equal(one.axis, other.axis)
    q = chain.lower + 0.3 * (chain.upper - chain.lower)
    np.testing.assert_allclose(Arm(left).forward(q)[:3, 3], S @ Arm(chain).forward(q)[:3, 3], atol=1e-14)
    (of_left,), (of_right,) = Arm(left).surfaces(None), Arm(chain).surfaces(None)
    world = [arm.link_poses(q)[piece.joint] for arm, piece in ((Arm(left), of_left), (Arm(chain), of_right))]
    placed = [pose[:3, :3] @ piece.points.T for pose, piece in zip(world, (of_left, of_right), strict=True)]
    np.testing.assert_allclose(np.sort(placed[0], axis=1), np.sort(S @ placed[1], axis=1), atol=1e-14)
    volume = [np.linalg.det(piece.points[piece.triangles[0]]) for piece in (of_left, of_right)]
    assert volume[0] == pytest.approx(volume[1])  # triangles are counter-clockwise from outside in both


def _shapes_of(mesh):
    return lambda links: [Shape("elbow", mesh)]
