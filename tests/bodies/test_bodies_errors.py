"""What wrong names, files and numbers get: an error that says what is wrong, where, and what is allowed."""

import numpy as np
import pytest

from maniport.bodies import load_arm
from maniport.bodies.arm import Arm
from maniport.bodies.human import myoarm, rhuman
from maniport.errors import FileFormatError, InvalidInputError, MissingPackageError, UnknownNameError

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


def test_missing_file_names_its_neighbours(urdf):
    """A file that is not there is answered with robot files beside it."""
    with pytest.raises(FileFormatError, match=r"cran\.urdf: there is no such file; there are 'crane\.urdf'"):
        load_arm(urdf.parent / "cran.urdf")
    with pytest.raises(FileFormatError, match=r"no such file, nor a folder '.*nowhere'"):
        load_arm(str(urdf.parent / "nowhere" / "crane.urdf"))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("r.urdf", "", "the file is empty"),
        ("r.urdf", ROBOT.format("")[:30], "not readable as XML, perhaps cut off: .*line 1"),
        ("r.urdf", "\x00\x01", "not readable as XML"),
        ("r.urdf", "<sdf/>", "neither a URDF .* nor an MJCF .*its root is <sdf>"),
        ("r.stl", "solid", r"suffix '\.stl' is not known; allowed are \.urdf, \.xml, \.mjcf"),
        ("r.urdf", '<robot name="r"/>', "holds no link"),
        ("r.urdf", '<robot><link name="a"/></robot>', "the <robot> has no name"),
        *(
            (
                "r.urdf",
                ROBOT.format(
                    JOINT.format(type="revolute", more=f'<limit lower="1" upper="{up}" effort="1" velocity="1"/>')
                ),
                f"joint 'j' has the limits 1 to {up}; the first must be below the second",
            )
            for up in (1, -1)
        ),
        (
            "r.xml",
            '<mujoco><worldbody><body childclass="rough"><joint/></body></worldbody></mujoco>',
            "<body> is of the class 'rough', which no <default> describes",
        ),
        ("r.urdf", ROBOT.format(""), "must have one root link; found 2: 'a', 'b'"),
        ("r.urdf", ROBOT.format(JOINT.format(type="fixed", more="")), "holds no movable joint"),
        (
            "r.urdf",
            ROBOT.format(JOINT.format(type="hinge", more="")),
            "joint 'j' has type 'hinge'; allowed are revolute",
        ),
        ("r.urdf", ROBOT.format(JOINT.format(type="revolute", more="")), "joint 'j' is revolute and has no <limit>"),
        ("r.urdf", ROBOT.format(JOINT.format(type="planar", more="")), "holds no movable joint"),
        (
            "r.urdf",
            ROBOT.format(JOINT.format(type="revolute", more=LIMIT).replace('"b"', '"c"')),
            "joint 'j' names 'c' as child link, which does not exist",
        ),
        ("r.urdf", ROBOT.format('<link name="a"/>'), "link 'a' appears 2 times"),
        (
            "r.urdf",
            ROBOT.format(JOINT.format(type="prismatic", more=LIMIT.replace("1", "0"))),
            "the slide 'j' has no limits; write them into the file, or leave the joint out",
        ),
        (
            "r.urdf",
            ROBOT.format(JOINT.format(type="revolute", more=LIMIT + '<mimic joint="k"/>')),
            "joint 'j' follows 'k' which is no joint",
        ),
        (
            "r.urdf",
            ROBOT.format(JOINT.format(type="revolute", more=LIMIT + '<mimic joint="j" multiplier="two"/>')),
            "a mimic or equality holds no number: .*'two'",
        ),
        ("r.xml", '<mujoco><include file="arm.xml"/></mujoco>', "arm.xml: there is no such file; .*r.xml includes it"),
        ("r.xml", "<mujoco><worldbody/></mujoco>", "holds no body"),
        (
            "r.xml",
            '<mujoco><worldbody><body name="a"/><body name="a"/></worldbody></mujoco>',
            "body 'a' appears 2 times",
        ),
        (
            "r.xml",
            '<mujoco><worldbody><body name="b"><geom size="1"/><joint name="j" type="slide"/></body></worldbody>'
            "</mujoco>",
            "the slide 'j' has no limits",
        ),
        (
            "r.xml",
            '<mujoco><worldbody><body name="a"><geom size="1"/><joint name="i"/></body>'
            '<body name="b"><geom size="1"/><joint name="j"/></body></worldbody></mujoco>',
            "several frames end a chain of 1 movable joints; .* 'a', 'b'",
        ),
        (
            "r.xml",
            '<mujoco><worldbody><body name="a"><geom size="1"/><joint name="i"/><body name="b"><geom size="1"/>'
            '<joint name="j"/></body></body></worldbody><equality><joint joint1="j" joint2="i" polycoef="0 1 2 0 0"/>'
            "</equality></mujoco>",
            "joint 'j' follows 'i' in a curve, not in proportion",
        ),
    ],
)
def test_unusable_files_are_named_with_their_fault(tmp_path, name, content, message):
    """Each fault of a file gets an error of maniport that names the file and the fault."""
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises((FileFormatError, InvalidInputError), match=message) as caught:
        load_arm(path)
    assert str(path) in str(caught.value)


def test_catalogue_names_say_what_they_need():
    """A name of robot_descriptions without that package says how to install it, and one unknown to it is unknown."""
    with pytest.raises(
        (MissingPackageError, UnknownNameError), match=r"robot 'no_such_description'.*robot_descriptions"
    ):
        load_arm("no_such_description")


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
        ({"rows": np.empty((0, 4))}, r"rows must have shape \(n, 4\)"),
        ({"lower": [0, 0, 0]}, r"lower must be one number or 2 numbers; found shape \(3,\)"),
        ({"lower": 1.0, "upper": [2.0, 0.5]}, "lower must lie below upper; found 1 and 0.5 for joint 'joint2'"),
        ({"joint_names": ["a"]}, "joint_names must have 2 entries, one for each row; found 1"),
        ({"joint_names": ["a", "a"]}, "joint_names must name each once"),
        ({"kinds": ["revolute", "ball"]}, r"unknown kinds\[1\] 'ball'"),
        ({"convention": "craig"}, "unknown convention 'craig'"),
        ({"base": np.eye(2)}, r"base must be a rotation.*found shape \(2, 2\)"),
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
