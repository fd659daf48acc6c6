"""xacro: packages, arguments, and the remedies that messages name; URDF with elements of xacro."""

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from maniport.arms import load_arm, load_arms
from maniport.arms.collisions import Collisions
from maniport.arms.loaders import robot_limbs
from maniport.arms.loaders.package_folders import find_package
from maniport.cli import app
from maniport.errors import (
    FileFormatError,
    InvalidInputError,
    UnknownNameError,
    on_the_command_line,
)
from maniport.pipeline import load_single_arm
from maniport.pipeline.config import Config

pytest.importorskip("xacrodoc")
CASES = Path(__file__).parent / "cases"
ARGUMENTS = CASES / "args" / "arm.urdf.xacro"
NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><axis xyz="0 1 0"/>'
    f"{LIMIT}</joint>"
)
ARM = f'<link name="base"/><link name="tip"/>{JOINT.format("j", "base", "tip")}'
PART = f"<robot {NAMESPACE}>{ARM}</robot>"


def run(*words):
    with on_the_command_line():
        return CliRunner().invoke(app, [str(word) for word in words])


def printed(result):
    """Output of a command, or the message of its error."""
    return f"{result.output} {result.exception or ''}"


def package(folder, name=None):
    """Make a package with a file `part.xacro`."""
    (folder / "urdf").mkdir(parents=True)
    (folder / "urdf" / "part.xacro").write_text(PART)
    (folder / "package.xml").write_text(f"<package><name>{name or folder.name}</name></package>")
    return folder


def main_file(path, package_name="parts"):
    """Write a file that includes `part.xacro` of a package."""
    path.parent.mkdir(parents=True, exist_ok=True)
    include = f'<xacro:include filename="$(find {package_name})/urdf/part.xacro"/>'
    path.write_text(f'<robot name="r" {NAMESPACE}>{include}</robot>')
    return path


def test_a_package_beside_the_package_of_the_file_is_found():
    path = CASES / "sibling" / "acme_arm_support" / "urdf" / "arm.xacro"
    for folders in ((), [CASES / "sibling"]):
        arm = load_arm(path, mesh_folders=folders)
        assert (arm.joint_names, arm.frame) == (("j1", "j2", "j3", "j4", "j5", "j6"), "l6")
    assert run("info", path).exit_code == 0


PLACES = {
    "sibling": "ws/parts",
    "own package": "ws/robot",
    "renamed sibling": "ws/parts-main",
    "above with a marker": "parts",
    "folder of the user": "elsewhere/parts",
    "below a folder of the user": "elsewhere/repository/common/parts",
    "renamed below a folder of the user": "elsewhere/repository/parts-2",
    "ROS": "ros/parts",
    "below ROS": "ros/repository/parts",
    "ROS 2": "ros2/share/parts",
}


@pytest.mark.parametrize("place", PLACES)
def test_packages_are_found_where_meshes_are(tmp_path, monkeypatch, place):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros2"))
    (tmp_path / "elsewhere").mkdir()
    folder = package(tmp_path / PLACES[place], "parts")
    depth = "urdf/deep/deeper" if "marker" in place else "urdf"
    path = main_file(tmp_path / "ws" / "robot" / depth / "arm.xacro")
    arm = load_arm(path, mesh_folders=[tmp_path / "elsewhere"] if "user" in place else ())
    assert arm.joint_names == ("j",)
    if "user" in place:
        assert run("info", path, "--mesh-folders", tmp_path / "elsewhere").exit_code == 0
        assert find_package("parts", path) is None
        with pytest.raises(FileFormatError, match=r"'parts'.*mesh_folders="):
            load_arm(path)
    else:
        assert find_package("parts", path) == folder


def test_the_folder_that_a_message_asks_for_is_enough(tmp_path):
    """The message of a missing package names an option; the folder that contains the package cures it."""
    path = main_file(tmp_path / "a" / "b" / "robot" / "arm.xacro")
    folder = package(tmp_path / "far" / "parts").parent
    result = run("info", path)
    assert result.exit_code != 0
    message = printed(result)
    assert "'parts'" in message
    assert "--mesh-folders" in message
    assert run("info", path, "--mesh-folders", folder).exit_code == 0
    assert load_arm(path, mesh_folders=[folder]).dof == 1
    assert load_arms(path, mesh_folders=[folder], bases=[(0, 1, 0), (0, -1, 0)]).dof == 2


def test_a_folder_with_the_name_of_a_package_is_not_taken_for_it(tmp_path):
    """Packages often have a folder ``urdf/NAME``; the marker tells which one is the package."""
    robot = package(tmp_path / "parts")
    path = main_file(robot / "urdf" / "parts" / "arm.xacro")
    assert load_arm(path).joint_names == ("j",)


def test_packages_are_found_from_included_files_and_linked_ones(tmp_path):
    first = package(tmp_path / "ws" / "parts")
    (first / "urdf" / "part.xacro").write_text(
        f'<robot {NAMESPACE}><xacro:include filename="$(find others)/urdf/part.xacro"/></robot>'
    )
    package(tmp_path / "ws" / "others")
    path = main_file(tmp_path / "ws" / "robot" / "urdf" / "arm.xacro")
    assert load_arm(path).dof == 1
    link = tmp_path / "home" / "arm.xacro"
    link.parent.mkdir()
    link.symlink_to(path)
    assert load_arm(link).dof == 1


def test_missing_arguments_are_named_with_a_remedy_that_works():
    with pytest.raises(
        FileFormatError, match=r"'arm_name'.*'side'.*xacro_args=\{'arm_name'"
    ) as caught:
        load_arm(ARGUMENTS)
    remedy = str(caught.value).partition("xacro_args=")[2]
    arm = load_arm(ARGUMENTS, xacro_args=yaml.safe_load(remedy))
    assert arm.frame == "VALUE_l6"

    result = run("info", ARGUMENTS)
    assert result.exit_code != 0
    words = shlex.split("--xacro-args" + printed(result).partition("--xacro-args")[2])
    assert run("info", ARGUMENTS, *words).exit_code == 0


def test_arguments_are_given_in_commands_python_and_files(tmp_path):
    for words in (
        ["--xacro-args", "arm_name:=left", "side:=l"],
        ["--xacro-args", "arm_name:=left", "--xacro-args", "side:=l"],
        ["--xacro-args=arm_name:=left"],
    ):
        result = run("info", ARGUMENTS, *words, "--json")
        assert result.exit_code == 0, printed(result)
        assert '"left_l6"' in result.output
    arm = load_arm(ARGUMENTS, xacro_args={"arm_name": "left"})
    config = Config(robot=(arm,))
    for saved in (config, Config(robot=(str(ARGUMENTS),), xacro_args={"arm_name": "left"})):
        saved.save(tmp_path / "run.yaml")
        again = load_single_arm(Config.load(tmp_path / "run.yaml"))
        assert again.joint_names == arm.joint_names
    assert len(load_arm(ARGUMENTS, xacro_args={"arm_name": "a"}).surfaces()) == 0


EXPRESSIONS = {
    "default of another": (
        '<xacro:arg name="a"/><xacro:arg name="b" default="$(arg a)_x"/>',
        {"a"},
    ),
    "two": (
        '<xacro:arg name="a"/><xacro:arg name="c"/><xacro:arg name="b" default="1"/>',
        {"a", "c"},
    ),
    "not declared": ('<link name="$(arg a)"/>', {"a"}),
    "condition": (
        '<xacro:arg name="a"/><xacro:if value="$(arg a)"><link name="x"/></xacro:if>',
        {"a"},
    ),
    "number": ('<xacro:arg name="a"/><xacro:property name="n" value="${2 * $(arg a)}"/>', {"a"}),
    "evaluated": (
        '<xacro:arg name="a"/><xacro:property name="n" value="$(eval arg(\'a\'))"/>',
        {"a"},
    ),
    "in an expression": (
        '<xacro:arg name="a"/><xacro:property name="n" value="${xacro.arg(\'a\')}"/>',
        {"a"},
    ),
    "file": ('<xacro:arg name="a"/><xacro:include filename="$(arg a).xacro"/>', {"a"}),
}


@pytest.mark.parametrize("case", EXPRESSIONS)
def test_all_missing_arguments_are_in_one_message(tmp_path, case):
    text, missing = EXPRESSIONS[case]
    path = tmp_path / "arm.xacro"
    path.write_text(f'<robot name="r" {NAMESPACE}>{text}{ARM}</robot>')
    with pytest.raises(FileFormatError, match="arguments") as caught:
        load_arm(path)
    given = yaml.safe_load(str(caught.value).partition("xacro_args=")[2])
    assert set(given) == missing


def test_defaults_follow_the_arguments_that_are_given(tmp_path):
    path = tmp_path / "arm.xacro"
    path.write_text(
        f'<robot name="r" {NAMESPACE}><xacro:arg name="side" default="left"/>'
        '<xacro:arg name="prefix" default="$(arg side)_"/><xacro:arg name="long" default="false"/>'
        f'<link name="base"/><link name="$(arg prefix)tip"/>{JOINT.format("j", "base", "$(arg prefix)tip")}'
        '<xacro:if value="$(arg long)"><link name="end"/>'
        f"{JOINT.format('k', '$(arg prefix)tip', 'end')}</xacro:if></robot>"
    )
    assert load_arm(path).frame == "left_tip"
    assert load_arm(path, xacro_args={"side": "right"}).frame == "right_tip"
    assert load_arm(path, xacro_args={"prefix": ""}).frame == "tip"
    assert load_arm(path, xacro_args={"long": True}).frame == "end"
    assert '"tip"' in run("info", path, "--xacro-args", "prefix:=", "--json").output


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        ({"arm": "left"}, FileFormatError, "'arm_name'.*no argument 'arm'"),
        ({"arm_name": "left", "sid": "l"}, UnknownNameError, "'sid'.*first: 'side'"),
        ("arm_name:=left", InvalidInputError, "must map names"),
        ({"arm_name": None}, InvalidInputError, "'arm_name'"),
        ({1: "left"}, InvalidInputError, "must be text"),
    ],
)
def test_wrong_arguments_are_named(value, error, message):
    with pytest.raises(error, match=message):
        load_arm(ARGUMENTS, xacro_args=value)


@pytest.mark.parametrize("robot", ["panda", "myoarm", CASES / "inert_xacro" / "arm.urdf"])
def test_arguments_are_for_xacro_files(robot):
    with pytest.raises(InvalidInputError, match="xacro_args"):
        load_arm(robot, xacro_args={"arm_name": "left"})


@pytest.mark.parametrize(
    "words", [["arm_name"], ["=left"], [":=left"], ["a:=1", "--xacro-args", "a:=2"]]
)
def test_wrong_words_of_arguments_are_errors(words):
    result = run("info", ARGUMENTS, "--xacro-args", *words)
    assert result.exit_code != 0
    assert "xacro-args" in printed(result)


INERT = {
    "property": '<xacro:property name="width" value="${2 * 0.1}"/>',
    "argument": '<xacro:arg name="a" default="$(find x)"/>',
    "block": '<xacro:property name="o"><origin xyz="${x} 0 0"/></xacro:property>',
    "include": '<xacro:include filename="$(find x)/materials.xacro"/>',
    "condition": '<xacro:if value="$(arg sim)"><gazebo reference="${p}tip"/></xacro:if>',
    "plug-in": '<gazebo reference="${p}tip"/>',
}


@pytest.mark.parametrize("case", INERT)
def test_elements_of_xacro_without_macros_are_inert_in_a_urdf(tmp_path, case):
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r" {NAMESPACE}>{INERT[case]}{ARM}</robot>')
    arm = load_arm(path)
    assert (arm.joint_names, arm.frame) == (("j",), "tip")


def test_a_urdf_with_a_property_loads():
    arm = load_arm(CASES / "inert_xacro" / "arm.urdf")
    assert (arm.dof, arm.frame) == (6, "l6")


ACTIVE = {
    "macro": '<xacro:macro name="m" params="n"><link name="${n}"/></xacro:macro>',
    "use": '<xacro:m n="x"/>',
    "selected link": '<xacro:if value="true"><link name="x"/></xacro:if>',
    "macro in a condition": '<xacro:unless value="false"><xacro:m/></xacro:unless>',
    "block": '<link name="x"><xacro:insert_block name="o"/></link>',
    "property in a link": '<link name="x"><xacro:if value="1"><inertial/></xacro:if></link>',
    "name": '<link name="${prefix}x"/>',
    "number": '<link name="x"/><joint name="k" type="fixed"><origin xyz="${x} 0 0"/></joint>',
}


@pytest.mark.parametrize("case", ACTIVE)
def test_files_that_need_xacro_are_refused_as_a_urdf(tmp_path, case):
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r" {NAMESPACE}>{ACTIVE[case]}{ARM}</robot>')
    with pytest.raises(FileFormatError, match=r"arm\.urdf.*\.xacro"):
        load_arm(path)


def test_the_ending_that_a_message_asks_for_is_enough(tmp_path):
    path = tmp_path / "arm.urdf"
    tool = f'<link name="tool"/>{JOINT.format("k", "tip", "tool")}'
    path.write_text(
        f'<robot name="r" {NAMESPACE}><xacro:macro name="m">{tool}</xacro:macro>{ARM}<xacro:m/></robot>'
    )
    with pytest.raises(FileFormatError, match=r"arm\.urdf.*\.xacro"):
        load_arm(path)
    assert load_arm(shutil.copy(path, tmp_path / "arm.xacro")).frame == "tool"


def shape(kind, size):
    return f'<{kind}><geometry><box size="{size}"/></geometry></{kind}>'


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_arguments_and_packages_reach_the_shapes(tmp_path, kind):
    """Shapes are read later than joints, with the same arguments and folders."""
    part = package(tmp_path / "far" / "parts") / "urdf" / "part.xacro"
    tip = shape("visual", "1 1 1") + shape("collision", "1 1 1")
    tip = tip.replace(shape(kind, "1 1 1"), shape(kind, "$(arg size) 0.2 0.2"))
    part.write_text(PART.replace('<link name="tip"/>', f'<link name="tip">{tip}</link>'))
    path = main_file(tmp_path / "robot" / "arm.xacro")
    path.write_text(path.read_text().replace("<xacro:inc", '<xacro:arg name="size"/><xacro:inc', 1))

    arm = load_arm(path, mesh_folders=[part.parents[2]], xacro_args={"size": 0.6})
    shapes = arm.geometry.checked
    assert not shapes.missing
    points = arm.surfaces()[0].points if kind == "visual" else shapes.shapes[0].mesh[0]
    assert max(points[:, 0]) == pytest.approx(0.3)


@pytest.fixture
def expansions(monkeypatch):
    """Processes that expand xacro files, as they are started."""
    started = []
    run_process = subprocess.run

    def counted(*words, **options):
        started.append(words)
        return run_process(*words, **options)

    monkeypatch.setattr("maniport.arms.loaders.xacro_files.subprocess.run", counted)
    return started


def test_a_file_is_expanded_once_for_joints_pictures_and_collisions(tmp_path, expansions):
    package(tmp_path / "parts")
    path = main_file(tmp_path / "robot" / "main.xacro")
    arm = load_arm(path)
    arm.surfaces()
    assert not Collisions.of(arm).checked
    robot_limbs(path)
    assert load_arm(path).joint_names == ("j",)
    assert len(expansions) == 1


def test_a_file_is_expanded_anew_after_a_change(tmp_path, expansions, monkeypatch):
    """A change of an included file, of an argument or of the environment counts."""
    part = package(tmp_path / "parts") / "urdf" / "part.xacro"
    path = main_file(tmp_path / "robot" / "main.xacro")
    assert load_arm(path).joint_names == ("j",)
    part.write_text(PART.replace('name="j"', 'name="k"'))
    assert load_arm(path).joint_names == ("k",)

    named = '<xacro:arg name="n" default="$(optenv JOINT_OF_TEST m)"/>'
    part.write_text(PART.replace(ARM, named + ARM.replace('name="j"', 'name="$(arg n)"')))
    assert load_arm(path).joint_names == ("m",)
    assert load_arm(path, xacro_args={"n": "a"}).joint_names == ("a",)
    monkeypatch.setenv("JOINT_OF_TEST", "e")
    assert load_arm(path).joint_names == ("e",)
    assert len(expansions) == 5

    (tmp_path / "parts" / "urdf" / "part.xacro").unlink()
    with pytest.raises(FileFormatError, match=r"part\.xacro"):
        load_arm(path)
