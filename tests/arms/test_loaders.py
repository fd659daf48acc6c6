"""Robots from files: URDF, xacro, catalogs, formats of users, and errors of faulty files."""

import sys

import mujoco
import numpy as np
import pytest

from maniport.arms import load_arm, myoarm, rhuman
from maniport.arms.loaders import robot_limbs
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


@pytest.fixture
def write(tmp_path):
    def write(text: str, name: str = "robot.urdf"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_urdf_joints_become_coordinates(urdf):
    arm = load_arm(urdf)
    assert arm.name == "crane"
    assert arm.joint_names == ("turn", "raise", "travel", "spin")
    assert arm.frame == "hook"
    np.testing.assert_allclose(arm.lower, [-np.pi, -1, 0.1, -np.pi])
    np.testing.assert_allclose(arm.upper, [np.pi, 1.5, 0.6, np.pi])
    np.testing.assert_array_equal(arm.velocity_limits, [np.inf, 2, 0.5, np.inf])
    np.testing.assert_array_equal(arm.chain.effort_limits, [np.inf, 1, 1, 1])


def test_mjcf_equals_mujoco(mjcf):
    """Two hinges on one body, a slide, a coupled joint and rest angles: poses and limits agree with MuJoCo."""
    model = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(model)
    arm = load_arm(mjcf, frame="tool")
    assert arm.joint_names == ("yaw", "pitch", "roll", "push")
    np.testing.assert_allclose(
        np.stack([arm.lower, arm.upper], axis=1), model.jnt_range[:4], atol=1e-12
    )
    for q in arm.sample(20, random_state=0):
        data.qpos[:] = [*q, model.qpos0[4] + 0.1 + 0.5 * (q[2] - model.qpos0[2])]
        mujoco.mj_kinematics(model, data)
        pose = arm.forward(q)
        np.testing.assert_allclose(pose[:3, 3], data.site("tool").xpos, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3], data.site("tool").xmat.reshape(3, 3), atol=1e-12)


def test_catalog_robots_are_loaded_by_name(monkeypatch, urdf):
    package = urdf.parent / "robot_descriptions"
    package.mkdir()
    for name, text in {
        "__init__": "",
        "_descriptions": "DESCRIPTIONS = {'crane_description': 0, 'ladder_description': 0}",
        "crane_description": f"URDF_PATH = {str(urdf)!r}",
        "offline_description": "raise OSError('no network')",
    }.items():
        (package / f"{name}.py").write_text(f"{text}\n")
    monkeypatch.syspath_prepend(str(urdf.parent))
    before = {
        name: sys.modules.pop(name)
        for name in list(sys.modules)
        if name.startswith("robot_descriptions")
    }
    try:
        assert load_arm("crane_description", frame="boom").joint_names == ("turn", "raise")
        with pytest.raises(UnknownNameError, match=r"'cran_description'.*'crane_description'"):
            load_arm("cran_description")
        with pytest.raises(UnknownNameError, match=r"'offline_description'.*network"):
            load_arm("offline_description")
    finally:
        for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
            del sys.modules[name]
        sys.modules.update(before)


SEGMENTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="segment" params="n parent length">
  <link name="link${n}"/><joint name="j${n}" type="revolute"><parent link="${parent}"/><child link="link${n}"/>
  <origin xyz="0 0 ${length}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</xacro:macro></robot>"""


def test_xacro_is_its_urdf(write, capfd):
    """Macros out of an included file, arguments and sums give the arm that one would write by hand, and no chatter."""
    pytest.importorskip("xacrodoc")
    write(SEGMENTS, "segments.xacro")
    header = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:arg name="reach" default="0.1"/>'
    text = (
        f'{header}<xacro:include filename="segments.xacro"/><link name="base"/><xacro:segment n="1" parent="base" '
        'length="$(arg reach)"/><xacro:segment n="2" parent="link1" length="${2 * 0.15}"/></robot>'
    )
    arm = load_arm(write(text, "arm.urdf.xacro"))
    assert (arm.joint_names, arm.frame) == (("j1", "j2"), "link2")
    np.testing.assert_allclose(arm.forward([0.0, 0.0])[:3, 3], [0, 0, 0.4], atol=1e-12)
    with pytest.raises(FileFormatError, match=r"broken\.xacro.*no\.xacro"):
        load_arm(write(f'{header}<xacro:include filename="no.xacro"/></robot>', "broken.xacro"))
    with pytest.raises(
        FileFormatError,
        match=r"'nowhere'.*ROS_PACKAGE_PATH",
    ):
        load_arm(
            write(
                f'{header}<xacro:include filename="$(find nowhere)/a.xacro"/></robot>',
                "broken.xacro",
            )
        )
    load_arm(
        write(text.replace("<link", '<xacro:property name="len" value="1"/><link'), "shadow.xacro")
    )
    assert capfd.readouterr() == ("", "")
    with pytest.raises(FileFormatError, match=r"robot\.urdf.*\.xacro"):
        load_arm(write(text))


JOINT = '<joint name="j" type="{type}"><parent link="a"/><child link="b"/>{more}</joint>'
ROBOT = '<robot name="r"><link name="a"/><link name="b"/>{}</robot>'


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name_or_path": "pnada"}, r"unknown robot 'pnada'.*nearest first: 'panda', "),
        ({"name_or_path": "myo_arm"}, "nearest first: 'myoarm', "),
        ({"frame": "panda_hnd"}, r"unknown frame 'panda_hnd' .*'panda'; .*first: 'panda_hand'"),
        (
            {"name_or_path": "crane", "frame": "hok"},
            r"unknown frame 'hok' in '.*crane\.urdf'; .*first: 'hook'",
        ),
        (
            {"name_or_path": "crane", "joints": ["level"]},
            "'level' in .* cannot move by itself, it follows 'raise'",
        ),
        (
            {"frame": "panda_link3", "joints": ["panda_joint7"]},
            "'panda_joint7' does not move the frame 'panda_link3'",
        ),
        ({"joints": ["panda_joint1"] * 2}, "joints"),
        ({"joints": "panda_joint1"}, "joints"),
        ({"joints": []}, "joints"),
        ({"joints": 5}, "joints"),
        (
            {"lock": {"panda_joint4": 0.5}},
            r"lock: 'panda_joint4' \[rad\] must be a number in \[-3.0718, -0.0698\]",
        ),
        ({"lock": {"panda_joint9": 0.5}}, "unknown joint 'panda_joint9' .*'panda_joint1'"),
        (
            {"lock": {"panda_joint5": 0}, "frame": "panda_link3"},
            "lock: 'panda_joint5' does not move the fr",
        ),
        (
            {"lock": {"panda_joint1": 0}, "frame": "panda_link1"},
            "no movable joint .* lock contains all",
        ),
        ({"lock": ["panda_joint4"]}, "lock"),
        (
            {"lock": {"panda_joint4": -1}, "joints": ["panda_joint4"]},
            "in joints or in lock, not in both; found",
        ),
        (
            {"lock": {"panda_joint1": 0}, "base": "panda_link2"},
            "does not move the frame .* seen from 'panda_link2'",
        ),
        ({"base": "panda_hand"}, "no movable joint lies between the base and the frame"),
        ({"base": "panda_hand", "frame": "panda_link2"}, "unknown base 'panda_hand'"),
    ],
)
def test_wrong_arguments_are_named(urdf, options, message):
    options = {"name_or_path": "panda"} | options
    if options["name_or_path"] == "crane":
        options["name_or_path"] = urdf
    with pytest.raises(InvalidInputError, match=message):
        load_arm(**options)


def jointed(kind, more=""):
    return ROBOT.format(JOINT.format(type=kind, more=more))


def world(text, more=""):
    return f"<mujoco><worldbody>{text}</worldbody>{more}</mujoco>"


HINGE = '<body name="a"><geom size="1"/><joint name="i"/>{}</body>'
INNER = '<body name="b"><geom size="1"/><joint name="j"/></body>'
CURVE = '<equality><joint joint1="j" joint2="i" polycoef="0 1 2 0 0"/></equality>'
CLOSED = '<limit lower="1" upper="-1" effort="1" velocity="1"/>'
FAULTS = {
    "the file is empty": "",
    "neither a URDF .* nor an MJCF": "<sdf/>",
    "has no link": '<robot name="r"/>',
    "'j' has the limits 1 to -1": jointed("revolute", CLOSED),
    "must have one root link; found 2: 'a', 'b'": ROBOT.format(""),
    "has no movable joint": jointed("fixed"),
    "type 'hinge'; allowed are revolute": jointed("hinge"),
    "is revolute and has no <limit>": jointed("revolute"),
    "'i' has type 'Hinge'; allowed are hinge": world(
        HINGE.replace("/>{", ' type="Hinge"/>{').format("")
    ),
    "names 'c' as child link": jointed("revolute", LIMIT).replace(
        'child link="b"', 'child link="c"'
    ),
    "prismatic joint 'j' has no limits": jointed("prismatic", LIMIT.replace("1", "0")),
    "follows 'k' which is no joint": jointed("revolute", LIMIT + '<mimic joint="k"/>'),
    "of the class 'rough', which no <default>": world('<body childclass="rough"><joint/></body>'),
    "has no body": world(""),
    "several frames end a chain of 1 .* 'a', 'b'": world(HINGE.format("") + INNER),
    "'j' follows 'i' nonlinearly": world(HINGE.format(INNER), CURVE),
}


@pytest.mark.parametrize("message", FAULTS)
def test_unusable_files_are_named_with_their_fault(tmp_path, message):
    content = FAULTS[message]
    path = tmp_path / ("r.xml" if content.startswith("<mujoco") else "r.urdf")
    path.write_text(content)
    with pytest.raises((FileFormatError, InvalidInputError), match=message) as caught:
        load_arm(path)
    assert str(path) in str(caught.value)


def test_limbs_of_a_file_without_movable_joints_are_refused(write):
    for path in (
        write(jointed("fixed")),
        write(world(HINGE.replace("/>{", ' type="ball"/>{').format("")), "r.xml"),
    ):
        with pytest.raises(InvalidInputError, match="movable joint"):
            robot_limbs(path)


@pytest.mark.parametrize("build", [myoarm, rhuman])
@pytest.mark.parametrize("length", [0.0, -0.3, 29.0, np.nan, "long", [0.3, 0.3]])
def test_implausible_segment_lengths_are_refused(build, length):
    with pytest.raises(InvalidInputError, match=r"^forearm"):
        build(forearm=length)


@pytest.mark.parametrize(
    ("axis", "place"), [("0 0 0", "0 0 1"), ("0 1e-320 0", "0 0 1"), ("0 1 0", "1e300 0 0")]
)
def test_axes_of_no_length_and_places_out_of_the_world_are_refused(write, axis, place):
    body = f'<body name="b" pos="{place}"><joint name="j" axis="{axis}" range="-1 1"/><geom size="0.1"/></body>'
    urdf = write(jointed("revolute", f'<origin xyz="{place}"/><axis xyz="{axis}"/>{LIMIT}'))
    for path in (urdf, write(world(f'<body name="a">{body}</body>'), "r.xml")):
        with pytest.raises(ValueError, match=r"'j'.*(must|origin)|'b'.*needs pos"):
            load_arm(path, frame="b")


def test_a_part_is_the_whole_arm_with_coordinates_held():
    whole = load_arm("panda")
    part = load_arm("panda", base="panda_link3")
    q = whole.sample(4, random_state=1)
    before = load_arm("panda", frame="panda_link3").forward(q[:, :3])
    np.testing.assert_allclose(before @ part.forward(q[:, 3:]), whole.forward(q), atol=1e-12)
    np.testing.assert_array_equal(part.velocity_limits, whole.velocity_limits[3:])
    assert part.frames[0] == "panda_link3"
    with pytest.raises(UnknownNameError, match="base 'panda_link2'"):
        part.restricted(base="panda_link2")
    some = load_arm("panda", joints=["panda_joint1", "panda_joint2"], lock={"panda_joint4": -1.5})
    q = np.array([0.3, -0.2, 0.0, -1.5, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(some.forward(q[:2]), whole.forward(q), atol=1e-12)
    assert some.chain.locked == pytest.approx(dict(zip(whole.joint_names[2:], q[2:], strict=True)))
    np.testing.assert_array_equal(
        some.restricted(frame="panda_link3").chain.frames["panda_link0"].placement, np.eye(4)
    )
