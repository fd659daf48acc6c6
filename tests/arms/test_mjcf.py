"""MJCF: included files, several trees, end-effector sites; hostile includes of MJCF and xacro."""

import os
import re

import mujoco
import numpy as np
import pytest
from robot_packages import farthest

from maniport.arms import load_arm
from maniport.arms.loaders import robot_limbs
from maniport.errors import FileFormatError

HEAD = '<mujoco model="arm"><compiler angle="degree"/>'
MATERIAL = '<default><default class="fine"><joint range="-20 30"/></default></default>'
ARM = (
    '<body name="base" pos="0 0.2 -0.5" euler="0 0 90"><geom size="0.1"/><body name="mid" pos="1 0 0">'
    '<geom size="0.1"/>'
    '<body name="upper" pos="0 2 0" euler="10 0 20"><joint name="i" class="fine" axis="0 1 0"/><geom size="0.1"/>'
    '<body name="lower" pos="0 0 1"><joint name="j" range="-10 90" axis="1 0 0"/><geom size="0.1"/>'
    '<site name="tip" pos="0 0 1"/></body></body></body></body>'
)
TABLE = '<body name="table" pos="2 0 0"><freejoint/><geom size="0.1"/></body>'
WHOLE = f"{HEAD}{MATERIAL}<worldbody>{ARM}</worldbody></mujoco>"


@pytest.fixture
def write(tmp_path):
    def write(**texts: str):
        for name, text in texts.items():
            path = tmp_path / f"{name.replace('__', '/')}.xml"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        return tmp_path / f"{next(iter(texts))}.xml"

    return write


def test_a_first_body_that_cannot_move_and_further_trees_are_mujocos(write):
    path = write(robot=f"{HEAD}{MATERIAL}<worldbody>{TABLE}{ARM}</worldbody></mujoco>")
    assert (
        farthest(mujoco, mujoco.MjModel.from_xml_path(str(path)), load_arm(path, frame="tip"))
        < 1e-12
    )
    assert load_arm(path).dof == 2


def test_what_has_no_name_is_mujocos(write):
    """Bodies and joints without names move as MuJoCo moves them, within their ranges; a name that is taken stays."""
    bare = re.sub(r' name="(base|mid|upper|i|j)"', "", ARM).replace(
        'name="lower"', 'name="world_body2"'
    )
    path = write(robot=f"{HEAD}{MATERIAL}<worldbody>{TABLE}{bare}</worldbody></mujoco>")
    arm = load_arm(path, frame="tip")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    np.testing.assert_allclose(np.stack([arm.lower, arm.upper], axis=1), model.jnt_range[1:])
    for q in arm.sample(4, random_state=0):
        data.qpos[7:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(arm.forward(q)[:3, 3], data.site("tip").xpos, atol=1e-12)
    assert len(set(arm.joint_names)) == 2
    assert len(arm.surfaces()) == 3


def test_included_files_are_as_if_written_in_their_place(write):
    whole = load_arm(write(whole=WHOLE), frame="tip")
    parts = write(
        main='<mujoco model="arm"><include file="parts/head.xml"/><worldbody><include file="parts/arm.xml"/>'
        "</worldbody></mujoco>",
        parts__head='<mujoco><compiler angle="degree"/><include file="parts/classes.xml"/></mujoco>',
        parts__classes=f"<mujocoinclude>{MATERIAL}</mujocoinclude>",
        parts__arm=f"<mujocoinclude>{ARM}</mujocoinclude>",
    )
    split = load_arm(parts, frame="tip")
    q = whole.sample(4, random_state=0)
    np.testing.assert_array_equal(split.jacobian(q), whole.jacobian(q))
    np.testing.assert_array_equal([split.lower, split.upper], [whole.lower, whole.upper])
    assert [s.joint for s in split.surfaces()] == [s.joint for s in whole.surfaces()] == [0, 1, 2]


JOINTS = (
    '<joint name="i" class="strong"/>',
    '<joint name="j" actuatorfrcrange="-30 50"/>',
    '<joint name="k"/>',
)
ACTUATORS = {
    "": (10, 30, np.inf),
    '<position joint="i" kp="9" forcerange="-4 5"/>': (4, 30, np.inf),
    '<position joint="j" kp="9"/><motor joint="k" gear="3" ctrlrange="-7 6"/>': (10, 30, 18),
    '<motor class="geared" joint="k"/><general joint="k" gainprm="4" gear="2" ctrlrange="-1 1"/>': (
        10,
        30,
        28,
    ),
    '<motor joint="k" ctrlrange="-7 6" ctrllimited="false"/><motor joint="i" gear="0.1" forcerange="-9 9"/>': (
        0.9,
        30,
        np.inf,
    ),
}


@pytest.mark.parametrize("actuators", ACTUATORS)
def test_torque_limits_are_those_of_joints_and_actuators(write, actuators):
    classes = (
        '<default><default class="strong"><joint actuatorfrcrange="-11 10"/></default>'
        '<default class="geared"><general gear="5"/><motor ctrlrange="-4 4"/></default></default>'
    )
    bodies = (
        "".join(f'<body name="{k}">{joint}<geom size="0.1"/>' for k, joint in enumerate(JOINTS))
        + 3 * "</body>"
    )
    text = (
        f"{HEAD}{classes}<worldbody>{bodies}</worldbody><actuator>{actuators}</actuator></mujoco>"
    )
    limits = load_arm(write(robot=text)).chain.effort_limits
    np.testing.assert_allclose(limits, ACTUATORS[actuators])
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(text))
    torques = []
    for data.ctrl in (-1e3, 1e3):
        mujoco.mj_forward(model, data)
        torques.append(np.abs(data.qfrc_actuator))
    driven = np.isfinite(limits) & (torques[0] > 0)
    np.testing.assert_allclose(np.min(torques, axis=0)[driven], limits[driven])


@pytest.mark.parametrize(
    ("include", "message"),
    [
        ("../secret.xml", r"includes '\.\./secret\.xml', which lies outside of its folder"),
        ("/etc/passwd", r"includes '/etc/passwd', which lies outside"),
        ("main.xml", r"includes 'main\.xml' more than once, or in a cycle"),
        ("arm.xnl", r"suffix '\.xnl' is not known"),
        ("", "an <include> names no file"),
        ("other.xml", r"other\.xml: there is no such file"),
    ],
)
def test_includes_that_may_not_be_are_named(write, include, message):
    path = write(main=f'<mujoco><worldbody>{ARM}<include file="{include}"/></worldbody></mujoco>')
    (path.parent / "arm.xnl").write_text("<mujoco/>")
    with pytest.raises(FileFormatError, match=message):
        load_arm(path)


FINGERS = (
    '<body name="right_finger" pos="0 .02 .05"><geom size=".01"/><joint type="slide" name="right"/></body>'
    '<body name="left_finger" pos="0 -.02 .05"><geom size=".01"/><joint type="slide" name="left"/></body>'
)
FLANGE = '<site name="{}attachment_site" pos="0 0.045 0" quat="-1 1 0 0"/>'
PINCH = '<site name="{}" pos="0 0 .107"/>'


ARM_TO = """<mujoco model="arm"><default><joint range="-90 90"/></default><worldbody><body name="base"><geom size=".1"/>
  <site name="pinch"/><body name="one"><joint name="a"/><geom size=".1"/><body name="two" pos="0 .1 .3">
  <geom size=".1"/><joint name="b" axis="0 1 0"/><body name="wrist" pos="0 0 .3">
  <geom size=".1"/><joint name="c" axis="1 0 0"/>{}</body></body></body></body></worldbody></mujoco>"""
"""An arm with three hinges that ends in a body of this content."""


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        (FLANGE.format(""), "attachment_site"),
        (FLANGE.format("arm_"), "arm_attachment_site"),
        (FLANGE.format("arm/"), "arm/attachment_site"),
        (f'<body name="flange">{FLANGE.format("")}</body>', "attachment_site"),
        (PINCH.format("pinch_site"), "pinch_site"),
        (
            f'<body name="hand">{FLANGE.format("")}{PINCH.format("pinch_site")}{FINGERS}</body>',
            "pinch_site",
        ),
        (f'<body name="hand">{PINCH.format("2f85/pinch")}{FINGERS}</body>', "2f85/pinch"),
        (f'{FLANGE.format("")}<body name="hand">{FINGERS}</body>', "attachment_site"),
        (f'<body name="hand">{FINGERS}</body>', "hand"),
        (f'<body name="hand">{PINCH.format("camera")}</body>', "hand"),
        (PINCH.format("a_pinch_site_of_nothing"), "wrist"),
    ],
)
def test_the_site_is_the_end_effector(tmp_path, end, expected):
    path = tmp_path / "arm.xml"
    path.write_text(ARM_TO.format(end))
    arm = load_arm(path)
    assert (arm.frame, arm.joint_names) == (expected, ("a", "b", "c"))
    assert robot_limbs(str(path))[1].frame == expected
    assert farthest(mujoco, mujoco.MjModel.from_xml_path(str(path)), arm) < 1e-9


def test_bodies_in_bodies_count_over_all_files(tmp_path):
    inner = ""
    for k in range(40):
        content = "<body>" * 100 + inner + "</body>" * 100
        (tmp_path / f"{k}.xml").write_text(f"<mujocoinclude>{content}</mujocoinclude>")
        inner = f'<include file="{k}.xml"/>'
    path = tmp_path / "a.xml"
    path.write_text(
        f'<mujoco><worldbody><body name="a"><joint name="j"/>{inner}</body></worldbody></mujoco>'
    )
    with pytest.raises(FileFormatError, match="levels of elements"):
        load_arm(path)


XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><link name="base"/>{}</robot>'
DOUBLING = "".join(
    f'<xacro:macro name="m{k}" params=""><xacro:m{k + 1}/><xacro:m{k + 1}/></xacro:macro>'
    for k in range(40)
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            '<xacro:include filename="/dev/zero"/>',
            "/dev/zero: this is a pipe, a socket or a device",
        ),
        ('<xacro:include filename="pipe.xacro"/>', "this is a pipe, a socket or a device"),
        (
            "<link name=\"${load_yaml('/dev/zero')}\"/>",
            "/dev/zero: this is a pipe, a socket or a device",
        ),
        (DOUBLING + '<xacro:macro name="m40" params=""/><xacro:m0/>', "it takes more than 2 s"),
        ("<link name=\"${'x' * 10**10}\"/>", r"when evaluating expression ''x' \* 10\*\*10'"),
    ],
    ids=["device", "pipe", "settings", "doubling macros", "memory"],
)
def test_xacro_files_that_never_end(tmp_path, monkeypatch, content, message):
    pytest.importorskip("xacrodoc")
    monkeypatch.setattr(
        "maniport.arms.loaders.xacro_files.LONGEST_XACRO", 2.0 if "2 s" in message else 30.0
    )
    os.mkfifo(tmp_path / "pipe.xacro")
    (tmp_path / "a.xacro").write_text(XACRO.format(content))
    with pytest.raises(FileFormatError, match=rf"a\.xacro.*{message}"):
        load_arm(tmp_path / "a.xacro")
