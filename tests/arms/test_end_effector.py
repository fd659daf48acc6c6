"""The default end effector: joints of grippers, tool frames of hands, arms before legs."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from maniport.arms import load_arm, load_arms
from maniport.arms.loaders import robot_limbs
from maniport.cli import app
from maniport.errors import InvalidInputError, on_the_command_line

CASES = Path(__file__).parent / "cases"
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 0 1")


def joint(name, parent, child, kind="revolute", xyz="0 0 0.1", axis="0 1 0", more=""):
    return (
        f'<link name="{child}"/><joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        f"{more}</joint>"
    )


def fixed(parent, child, xyz="0 0 0.05"):
    return joint(f"{child}_fix", parent, child, "fixed", xyz)


def arm(count=6):
    """Links l0, l1, … in a row, with joints j1, j2, … between them."""
    steps = [joint(f"j{i + 1}", f"l{i}", f"l{i + 1}", axis=AXES[i]) for i in range(count)]
    return '<link name="l0"/>' + "".join(steps)


def link_of(name):
    return f'<link name="{name}"/>'


def fingers(parent, *names, kind="prismatic"):
    return "".join(joint(f"{name}_joint", parent, name, kind) for name in names)


@pytest.fixture
def loaded(tmp_path):
    def loaded(*parts):
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
        robot = load_arm(path)
        assert robot_limbs(path)[1].frame == robot.frame
        return robot

    return loaded


def test_a_slide_that_carries_two_fingers_is_the_grippers():
    robot = load_arm(CASES / "grip" / "slide.xml")
    assert robot.frame == "hand_body"
    assert robot.joint_names == ("j1", "j2", "j3", "j4", "j5", "wrist_roll")


def test_a_single_jaw_is_known_by_the_name_of_its_body():
    robot = load_arm(CASES / "grip" / "jaw.xml")
    assert (robot.frame, robot.joint_names[-1], robot.dof) == ("wrist_roll_body", "wr1", 6)


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("gripper", "x"),
        ("gripper_slide", "x"),
        ("joint_gripper_open", "x"),
        ("GripperJoint1", "x"),
        ("right_finger_close", "x"),
        ("jaw_1", "x"),
        ("Jaw", "x"),
        ("claw_motor", "x"),
        ("thumb_base", "x"),
        ("left_knuckle_joint", "x"),
        ("arm_fngr_x", "x"),
        ("j7", "moving_jaw_link"),
        ("j7", "finger_left"),
        ("j7", "upperClaw"),
        ("f1x", "arm_link_fngr"),
        ("rot7", "thumb"),
    ],
)
def test_a_joint_of_a_gripper_is_known_by_any_word(loaded, name, body):
    robot = loaded(arm(), joint(name, "l6", body))
    assert (robot.frame, robot.dof) == ("l6", 6)


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("wrist_3", "l7"),
        ("gripper_yaw", "GripperYawLink"),
        ("gripper_wrist_roll", "l7"),
        ("j7", "gripper"),
        ("wrist_roll", "gripper"),
        ("hand_roll", "hand"),
        ("j7", "hand"),
    ],
)
def test_a_joint_that_turns_the_gripper_is_the_arms(loaded, name, body):
    robot = loaded(arm(), joint(name, "l6", body))
    assert (robot.frame, robot.dof) == (body, 7)


def test_a_body_called_gripper_opens_where_it_slides_or_is_on_a_hand(loaded):
    assert loaded(arm(), joint("j7", "l6", "gripper", "prismatic")).dof == 6
    robot = loaded(arm(), fixed("l6", "gripper_base"), joint("j7", "gripper_base", "gripper_mover"))
    assert (robot.frame, robot.dof) == ("gripper_base", 6)


def test_a_prefix_that_all_joints_share_is_no_gripper(loaded):
    steps = (joint(f"gripper_arm_{i}", f"l{i}", f"l{i + 1}", axis=AXES[i]) for i in range(6))
    assert loaded('<link name="l0"/>', *steps).dof == 6


@pytest.mark.parametrize(
    "prefix", ["hand_link_", "finger_link_", "claw", "gripper_", "jaw_", "handy"]
)
def test_a_prefix_that_all_bodies_share_is_no_gripper(loaded, prefix):
    steps = [
        joint(f"j{i}", f"{prefix}{i}", f"{prefix}{i + 1}", axis=AXES[i - 1]) for i in range(1, 7)
    ]
    robot = (link_of(f"{prefix}1"), *steps)
    assert loaded(*robot).dof == 6
    jaw = joint("j8", f"{prefix}7", "clamp_plate", "prismatic")
    assert (loaded(*robot, jaw).frame, loaded(*robot, jaw).dof) == (f"{prefix}7", 6)


def test_the_last_body_on_a_fixed_hand_opens_it(loaded):
    """The name of the joint does not matter, unless it is that of a wrist."""
    for carrier, moved in (("hand_base", "hand_upper"), ("palm", "hand"), ("tool_hand", "palm_2")):
        robot = loaded(arm(), fixed("l6", carrier), joint("j7", carrier, moved))
        assert (robot.frame, robot.dof) == (carrier, 6)
        wrist = loaded(arm(), fixed("l6", carrier), joint("wrist_2", carrier, moved))
        assert (wrist.frame, wrist.dof) == (moved, 7)


@pytest.mark.parametrize(
    ("carrier", "moved"),
    [
        ("hand_mount", "hand"),
        ("l6x", "hand"),
        ("hand_adapter", "palm"),
        ("hand_base", "hand_roll_link"),
    ],
)
def test_a_hand_that_is_mounted_on_a_wrist_is_the_arms(loaded, carrier, moved):
    robot = loaded(arm(), fixed("l6", carrier), joint("j7", carrier, moved))
    assert (robot.frame, robot.dof) == (moved, 7)
    robot = loaded(arm(), joint("j7", "l6", "hand_1"), joint("j8", "hand_1", "hand_2"))
    assert (robot.frame, robot.dof) == ("hand_2", 8)


def test_a_leader_of_two_branches_is_the_grippers(loaded):
    """The joint that the fingers on it follow opens the gripper, without any name."""
    mimic = '<mimic joint="m" multiplier="{}"/>'
    robot = loaded(
        arm(),
        joint("m", "l6", "x", "prismatic"),
        joint("a", "x", "a", more=mimic.format(9)),
        joint("b", "x", "b", more=mimic.format(-9)),
    )
    assert (robot.frame, robot.dof) == ("l6", 6)


def test_joints_of_a_gripper_that_are_asked_for_move(tmp_path):
    path = CASES / "grip" / "jaw.xml"
    robot = load_arm(path, joints=["j1", "f1x"])
    assert (robot.frame, robot.joint_names) == ("arm_link_fngr", ("j1", "f1x"))


def test_the_tool_frame_of_a_hand_is_the_end_effector():
    robot = load_arm(CASES / "tcp" / "arm.urdf")
    assert robot.frame == "fx_hand_tcp"
    frames = robot.chain.frames
    step = np.linalg.inv(frames["fx_hand"].placement) @ frames["fx_hand_tcp"].placement
    np.testing.assert_allclose(step[:3, 3], [0, 0, 0.1034], atol=1e-12)
    assert load_arm(CASES / "tcp" / "arm.urdf", frame="fx_hand").frame == "fx_hand"


@pytest.mark.parametrize(
    "name",
    [
        "fr3_hand_tcp",
        "link_tcp",
        "tcp",
        "left_tcp_link",
        "gripper_frame_link",
        "gen3_end_effector_link",
        "tool0",
        "l_gripper_tool_frame",
        "tool_center_point",
        "ee_link",
        "ee_gripper_link",
        "robot_eef",
        "link_grasp_center",
        "gripper_grasping_frame",
        "endEffectorLink",
        "ToolFrame",
        "gripper_center",
    ],
)
def test_tool_frames_are_known_by_their_names(loaded, name):
    hand = (arm(), fixed("l6", "hand"), fixed("hand", "hand_camera"))
    assert loaded(*hand, fixed("hand", name), fingers("hand", "f1", "f2")).frame == name
    assert loaded(arm(), fixed("l6", "camera_link"), fixed("l6", name)).frame == name


@pytest.mark.parametrize(
    "name",
    [
        "tool_camera_link",
        "ee_sensor",
        "tcp_marker",
        "toolbox",
        "tool_changer_link",
        "hand_cover",
        "imu",
        "ee_x",
    ],
)
def test_other_frames_of_a_hand_are_not(loaded, name):
    hand = (arm(), fixed("l6", "hand"), fixed("hand", name))
    assert loaded(*hand, fingers("hand", "f1", "f2")).frame == "hand"


SENSORS = (
    "wrist_camera_link",
    "wrist_camera_color_optical_frame",
    "d435i_link",
    "realsense_link",
    "cam0",
    "ft_sensor",
    "force_torque",
    "imu_link",
    "aruco_marker",
)


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("carrier", ["tool0", "flange", "plate"])
def test_a_sensor_at_the_end_is_not_the_end_effector(loaded, name, carrier):
    robot = loaded(arm(), fixed("l6", carrier), fixed(carrier, name), fixed(name, f"{name}_frame"))
    assert robot.frame == carrier
    assert loaded(arm(), fixed("l6", name)).frame == "l6"


def test_a_tool_on_a_sensor_is_the_end_effector(loaded):
    sensor = fixed("l6", "tool0", "0 0 0") + fixed("tool0", "ft_sensor")
    assert loaded(arm(), sensor, fixed("ft_sensor", "plate")).frame == "plate"
    assert loaded(arm(), sensor, fixed("ft_sensor", "wrist_ft_tool_link")).frame == (
        "wrist_ft_tool_link"
    )


def test_a_tool_frame_with_bodies_on_it_or_on_a_finger_is_not_the_end(loaded):
    robot = loaded(arm(), fixed("l6", "tool0"), fixed("tool0", "hand"), fingers("hand", "f1", "f2"))
    assert robot.frame == "hand"
    robot = loaded(
        arm(), fixed("l6", "hand"), fingers("hand", "f1", "f2"), fixed("f1", "finger_tcp")
    )
    assert robot.frame == "hand"


def test_an_old_tool_frame_on_the_flange_is_not_that_of_the_gripper(loaded):
    """A frame beside the gripper counts only where it lies beyond it."""
    hand = (arm(), fixed("l6", "hand", "0 0 0.05"), fingers("hand", "f1", "f2"))
    assert loaded(*hand, fixed("l6", "ee_link", "0 0 0.05")).frame == "hand"
    assert loaded(*hand, fixed("l6", "tool_frame", "0 0 0.17")).frame == "tool_frame"


def test_of_several_tool_frames_the_best_name_counts(loaded):
    parts = [fixed("l6", name) for name in ("flange", "ee_link", "tool0", "torch_tcp")]
    assert [loaded(arm(), *parts[: k + 1]).frame for k in range(4)] == [
        "flange",
        "ee_link",
        "tool0",
        "torch_tcp",
    ]


GRIPPERS = (
    *("suctionCup", "vacuum_gripper", "vacuum_gripper_tip", "epick", "schunk_body", "robotiq_base"),
    *("hand_e_link", "soft_gripper", "softgripper", "left_rubber_hand", "right_suction_cup"),
)


@pytest.mark.parametrize("name", GRIPPERS)
def test_a_gripper_without_joints_counts_more_than_the_bare_flange(loaded, name):
    flange = (arm(), fixed("l6", "tool0", "0 0 0"), fixed("l6", "flange", "0 0 0"))
    assert loaded(*flange).frame == "tool0"
    assert loaded(*flange, fixed("l6", name)).frame == name
    assert loaded(*flange, fixed("l6", name), fixed(name, "my_tcp")).frame == "my_tcp"


@pytest.mark.parametrize("name", ["gripper_mount", "hand_camera", "gripper_cover", "handle"])
def test_parts_beside_a_tool_frame_are_no_grippers(loaded, name):
    assert loaded(arm(), fixed("l6", "tool0"), fixed("l6", name)).frame == "tool0"


HINGES = "".join(
    f'<body name="l{i}" pos="0 0 .1"><joint name="j{i}" axis="{AXES[i]}" range="-9 9"/><geom size=".01"/>'
    for i in range(4)
)
JAW = '<body name="b" pos="0 0 .1"><joint name="gripper" range="-9 9"/><geom size=".01"/></body>'


@pytest.mark.parametrize(
    ("tail", "frame"),
    [
        ('<site name="gripperframe" pos="0 0 .1"/>' + JAW, "gripperframe"),
        ('<site name="ee" pos="0 0 .1"/>', "ee"),
        ('<site name="link_tcp" pos="0 0 .1"/>' + JAW, "link_tcp"),
        ('<site name="ee"/>' + JAW, "l3"),
        ('<body name="tcp" pos="0 0 .1"/>' + JAW, "tcp"),
        ('<site name="baseframe"/>' + JAW, "l3"),
        (JAW, "l3"),
    ],
)
def test_tool_frames_of_an_mjcf_are_bodies_or_sites(tmp_path, tail, frame):
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><worldbody>{HINGES}{tail}{4 * '</body>'}</worldbody></mujoco>")
    robot = load_arm(path)
    assert (robot.frame, robot.dof) == (frame, 4)


FLANGE = '<site name="attachment_site" pos="0 0 .05"/>'
TOOL = '<site name="ee" pos="0 0 .05"/>'


@pytest.mark.parametrize(
    ("flange", "own", "frame"),
    [
        (FLANGE, "", "suction_gripper"),
        (TOOL, "", "suction_gripper"),
        ('<body name="tool0" pos="0 0 .05"/>', "", "suction_gripper"),
        ("", "", "suction_gripper"),
        (FLANGE, '<site name="cup_tcp" pos="0 0 .1"/>', "cup_tcp"),
        (TOOL, '<site name="cup_tcp" pos="0 0 .1"/>', "cup_tcp"),
        (TOOL, '<body name="cup_tcp" pos="0 0 .1"/>', "cup_tcp"),
        ("", FLANGE, "attachment_site"),
        (TOOL, FLANGE, "attachment_site"),
        (FLANGE, '<site name="pinch_site" pos="0 0 .1"/>', "pinch_site"),
        ('<site name="wrist_tcp" pos="0 0 .2"/>', "", "wrist_tcp"),
    ],
)
def test_a_gripper_without_joints_counts_more_than_sites_of_the_flange(
    tmp_path, flange, own, frame
):
    """Frames on the gripper, or beyond it, count more than the gripper itself."""
    gripper = f'<body name="suction_gripper" pos="0 0 .1"><geom size=".01"/>{own}</body>'
    path = tmp_path / "arm.xml"
    path.write_text(
        f"<mujoco><worldbody>{HINGES}{flange}{gripper}{4 * '</body>'}</worldbody></mujoco>"
    )
    robot = load_arm(path)
    assert (robot.frame, robot.dof) == (frame, 4)


@pytest.mark.parametrize("flange", [FLANGE, TOOL])
def test_parts_beside_a_site_for_tools_are_no_grippers(tmp_path, flange):
    mount = '<body name="gripper_mount" pos="0 0 .1"><geom size=".01"/></body>'
    path = tmp_path / "arm.xml"
    path.write_text(
        f"<mujoco><worldbody>{HINGES}{flange}{mount}{4 * '</body>'}</worldbody></mujoco>"
    )
    assert load_arm(path).frame in ("attachment_site", "ee")


def test_the_error_of_a_humanoid_offers_its_hands_and_they_work():
    path = CASES / "legs" / "humanoid.urdf"
    with pytest.raises(InvalidInputError, match="maniport info") as caught:
        load_arm(path)
    offered = [
        name for name in ("left_hand_link", "right_hand_link") if repr(name) in str(caught.value)
    ]
    assert len(offered) == 2
    assert "foot" not in str(caught.value)
    assert all(load_arm(path, frame=name).dof == 4 for name in offered)
    limbs, default = robot_limbs(path)
    assert default is None
    assert {limb.frame for limb in limbs[:2]} == set(offered)
    assert load_arms(path).dof == 8
    with on_the_command_line():
        result = CliRunner().invoke(app, ["info", str(path)])
    assert result.exit_code == 0
    assert "left_hand_link" in result.output


def limb(base, words, count, end):
    names = [base, *(f"{words}_{k}" for k in range(1, count)), end]
    return "".join(joint(f"{words}_j{k}", names[k], names[k + 1]) for k in range(count))


TORSO = '<link name="base"/>' + joint("waist", "base", "torso")


@pytest.mark.parametrize(
    ("legs", "arms", "hands"),
    [
        (
            ("l_leg", "r_leg", "l_sole", "r_sole"),
            ("LArm", "RArm", "LHand", "RHand"),
            ("LHand", "RHand"),
        ),
        (
            ("hip_l", "hip_r", "ankle_l", "ankle_r"),
            ("shoulder_l", "shoulder_r", "e1", "e2"),
            ("e1", "e2"),
        ),
        (
            ("leg1", "leg2", "foot1", "foot2"),
            ("a_left", "a_right", "x_left", "x_right"),
            ("x_left", "x_right"),
        ),
    ],
)
@pytest.mark.parametrize("length", [3, 4, 6])
def test_legs_are_no_arms(tmp_path, legs, arms, hands, length):
    path = tmp_path / "humanoid.urdf"
    parts = [limb("base", legs[k], 6, legs[k + 2]) for k in range(2)]
    parts += [limb("torso", arms[k], length, arms[k + 2]) for k in range(2)]
    path.write_text(
        f'<robot name="r">{TORSO}{"".join(parts)}{limb("torso", "head", 2, "eyes")}</robot>'
    )
    with pytest.raises(InvalidInputError, match="maniport info") as caught:
        load_arm(path)
    assert all(repr(name) in str(caught.value) for name in hands)
    assert not any(repr(name) in str(caught.value) for name in (*legs[2:], "eyes"))
    assert {found.frame for found in robot_limbs(path)[0][:2]} == set(hands)
    assert [found.fork for found in robot_limbs(path)[0][:2]] == ["torso"] * 2


def test_one_arm_on_legs_is_the_default_and_legs_alone_are_limbs(tmp_path):
    path = tmp_path / "robot.urdf"
    legs = "".join(limb("base", f"{k}_leg", 6, f"{k}_foot") for k in range(4))
    path.write_text(
        f'<robot name="r"><link name="base"/>{legs}{limb("base", "arm", 4, "hand")}</robot>'
    )
    assert load_arm(path).frame == "hand"
    path.write_text(
        f'<robot name="r"><link name="base"/>{legs}{limb("base", "head", 2, "eye")}</robot>'
    )
    with pytest.raises(InvalidInputError, match="'0_foot'"):
        load_arm(path)
    assert load_arm(path, frame="2_foot").dof == 6


@pytest.mark.parametrize(
    ("file", "frame", "reason"),
    [
        ("tcp/arm.urdf", "fx_hand_tcp", "tool frame of 'fx_hand'"),
        ("grip/slide.xml", "hand_body", "carries the gripper"),
        ("safety/arm.urdf", "l6", "outermost"),
    ],
)
def test_info_says_which_frame_is_taken_and_why(file, frame, reason):
    result = CliRunner().invoke(app, ["info", str(CASES / file)])
    line = next(line for line in result.output.splitlines() if "End effector" in line)
    assert frame in line
    assert reason in line
    result = CliRunner().invoke(app, ["info", str(CASES / file), "--json"])
    assert json.loads(result.output)["frame"] == frame
