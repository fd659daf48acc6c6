import json
import warnings
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.arms import Arm, load_arm
from maniport.arms.chain import PRISMATIC, Shape
from maniport.arms.human import myoarm, rhuman
from maniport.arms.restriction import mirrored

ENDS = ("shoulder", "elbow", "wrist", "hand")
FORWARD, LEFT, UP = np.eye(3)


def test_myoarm_equals_mujoco():
    """Hand pose and both parts of the Jacobian agree with MuJoCo's right arm over 200 random poses, to 1e-9."""
    myo_sim = pytest.importorskip("myo_sim")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, _ = myo_sim.load("myoarm_r")
    # from its equality constraints
    arm = myoarm()
    coupling = np.zeros((model.nv, 7))
    for j, name in enumerate(arm.joint_names):
        coupling[model.jnt_dofadr[model.joint(f"{name}_r").id], j] = 1.0
    for i in range(model.neq):
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            follower, leader = (
                model.jnt_dofadr[k] for k in (model.eq_obj1id[i], model.eq_obj2id[i])
            )
            coupling[follower] = model.eq_data[i][1] * coupling[leader]
    q = arm.sample(200, random_state=0, sequence="uniform")
    data = mujoco.MjData(model)
    jacobian = np.zeros((6, model.nv))
    root = data.body("myoarm_r_root")
    hand = data.body("thirdmc_r")
    to_trunk = np.array(
        [[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]
    )  # x forward, y up, z right → x forward, y left, z up
    worst = 0.0
    for row, pose, expected in zip(q, arm.forward(q), arm.jacobian(q), strict=True):
        data.qpos[:] = coupling @ row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], hand.id)
        turn = to_trunk @ root.xmat.reshape(3, 3).T
        gaps = (
            pose[:3, 3] - turn @ (hand.xpos - root.xpos),
            pose[:3, :3] - turn @ hand.xmat.reshape(3, 3),
            expected - (turn @ (jacobian @ coupling).reshape(2, 3, 7)).reshape(6, 7),
        )
        worst = max(worst, *(float(np.abs(gap).max()) for gap in gaps))
    assert worst < 1e-9


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
    assert_allclose(arm.forward(q)[:3, 3], hand, atol=1e-12)


@pytest.mark.parametrize("build", [myoarm, rhuman])
def test_human_arms_share_one_trunk_frame(build):
    arm = build()
    hanging, raised = np.radians(
        [
            [0] * 7,
            [90.0 if name in ("elv_angle", "shoulder_elv") else 0.0 for name in arm.joint_names],
        ]
    )
    for q, direction in ((hanging, -UP), (raised, FORWARD)):
        shoulder, *_, hand = arm.point_positions(q, ENDS)
        assert (hand - shoulder) @ direction > 0.98 * np.linalg.norm(hand - shoulder)
    axes = {"elv_angle": UP, "shoulder_elv": -FORWARD, "shoulder_rot": UP, "elbow_flexion": -LEFT}
    for name, axis in axes.items():
        assert arm.axis_direction(hanging, name) @ axis > 0.99
    turns = (  # of the hand's path, by a joint, from a pose
        ({"elbow_flexion": 90}, "shoulder_rot", LEFT),
        ({}, "flexion", LEFT),
        ({"pro_sup": 60}, "flexion", -FORWARD),
    )
    for pose, name, direction in turns:
        q = np.radians([pose.get(joint, 0.0) for joint in arm.joint_names])
        assert arm.jacobian(q)[:3, arm.joint_names.index(name)] @ direction > 0.01


@pytest.mark.parametrize(("name", "to_thumb"), [("myoarm", 1), ("rhuman", -1)])
def test_limits_are_ranges_of_motion_of_people(name, to_thumb):
    """Means of the AAOS, of Boone and Azen (1979) and of Macedo and Magee (2009) [°] are within, by at most 5°."""
    arm = load_arm(name)
    ranges = dict(zip(arm.joint_names, np.degrees([arm.lower, arm.upper]).T, strict=True))
    ranges["deviation"] = np.sort(to_thumb * ranges["deviation"])
    means = {
        "elbow_flexion": ([0.0], [150, 143, 149]),
        "pro_sup": ([80, 82, 96], [80, 76, 92]),
        "deviation": ([30, 36, 41], [20, 22, 18]),
        "flexion": ([70, 75, 86], [80, 76, 93]),
        "shoulder_elv": ([0.0], [180.0]),
    }
    for joint, (lower, upper) in means.items():
        assert 0.0 <= -max(lower) - ranges[joint][0] + 1e-9 < 5.0
        assert 0.0 <= ranges[joint][1] - max(upper) + 1e-9 < 5.0
    assert -ranges["shoulder_rot"][0] >= 108  # lateral rotation
    assert_allclose(arm.effort_limits, load_arm("myoarm").effort_limits)


@pytest.mark.parametrize(("name", "to_thumb"), [("myoarm", 1), ("rhuman", -1)])
def test_deviation_bends_the_wrist_to_the_thumb(name, to_thumb):
    """Of a hanging arm the thumb points forward."""
    arm = load_arm(name)
    q = np.zeros((2, arm.dof))
    q[1, arm.joint_names.index("deviation")] = to_thumb * np.radians(20.0)
    hanging, bent = arm.point_positions(q, ["hand"])[:, 0]
    assert (bent - hanging) @ FORWARD > 0.01


def test_panda_equals_its_urdf():
    golden = json.loads((Path(__file__).parent / "panda_golden.json").read_text())
    panda = load_arm("panda", frame="panda_link8")
    tcp = load_arm("panda")
    for case in golden["cases"]:
        assert_allclose(panda.forward(case["q"]), case["flange"], atol=1e-9)
        assert_allclose(panda.jacobian(case["q"]), case["jacobian"], atol=1e-9)
        assert_allclose(tcp.forward(case["q"]), case["hand_tcp"], atol=1e-9)
    for limits, key in (
        (panda.lower, "lower"),
        (panda.upper, "upper"),
        (panda.velocity_limits, "velocity"),
    ):
        assert_array_equal(limits, golden[key])


S = np.diag([1.0, -1.0, 1.0])


@pytest.mark.parametrize("build", [myoarm, rhuman])
def test_the_weight_of_a_person_is_not_considered(build):
    arm = build(0.3, 0.25)
    q = arm.sample(20, 0)
    expected = np.tile(arm.effort_limits, (20, 1))
    assert_array_equal(arm.remaining_torques(q).torques, expected)


@pytest.mark.parametrize("name", ["myoarm", "rhuman"])
def test_equal_angles_are_mirrored_configurations(name):
    right = load_arm(name)
    left = load_arm(name, side="left")
    q = right.sample(64, random_state=0)
    assert_array_equal(left.sample(64, random_state=0), q)
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    assert_allclose(left.forward(q), mirror @ right.forward(q) @ mirror, atol=1e-14)
    assert_allclose(left.point_positions(q, ENDS), right.point_positions(q, ENDS) @ S, atol=1e-14)
    for part in ("translation", "rotation"):
        assert_allclose(
            left.manipulability(q, part=part),
            S @ right.manipulability(q, part=part) @ S,
            atol=1e-13,
        )
    assert_allclose(
        left.axis_direction(q, "pro_sup"), -right.axis_direction(q, "pro_sup") @ S, atol=1e-14
    )
    assert_allclose(left.skeleton(q), right.skeleton(q) @ S, atol=1e-14)


def test_the_mirror_image_of_the_mirror_image_is_the_arm():
    """Names, sides, slides and shapes turn, too."""
    mesh = (
        np.array([[0.0, 0.1, 0.2], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        np.array([[0, 1, 2]], np.int32),
    )
    chain = load_arm("rhuman").chain
    joints = [
        replace(joint, kind=PRISMATIC) if i == 2 else joint for i, joint in enumerate(chain.joints)
    ]
    chain = replace(chain, joints=tuple(joints), shapes=lambda links: [Shape("elbow", mesh)])
    left = mirrored(chain)
    again = mirrored(mirrored(chain))
    assert [(c.name, c.side) for c in (left, again)] == [
        ("rhuman_left", "left"),
        ("rhuman", "right"),
    ]
    q = chain.lower + 0.3 * (chain.upper - chain.lower)
    corners = []
    assert_array_equal(Arm(again).forward(q), Arm(chain).forward(q))
    assert_allclose(Arm(left).forward(q)[:3, 3], S @ Arm(chain).forward(q)[:3, 3], atol=1e-14)
    for arm in (Arm(left), Arm(chain)):
        (surface,) = arm.surfaces()
        corners.append(
            arm.link_poses(q)[surface.joint, :3, :3] @ surface.points[surface.triangles[0]].T
        )
    assert_allclose(np.sort(corners[0], axis=1), np.sort(S @ corners[1], axis=1), atol=1e-14)
