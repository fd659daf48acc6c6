"""What descriptions of robots leave open or contradict: limits, soft limits, masses; and names of robots."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from maniport.arms import load_arm
from maniport.cli import app
from maniport.errors import FileFormatError, UnknownNameError, on_the_command_line
from maniport.motion import MotionLimits
from maniport.report.describe import report_of

CASES = Path(__file__).parent / "cases"
LINK = '<link name="{}"><inertial><mass value="{}"/><inertia {}/></inertial></link>'


def keys(arm):
    """Kinds of warnings about an arm."""
    return set(report_of(arm).warning_keys)


def text_of(arm):
    return " ".join(
        metric.text for section in report_of(arm).sections for metric in section.metrics
    )


def moments(*values):
    parts = [f'i{axes}="{value}"' for axes, value in zip(("xx", "yy", "zz"), values, strict=True)]
    return " ".join([*parts, 'ixy="0" ixz="0" iyz="0"'])


def robot(*links, joint="", kind="revolute"):
    """A robot of links in a row, of masses [kg] and moments of inertia [kg m²]."""
    parts = [LINK.format("base", 1, moments(1, 1, 1))]
    above = "base"
    for k, (mass, values) in enumerate(links):
        parts.append(LINK.format(f"l{k}", mass, moments(*values)))
        parts.append(
            f'<joint name="j{k}" type="{kind}"><origin xyz="0 0 0.2"/><parent link="{above}"/>'
            f'<child link="l{k}"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/>'
            f"{joint}</joint>"
        )
        above = f"l{k}"
    return f'<robot name="r">{"".join(parts)}</robot>'


@pytest.fixture
def loaded(tmp_path):
    def loaded(text):
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        return load_arm(path)

    return loaded


def test_continuous_joints_turn_once_whatever_limits_they_state():
    arm = load_arm(CASES / "continuous" / "limits.urdf")
    np.testing.assert_allclose(arm.upper, [np.pi, 2.5, 2.5, 2.5, 2.5, np.pi])
    np.testing.assert_array_equal(arm.lower, -arm.upper)
    assert MotionLimits.of(arm).assumed["position"] == ("j1", "j6")
    assert "assumed-position-limits" in keys(arm)


def test_ranges_of_an_mjcf_count_unless_limited_is_false():
    arm = load_arm(CASES / "limited" / "limited_false.xml")
    np.testing.assert_allclose(arm.upper, [np.pi, 2.5, 2.5, 2.5, 2.5])
    assert arm.chain.unlimited == ("j1",)
    np.testing.assert_allclose(load_arm(CASES / "limited" / "autolimits_false.xml").upper, 2.5)


def test_zero_effort_and_velocity_are_unknown():
    arm = load_arm(CASES / "zero" / "arm.urdf")
    assert np.isinf(arm.chain.velocity_limits).all()
    assert np.isinf(arm.chain.effort_limits).all()
    assert {"assumed-velocity-limits", "unchecked-torques"} <= keys(arm)


def test_a_limit_without_effort_off_the_chain_is_tolerated():
    assert load_arm(CASES / "limit" / "wheel.urdf").dof == 6


def test_a_mimic_joint_on_the_chain_follows():
    arm = load_arm(CASES / "mimic" / "arm.urdf")
    assert arm.dof == 5
    row = [joint.name for joint in arm.chain.joints].index("j3")
    factors = arm.chain.coupling[row]
    assert factors[arm.joint_names.index("j2")] == -1.0
    assert np.count_nonzero(factors) == 1
    assert arm.chain.offset[row] == pytest.approx(0.1)


def test_limits_that_exclude_zero_are_kept():
    arm = load_arm(CASES / "zero_outside" / "arm.urdf")
    np.testing.assert_allclose([arm.lower[1], arm.upper[1]], [0.82, 5.46])
    np.testing.assert_allclose([arm.lower[2], arm.upper[2]], [0.33, 5.95])
    assert np.isfinite(arm.manipulability(arm.sample(4, random_state=0))).all()


def test_soft_limits_are_used_and_noted():
    arm = load_arm(CASES / "safety" / "arm.urdf")
    np.testing.assert_array_equal([arm.lower, arm.upper], np.outer([-1, 1], np.ones(6)))
    assert "soft limits" in text_of(arm)
    assert "j1 (-1 to 1)" in text_of(arm)
    assert "soft limits" in CliRunner().invoke(app, ["info", arm.chain.source]).output
    assert "j1" not in text_of(load_arm(arm.chain.source, base="l1")).partition("soft limits")[2]


LOWER = 'soft_lower_limit="{}"'
UPPER = 'soft_upper_limit="{}"'
BOTH = f"{LOWER} {UPPER}"


@pytest.mark.parametrize(
    ("limits", "expected", "word"),
    [
        (BOTH.format(-1, 1), (-1, 1), "soft limits of"),
        (BOTH.format(-1, 9), (-1, 2), "soft limits of"),
        (BOTH.format(-9, 9), (-2, 2), ""),
        (BOTH.format(-2, 2), (-2, 2), ""),
        (LOWER.format(-0.5), (-0.5, 2), "soft limits of"),
        (UPPER.format(0.5), (-2, 0.5), "soft limits of"),
        (BOTH.format(0, 1.5), (0, 1.5), "soft limits of"),
        (BOTH.format(0, 0), (-2, 2), ""),
        ("", (-2, 2), ""),
        (UPPER.format(0), (-2, 2), ""),
        (BOTH.format(1, -1), (-2, 2), "ignored"),
        (BOTH.format(3, 4), (-2, 2), "ignored"),
        (BOTH.format("-inf", 1), (-2, 1), "soft limits of"),
    ],
)
def test_soft_limits_narrow_the_limits(loaded, limits, expected, word):
    controller = f'<safety_controller k_velocity="1" {limits}/>'
    arm = loaded(robot((1, (1e-3,) * 3), joint=controller))
    assert (arm.lower[0], arm.upper[0]) == expected
    assert word in text_of(arm)
    assert ("soft limits" in text_of(arm).lower()) == bool(word)


def test_soft_limits_of_continuous_joints_are_reported_as_ignored(loaded):
    controller = f"<safety_controller {BOTH.format(-1, 1)}/>"
    arm = loaded(robot((1, (1e-3,) * 3), joint=controller, kind="continuous"))
    assert arm.upper[0] == pytest.approx(np.pi)
    assert "ignored-soft-limits" in keys(arm)


def test_soft_limits_that_are_no_numbers_are_errors(loaded):
    controller = f"<safety_controller {LOWER.format('low')}/>"
    with pytest.raises(FileFormatError, match=r"'j0'.*soft_lower_limit.*'low'"):
        loaded(robot((1, (1e-3,) * 3), joint=controller))


def test_moments_that_do_not_fit_the_mass_are_a_warning():
    huge = load_arm(CASES / "zero" / "huge_inertia.urdf")
    assert "implausible-inertia" in keys(huge)
    assert "l6" in text_of(huge)
    assert "implausible-inertia" in keys(load_arm(CASES / "zero" / "arm.urdf"))


FITTING = (0.6, (1e-3, 1e-3, 1e-3))


@pytest.mark.parametrize(
    "link",
    [
        (0.6, (1, 1, 1)),
        (0.6, (1e-3, 1e-3, 3e-3)),
        (5, (0.01, 0.02, 0.04)),
        (0, (1, 1, 1)),
        (1e-3, (0.01, 0.01, 0.01)),
    ],
)
def test_impossible_bodies_are_found_on_the_chain(loaded, link):
    arm = loaded(robot(FITTING, link, FITTING))
    assert "implausible-inertia" in keys(arm)
    assert re.search(r"\bl1 \(", text_of(arm))
    assert not re.search(r"\bl0 \(", text_of(arm))
    assert "implausible-inertia" not in keys(arm.restricted(base="l1"))


@pytest.mark.parametrize(
    "link",
    [
        (4, (0.2, 0.2, 0.01)),
        (2, (1e-3, 1e-3, 2e-3)),
        (0.3, (1e-6, 1e-6, 2.5e-6)),
        (1e-3, (1e-3,) * 3),
        (1e-6, (1e-6, 1e-6, 2e-6)),
        (0.5, (0, 0, 0)),
        (9, (0.3, 0.31, 0.05)),
        (0.01, (1e-5, 1e-5, 2.01e-5)),
    ],
)
def test_plausible_bodies_are_no_warning(loaded, link):
    assert "implausible-inertia" not in keys(loaded(robot(FITTING, link, FITTING)))


def test_the_center_of_mass_is_far_from_the_frame_without_a_warning(loaded):
    text = robot(FITTING, FITTING).replace(
        "<inertial>", '<inertial><origin xyz="2 -1 3" rpy="1 2 3"/>'
    )
    assert "implausible-inertia" not in keys(loaded(text))


def test_the_base_is_not_checked(loaded):
    text = robot(FITTING, FITTING).replace(moments(1, 1, 1), moments(1, 1, 9))
    assert "implausible-inertia" not in keys(loaded(text))


LIFT = """<robot name="lift"><link name="base"/><link name="carriage"/><link name="plate"/>
  <link name="a"/><link name="b"/>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="0 0 1"/>
    <limit effort="1" velocity="1"/></joint>
  <joint name="weld" type="fixed"><parent link="carriage"/><child link="plate"/></joint>
  <joint name="turn" type="continuous"><parent link="plate"/><child link="a"/><axis xyz="0 0 1"/></joint>
  <joint name="nod" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>"""


def test_a_lift_without_limits_is_excluded_by_the_ways_in_the_message(tmp_path):
    path = tmp_path / "lift.urdf"
    path.write_text(LIFT)
    with pytest.raises(FileFormatError, match=r"'lift'.*limits") as caught:
        load_arm(path)
    base = re.search(r"base='(\w+)'", str(caught.value))[1]
    assert load_arm(path, base=base).joint_names == ("turn", "nod")
    assert load_arm(path, joints=["turn", "nod"]).dof == load_arm(path, lock={"lift": 0.3}).dof == 2
    with on_the_command_line():
        result = CliRunner().invoke(app, ["info", str(path)])
        words = re.search(r"(--base \w+)", str(result.exception))[1].split()
        assert CliRunner().invoke(app, ["info", str(path), *words]).exit_code == 0


def test_a_slide_at_the_end_is_not_excluded_by_a_base(tmp_path):
    path = tmp_path / "slide.urdf"
    slide = '<link name="c"/><joint name="slide" type="prismatic"><parent link="b"/><child link="c"/></joint>'
    text = LIFT.replace("<limit ", '<limit lower="0" upper="1" ').replace(
        "</robot>", slide + "</robot>"
    )
    path.write_text(
        text.replace('<child link="c"/>', '<child link="c"/><limit effort="1" velocity="1"/>')
    )
    with pytest.raises(FileFormatError, match=r"'slide'.*limits") as caught:
        load_arm(path)
    assert "base" not in str(caught.value)
    assert load_arm(path, joints=["lift", "turn", "nod"]).dof == 3


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("pnada", "panda"),
        ("ur55", "ur5"),
        ("UR10s", "ur10"),
        ("myo_arm", "myoarm"),
        ("talos_rigth_arm", "talos_right_arm"),
        ("xarm77", "xarm7"),
    ],
)
def test_misspelled_robots_get_five_names_the_nearest_first(name, nearest):
    with pytest.raises(UnknownNameError, match="nearest first") as caught:
        load_arm(name)
    names = re.findall(r"'([^']+)'", str(caught.value).partition("nearest first: ")[2])
    assert names[0] == nearest
    assert len(names) == 5
