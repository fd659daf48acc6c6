import json

import numpy as np
import pytest
from typer.testing import CliRunner

from crane import CRANE
from maniport.arms import load_arm
from maniport.arms.loaders.packages import PACKAGES
from maniport.cli import app
from maniport.pipeline.config import Config
from maniport.pipeline.robots import load_robot
from real_robots import NEEDS_ROBOTS


@pytest.fixture
def crane(tmp_path):
    path = tmp_path / "crane.urdf"
    path.write_text(CRANE)
    return path


def info(*words: str) -> str:
    result = CliRunner().invoke(app, ["info", *words])
    assert result.exit_code == 0, result.exception
    return result.stdout


def warnings_of(*words: str) -> dict[str, str]:
    return {one["key"]: one["text"] for one in json.loads(info(*words, "--json"))["warnings"]}


def test_info_describes_chain_and_other_ends(crane):
    text = info(str(crane), "--lock", "up=0.25")
    for part in (
        "Base: base",
        "End effector: hook",
        "Fixed joints: up at 0.25 m",
        "| nod | -1.000 to 1.000 rad (-57° to 57°) | 1 rad/s | 1 N m |",
        "Moving mass: unknown",
        "| eye | 2 | turn … look | post |",
    ):
        assert part in text
    found = json.loads(info(str(crane), "--base", "post", "--json"))
    assert (found["base"], list(found["joints"]), list(found["ends"])) == (
        "post",
        ["up", "nod"],
        ["eye"],
    )


def test_info_warns_of_assumptions_and_omitted_checks(crane, tmp_path):
    warned = warnings_of(str(crane))
    limits = {
        "position": "-3.14 to 3.14 rad for turn",
        "velocity": "1 rad/s for turn",
        "acceleration": "4 rad/s² for turn",
        "jerk": "100 rad/s³ for turn",
    }
    assert set(warned) == {
        *(f"assumed-{one}-limits" for one in limits),
        "unchecked-collisions",
        "unchecked-torques",
    }
    assert all(text in warned[f"assumed-{one}-limits"] for one, text in limits.items())
    assert all(text in info(str(crane)).split("## Warnings")[1] for text in warned.values())
    assert warnings_of("panda") == warnings_of("myoarm") == {}
    shape = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual><collision><geometry><box size="1 1 1"/>'
    link = f'<link name="lift">{shape}</geometry></collision></link>'
    (tmp_path / "boxes.urdf").write_text(CRANE.replace('<link name="lift"/>', link))
    assert "lift" in warnings_of(str(tmp_path / "boxes.urdf"))["missing-meshes"]


BOX = "<geometry><box size='1 1 1'/></geometry>"
LIFT = '<link name="lift"/>'


def test_info_says_which_shapes_are_checked(crane, tmp_path):
    path = tmp_path / "shapes.urdf"
    texts = {
        "collision": f"<collision>{BOX}</collision>",
        "visual": f"<visual>{BOX}</visual>",
    }
    for kind, shape in texts.items():
        path.write_text(CRANE.replace(LIFT, f'<link name="lift">{shape}</link>'))
        assert kind in info(str(path)).split("Collision shapes:")[1].splitlines()[0]
        found = json.loads(info(str(path), "--json"))["collision_shapes"]
        assert found[kind] == ["lift"]
    assert "Collision shapes" not in info(str(crane))


def test_info_names_a_mesh_that_cannot_be_read(tmp_path):
    path = tmp_path / "shapes.urdf"
    mesh = '<collision><geometry><mesh filename="gone.stl"/></geometry></collision>'
    shape = f'<link name="lift"><collision>{BOX}</collision>{mesh}</link>'
    path.write_text(CRANE.replace(LIFT, shape))
    warning = warnings_of(str(path))["unchecked-links"]
    assert "lift" in warning
    assert "gone.stl" in warning


@NEEDS_ROBOTS
def test_info_warns_of_pairs_of_links_that_hulls_cannot_decide():
    assert (
        "left_lowerarm against left_hand"
        in warnings_of("human_left_arm")["unchecked-links"].lower()
    )


def test_an_arm_is_the_same_after_a_configuration_file(crane, tmp_path):
    arm = load_arm(crane, base="post", lock={"nod": -0.3})
    Config().changed(robot=arm).save(tmp_path / "run.yaml")
    again = load_robot(Config.load(tmp_path / "run.yaml"))
    q = arm.sample(4, random_state=0)
    np.testing.assert_allclose(again.jacobian(q), arm.jacobian(q), atol=1e-6)
    Config().changed(robot=load_arm("panda")).save(tmp_path / "run.yaml")
    assert (
        load_robot(Config.load(tmp_path / "run.yaml")).joint_names == load_arm("panda").joint_names
    )


def test_a_robot_with_two_arms_lists_its_ends():
    if not PACKAGES["example-robot-data"].installed():
        pytest.skip("example-robot-data is not installed")
    text = info("talos")
    assert "choose one with --frame, or name talos_left_arm or talos_right_arm." in text
    assert (
        "| gripper_left_base_link | 9 | torso_1_joint … arm_left_7_joint | torso_2_link |" in text
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("panda", "--lock", "panda_joint4=10"),
            "--lock: panda_joint4 is 10°; allowed are -176.00° to -4.00°",
        ),
        (
            ("panda", "--lock", "panda_joint1=3", "--lock", "panda_joint1=4"),
            "panda_joint1 is set twice; found 3 and",
        ),
        (("panda", "--joints", " ,"), "--joints must be names"),
        (("panda", "--unit", "mm"), "--unit cannot be used"),
        (("freeform", "--lock", "up=1"), "--lock cannot be used"),
        (("panda", "--lock", "panda_joint4"), "--lock must be NAME=NUMBER"),
        (("panda", "--joints", "panda_joint2,panda_joint9"), "unknown joint 'panda_joint9'"),
        (("panda", "--base", "panda_link"), "unknown base 'panda_link'.*'panda_link0'"),
    ],
)
def test_invalid_options_are_named(words, message):
    result = CliRunner().invoke(app, ["info", *words])
    with pytest.raises(ValueError, match=message):
        raise result.exception
