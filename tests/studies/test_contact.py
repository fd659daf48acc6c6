"""Contact tasks: outcomes with known answers on a gantry, the forces of a Panda, and the study."""

import json
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks import contact
from benchmarks.capability import Run
from benchmarks.contact import Rate, Trial, loads_of, rate_of, travel_from, trials_of
from benchmarks.contact_tasks import LEVER, TASKS, TRAVEL, Contact, Simulation, require_simulated
from maniport.arms import Arm, load_arm
from maniport.errors import InvalidInputError
from maniport.evaluation import line_extent, polytope_extent

LIMIT = 50.0  # of the gantry's axes [N]
RUN = Run("freeform", "right", 0.5, 2.5, "panda", 0, "default")
TRIAL = Trial("drawer", 3, 59.3, success=True, error_mm=1.0, saturation_s=0.0)


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


def line_of_a_panda(arm, seed):
    """A hand that moves 4 cm along a random line, by small steps of inverse kinematics."""
    random = np.random.default_rng(seed)
    line = random.normal(size=3)
    line /= np.linalg.norm(line)
    bend = np.cross(line, random.normal(size=3))
    bend /= np.linalg.norm(bend)
    path = [arm.sample(1, seed)[0]]
    for _ in range(40):
        step = np.linalg.pinv(arm.jacobian(path[-1])[:3]) @ line
        path.append(path[-1] + TRAVEL / 40 * step)
    return Contact(arm, np.array(path), line, bend)


def static_limit(contact, task):
    """The load at which a motor saturates at rest: the smallest on the way, for the forces of a task."""
    if task == "brace":
        return line_extent(contact.arm, contact.joint_positions[:1], contact.line[None])[0, 0]
    if task == "drawer":
        return polytope_extent(contact.arm, contact.joint_positions[-1:], contact.line[None])[0, 0]
    limits = []
    for index in (0, 20, 40):
        # along the tangent of the lever, at a radius that the handle has slid to
        angle = np.arctan(index / 40 * TRAVEL / LEVER)
        tangent = np.cos(angle) * contact.line + np.sin(angle) * contact.bend
        force = polytope_extent(contact.arm, contact.joint_positions[index], tangent[None])[0, 0]
        limits.append(force / np.cos(angle))
    return min(limits)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("seed", [1, 2, 5])
def test_a_panda_succeeds_up_to_its_static_force(task, seed):
    contact = line_of_a_panda(load_arm("panda"), seed)
    limit = static_limit(contact, task)
    assert TASKS[task](contact, 0.9 * limit).success
    assert not TASKS[task](contact, 1.15 * limit).success


def test_the_simulated_hand_is_that_of_the_arm():
    arm = load_arm("panda")
    q = arm.sample(3, 0)
    simulation = Simulation(arm, q)
    data = simulation.data
    for row in q:
        data.qpos[:] = row
        simulation.mujoco.mj_forward(simulation.model, data)
        hand = arm.forward(row)[:3, 3]
        assert np.allclose(data.xpos[simulation.hand], hand, atol=1e-9)
        assert np.allclose(data.xipos[simulation.hand], hand, atol=1e-9)  # where pushes act


def test_arms_without_masses_are_refused():
    with pytest.raises(InvalidInputError):
        require_simulated(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]))


def test_loads_are_ordered_and_do_not_depend_on_motions():
    loads = loads_of(load_arm("panda"))
    assert loads == sorted(loads)
    assert loads == loads_of(load_arm("panda"))
    stronger = load_arm("panda").with_limits(effort=1e3)
    assert min(loads_of(stronger)) > max(loads)


def test_a_moment_ends_after_the_travel_and_needs_a_path_that_goes_on():
    path = np.column_stack([np.linspace(0.0, 0.1, 11), np.linspace(0.0, 0.05, 11), np.zeros(11)])
    moment = travel_from(2, path, np.array([-1.0, 0.0, 0.0]))
    assert moment.end == pytest.approx(6.0)
    assert np.allclose(moment.line, [1.0, 0.0, 0.0])
    assert np.allclose(moment.bend, [0.0, 1.0, 0.0])
    assert travel_from(8, path, np.array([1.0, 0.0, 0.0])) is None  # ends before
    back = np.abs(path - path[3])
    assert travel_from(1, back, np.array([1.0, 0.0, 0.0])) is None


def test_rates_have_intervals_over_clips():
    same = [("a", 1.0), ("a", 0.0), ("b", 1.0), ("b", 0.0)]
    assert rate_of(same) == Rate(0.5, 0.5, 0.5)
    apart = rate_of([("a", 1.0), ("a", 1.0), ("b", 0.0), ("b", 0.0)])
    assert apart == Rate(0.5, 0.0, 1.0)


def test_trials_of_methods_are_paired():
    failed = replace(TRIAL, success=False, error_mm=30.0)
    known = {RUN: ({}, [TRIAL]), replace(RUN, method="positions only"): ({}, [failed])}
    own = trials_of(known, "panda", "default")
    reference = trials_of(known, "panda", "positions only")
    assert list(own) == list(reference)
    assert contact.difference(own, reference).startswith("+100 ")
    assert trials_of(known, "panda", "default", "brace") == {}


@pytest.mark.slow
def test_the_study_is_resumed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(contact, "CLIPS", (("freeform", "right", 2.0, 3.0),))
    file = tmp_path / "results.jsonl"
    words = [str(file), "--clips", "1", "--robots", "panda", "--seeds", "0"]
    words += ["--methods", "positions only"]
    contact.main(words)
    lines = file.read_text().splitlines()
    records = [json.loads(line) for line in lines]
    assert [record["run"]["method"] for record in records] == ["default", "positions only"]
    paired = [[(t["task"], t["frame"], t["load"]) for t in record["trials"]] for record in records]
    assert paired[0] == paired[1]
    assert {task for task, _, _ in paired[0]} == set(TASKS)
    assert {load for _, _, load in paired[0]} == set(loads_of(load_arm("panda")))
    table = capsys.readouterr().out
    assert "| panda | default (1) |" in table

    monkeypatch.setattr(contact, "attempted", None)  # an error if it were called
    file.write_text(lines[0] + "\n" + lines[1] + "\n")
    contact.main(words)
    assert capsys.readouterr().out == table
    assert file.read_text().splitlines() == lines
