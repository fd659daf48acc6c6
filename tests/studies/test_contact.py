"""Contact tasks: outcomes with known answers on a gantry, the forces of a Panda, and the study."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.contact_tasks import TASKS, Contact, require_simulated
from maniport.arms import Arm, load_arm
from maniport.errors import InvalidInputError
from maniport.evaluation import line_extent

LIMIT = 50.0  # of the gantry's axes [N]


@pytest.fixture(scope="module")
def gantry(tmp_path_factory):
    """Three sliding axes, of which the last is the heaviest to hold: 1 kg, 9.8 N."""
    links = ["base", "first", "second", "hand"]
    text = '<robot name="gantry">'
    for link in links:
        text += f'<link name="{link}"><inertial><mass value="1"/>'
        text += '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    for name, parent, child, axis in zip("xyz", links, links[1:], np.eye(3), strict=False):
        words = " ".join(map(str, axis))
        text += f'<joint name="{name}" type="prismatic"><parent link="{parent}"/>'
        text += f'<child link="{child}"/><axis xyz="{words}"/>'
        text += f'<limit lower="-1" upper="1" effort="{LIMIT}" velocity="1"/></joint>'
    path = tmp_path_factory.mktemp("gantry") / "gantry.urdf"
    path.write_text(text + "</robot>")
    return load_arm(path)


def pull(arm, line, bend=(0.0, 1.0, 0.0)):
    """A hand that moves 4 cm along a line."""
    positions = [0.3, -0.2, 0.1] + np.linspace(0.0, 0.04, 9)[:, None] * np.array(line)
    return Contact(arm, positions, np.array(line), np.array(bend))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_gantry_succeeds_below_the_limit_of_an_axis_and_fails_above(gantry, task, sense):
    contact = pull(gantry, [sense, 0.0, 0.0])
    below = TASKS[task](contact, 0.85 * LIMIT)
    assert below.success
    assert below.error < 0.01
    assert not TASKS[task](contact, 1.15 * LIMIT).success


@pytest.mark.parametrize("task", TASKS)
def test_gravity_counts_within_the_torque_limits(gantry, task):
    upward = pull(gantry, [0.0, 0.0, 1.0])
    left = LIMIT - 9.81
    assert TASKS[task](upward, 0.85 * left).success
    assert not TASKS[task](upward, LIMIT).success


@pytest.mark.parametrize("task", TASKS)
def test_without_load_the_hand_follows_its_reference(gantry, task):
    outcome = TASKS[task](pull(gantry, [1.0, 0.0, 0.0]), 0.0)
    assert outcome.error < 1e-3
    assert outcome.saturation == 0.0
