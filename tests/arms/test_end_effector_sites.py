"""The default end effector of MJCF arms: the site that MuJoCo Menagerie marks it with, where there is one."""

import mujoco
import numpy as np
import pytest

from maniport import load_arm
from maniport.arms.loaders import robot_limbs

FINGERS = (
    '<body name="right_finger" pos="0 .02 .05"><geom size=".01"/><joint type="slide" name="right"/></body>'
    '<body name="left_finger" pos="0 -.02 .05"><geom size=".01"/><joint type="slide" name="left"/></body>'
)
FLANGE, PINCH = '<site name="{}attachment_site" pos="0 0.045 0" quat="-1 1 0 0"/>', '<site name="{}" pos="0 0 .107"/>'


def mjcf(*ends, lamp=""):
    """Write arms with three hinges that end in a body of this content."""
    arms = "".join(
        f'<body name="base{i}" pos="{i} 0 0"><geom size=".1"/>{lamp}<body name="one{i}"><joint name="a{i}"/>'
        f'<geom size=".1"/><body name="two{i}" pos="0 .1 .3"><geom size=".1"/><joint name="b{i}" axis="0 1 0"/>'
        f'<body name="wrist{i}" pos="0 0 .3"><geom size=".1"/><joint name="c{i}" axis="1 0 0"/>{end}</body></body>'
        "</body></body>"
        for i, end in enumerate(ends)
    )
    return f'<mujoco model="arm"><default><joint range="-90 90"/></default><worldbody>{arms}</worldbody></mujoco>'


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        (FLANGE.format(""), "attachment_site"),
        (FLANGE.format("arm_"), "arm_attachment_site"),
        (FLANGE.format("arm/"), "arm/attachment_site"),
        (f'<body name="flange">{FLANGE.format("")}</body>', "attachment_site"),
        (PINCH.format("pinch_site"), "pinch_site"),
        (f'<body name="hand">{FLANGE.format("")}{PINCH.format("pinch_site")}{FINGERS}</body>', "pinch_site"),
        (f'<body name="hand">{PINCH.format("2f85/pinch")}{FINGERS}</body>', "2f85/pinch"),
        (f'{FLANGE.format("")}<body name="hand">{FINGERS}</body>', "attachment_site"),
        (f'<body name="hand">{FINGERS}</body>', "hand"),
        (f'<body name="hand">{PINCH.format("camera")}</body>', "hand"),
        (PINCH.format("a_pinch_site_of_nothing"), "wrist0"),
    ],
)
def test_the_site_is_the_end_effector(tmp_path, end, expected):
    """It is chosen by its name, at the pose that MuJoCo computes, and the joints are the arm's."""
    path = tmp_path / "arm.xml"
    path.write_text(mjcf(end, lamp='<site name="pinch"/>'))
    arm = load_arm(path)
    assert (arm.frame, arm.joint_names) == (expected, ("a0", "b0", "c0"))
    assert robot_limbs(str(path))[1].tip == expected
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q = [0.3, -0.5, 0.7]
    data.qpos[:3] = q
    mujoco.mj_kinematics(model, data)
    place = data.site(expected) if expected.endswith(("site", "pinch")) else data.body(expected)
    np.testing.assert_allclose(arm.forward(q)[:3, 3], place.xpos, atol=1e-9)
    np.testing.assert_allclose(arm.forward(q)[:3, :3], place.xmat.reshape(3, 3), atol=1e-9)
