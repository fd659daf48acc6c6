"""MJCF files that include others, have several trees, or a first body that cannot move."""

import re

import numpy as np
import pytest

from maniport.arms import load_arm
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
    """Write files by their names and give the path of the first."""

    def write(**texts: str):
        for name, text in texts.items():
            path = tmp_path / f"{name.replace('__', '/')}.xml"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        return tmp_path / f"{next(iter(texts))}.xml"

    return write


def test_a_first_body_that_cannot_move_and_further_trees_are_mujocos(write):
    """Where the base stands counts, and a floating thing before the arm hides nothing of it: poses are MuJoCo's."""
    mujoco = pytest.importorskip("mujoco")
    path = write(robot=f"{HEAD}{MATERIAL}<worldbody>{TABLE}{ARM}</worldbody></mujoco>")
    arm, model = load_arm(path, frame="tip"), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for q in arm.sample(4, random_state=0):
        data.joint("i").qpos, data.joint("j").qpos = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(arm.forward(q)[:3, 3], data.site("tip").xpos, atol=1e-12)
        np.testing.assert_allclose(arm.forward(q)[:3, :3], data.site("tip").xmat.reshape(3, 3), atol=1e-12)
    assert load_arm(path).dof == 2


def test_what_has_no_name_is_mujocos(write):
    """Bodies and joints without names move as MuJoCo moves them, within their ranges; a name that is taken stays."""
    mujoco = pytest.importorskip("mujoco")
    bare = re.sub(r' name="(base|mid|upper|i|j)"', "", ARM).replace('name="lower"', 'name="world_body2"')
    path = write(robot=f"{HEAD}{MATERIAL}<worldbody>{TABLE}{bare}</worldbody></mujoco>")
    arm, model = load_arm(path, frame="tip"), mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    np.testing.assert_allclose(np.stack([arm.lower, arm.upper], axis=1), model.jnt_range[1:])
    for q in arm.sample(4, random_state=0):
        data.qpos[7:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(arm.forward(q)[:3, 3], data.site("tip").xpos, atol=1e-12)
    assert len(set(arm.joint_names)) == 2
    assert len(arm.surfaces()) == 3


def test_included_files_are_as_if_written_in_their_place(write):
    """Classes, bodies and compilers out of other files, and files within those, give the same arm and shapes."""
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


@pytest.mark.parametrize(
    ("include", "message"),
    [
        ("../secret.xml", r"includes '\.\./secret\.xml', which lies outside of its folder"),
        ("/etc/passwd", r"includes '/etc/passwd', which lies outside"),
        ("main.xml", r"includes 'main\.xml' more than once, or in a circle"),
        ("arm.xnl", r"suffix '\.xnl' is not known"),
        ("", "an <include> names no file"),
        ("other.xml", r"other\.xml: there is no such file"),
    ],
)
def test_includes_that_may_not_be_are_named(write, include, message):
    """Files outside of the model's folder, missing ones and circles are refused before they are read."""
    path = write(main=f'<mujoco><worldbody>{ARM}<include file="{include}"/></worldbody></mujoco>')
    (path.parent / "arm.xnl").write_text("<mujoco/>")
    with pytest.raises(FileFormatError, match=message):
        load_arm(path)
