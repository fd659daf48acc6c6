"""What wrong names, files and numbers get: an error that says what is wrong, where, and what is allowed."""

import numpy as np
import pytest

from maniport.arms import load_arm
from maniport.arms.arm import Arm
from maniport.arms.human import myoarm, rhuman
from maniport.errors import FileFormatError, InvalidInputError, UnknownNameError

JOINT = '<joint name="j" type="{type}"><parent link="a"/><child link="b"/>{more}</joint>'
ROBOT = '<robot name="r"><link name="a"/><link name="b"/>{}</robot>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def test_unknown_robot_lists_the_nearest_first():
    """A misspelt robot is answered with the robots there are."""
    with pytest.raises(UnknownNameError, match=r"unknown robot 'pnada'.*nearest first: 'panda', "):
        load_arm("pnada")
    with pytest.raises(UnknownNameError, match="nearest first: 'myoarm', "):
        load_arm("myo_arm")


def test_unknown_frame_lists_the_nearest_first(urdf):
    """A misspelt frame is answered with the frames there are, for embedded arms and files."""
    with pytest.raises(UnknownNameError, match=r"unknown frame 'panda_hnd' .*'panda'; .*first: 'panda_hand'"):
        load_arm("panda", frame="panda_hnd")
    with pytest.raises(UnknownNameError, match=r"unknown frame 'hok' in '.*crane\.urdf'; .*first: 'hook'"):
        load_arm(urdf, frame="hok")
    with pytest.raises(UnknownNameError, match=r"unknown frame 'ellbow' on the arm 'myoarm'; .*first: 'elbow'"):
        load_arm("myoarm").point_positions(np.zeros(7), ["shoulder", "ellbow"])


def test_joints_that_cannot_be_used_are_named(urdf):
    """Joints beyond the tip, joints that follow others, repeated names and bare strings are refused."""
    with pytest.raises(InvalidInputError, match="'panda_joint7' does not move the frame 'panda_link3'"):
        load_arm("panda", frame="panda_link3", joints=["panda_joint1", "panda_joint7"])
    with pytest.raises(InvalidInputError, match=r"'level' in .* cannot move by itself, it follows 'raise'"):
        load_arm(urdf, joints=["level"])
    with pytest.raises(InvalidInputError, match="joints must name each once; found more than once: panda_joint1"):
        load_arm("panda", joints=["panda_joint1", "panda_joint1"])
    for wrong in ("panda_joint1", [], 5):
        with pytest.raises(InvalidInputError, match="joints must be a sequence of names"):
            load_arm("panda", joints=wrong)


def jointed(kind, more=""):
    """A URDF of two links with one joint of a kind."""
    return ROBOT.format(JOINT.format(type=kind, more=more))


def world(text, more=""):
    """An MJCF with this in its world."""
    return f"<mujoco><worldbody>{text}</worldbody>{more}</mujoco>"


HINGE = '<body name="a"><geom size="1"/><joint name="i"/>{}</body>'
INNER = '<body name="b"><geom size="1"/><joint name="j"/></body>'
CURVE = '<equality><joint joint1="j" joint2="i" polycoef="0 1 2 0 0"/></equality>'
CLOSED = '<limit lower="1" upper="-1" effort="1" velocity="1"/>'
FAULTS = {
    "the file is empty": "",
    "neither a URDF .* nor an MJCF": "<sdf/>",
    "holds no link": '<robot name="r"/>',
    "'j' has the limits 1 to -1": jointed("revolute", CLOSED),
    "must have one root link; found 2: 'a', 'b'": ROBOT.format(""),
    "holds no movable joint": jointed("fixed"),
    "type 'hinge'; allowed are revolute": jointed("hinge"),
    "is revolute and has no <limit>": jointed("revolute"),
    "names 'c' as child link": jointed("revolute", LIMIT).replace('child link="b"', 'child link="c"'),
    "the slide 'j' has no limits": jointed("prismatic", LIMIT.replace("1", "0")),
    "follows 'k' which is no joint": jointed("revolute", LIMIT + '<mimic joint="k"/>'),
    "of the class 'rough', which no <default>": world('<body childclass="rough"><joint/></body>'),
    "holds no body": world(""),
    "several frames end a chain of 1 .* 'a', 'b'": world(HINGE.format("") + INNER),
    "'j' follows 'i' in a curve": world(HINGE.format(INNER), CURVE),
}


@pytest.mark.parametrize("message", FAULTS)
def test_unusable_files_are_named_with_their_fault(tmp_path, message):
    """Each fault of a file gets an error of maniport that names the file and the fault."""
    content = FAULTS[message]
    path = tmp_path / ("r.xml" if content.startswith("<mujoco") else "r.urdf")
    path.write_text(content)
    with pytest.raises((FileFormatError, InvalidInputError), match=message) as caught:
        load_arm(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("build", [myoarm, rhuman])
@pytest.mark.parametrize("length", [0.0, -0.3, 29.0, np.nan, "long", [0.3, 0.3]])
def test_implausible_segment_lengths_are_refused(build, length):
    """A segment is longer than nothing and shorter than a metre; centimetres and nan are caught."""
    with pytest.raises(InvalidInputError, match=r"forearm \[m\] must be"):
        build(forearm=length)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rows": [[0, 0, 1]]}, r"rows must have shape \(n, 4\).*found shape \(1, 3\)"),
        ({"lower": [0, 0, 0]}, r"lower must be one number or 2 numbers; found shape \(3,\)"),
        ({"lower": 1.0, "upper": [2.0, 0.5]}, "lower of .joint2. must be below upper"),
        ({"joint_names": ["a", "a"]}, "joint_names must name each once"),
        ({"kinds": ["revolute", "ball"]}, r"unknown kinds\[1\] 'ball'"),
        ({"base": 2 * np.eye(3)}, "base must be a rotation"),
        ({"velocity_limits": [1.0, 0.0]}, "velocity_limits must be one number or 2 numbers above 0; found 0"),
    ],
)
def test_wrong_tables_are_refused(arguments, message):
    """Each wrong argument of a Denavit-Hartenberg arm is named."""
    with pytest.raises(InvalidInputError, match=message):
        Arm.from_dh("planar", **{"rows": [[0, 0, 1, 0], [0, 0, 1, 0]]} | arguments)


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
@pytest.mark.parametrize(("axis", "place"), [("0 0 0", "0 0 1"), ("0 1e-320 0", "0 0 1"), ("0 1 0", "1e300 0 0")])
def test_an_axis_of_no_length_and_a_place_out_of_the_world_are_refused(tmp_path, suffix, axis, place):
    """They would make nan of every ellipsoid, or infinities."""
    more = f'<origin xyz="{place}"/><axis xyz="{axis}"/>{LIMIT}'
    body = f'<body name="b" pos="{place}"><joint name="j" axis="{axis}" range="-1 1"/><geom size="0.1"/></body>'
    file = tmp_path / f"robot.{suffix}"
    urdf = ROBOT.format(JOINT.format(type="revolute", more=more))
    file.write_text(
        urdf if suffix == "urdf" else f'<mujoco><worldbody><body name="a">{body}</body></worldbody></mujoco>'
    )
    with pytest.raises(
        ValueError, match=r"joint 'j' must (have an axis of finite length|be placed by)|<body> needs pos"
    ):
        load_arm(file, frame="b")
