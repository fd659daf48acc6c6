"""The embedded arms against MuJoCo, the paper's checks and the Panda's URDF."""

import json
import os
import warnings
from pathlib import Path

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.arms.human import myoarm, rhuman

POINTS = ["shoulder", "elbow", "wrist", "hand"]
ZERO = np.zeros(7)
FORWARD, LEFT, UP = np.eye(3)


@pytest.fixture(scope="module")
def reference():
    """MuJoCo and its model of the right arm; may be absent only outside continuous integration."""
    if os.environ.get("CI"):
        import mujoco
        import myo_sim
    else:
        mujoco = pytest.importorskip("mujoco")
        myo_sim = pytest.importorskip("myo_sim")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, _ = myo_sim.load("myoarm_r")
    return mujoco, model


def couplings(mujoco, model, names) -> np.ndarray:
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
    mujoco, model = reference
    arm = myoarm()
    G = couplings(mujoco, model, arm.joint_names)
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
