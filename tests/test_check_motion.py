"""The independent check of exported motions agrees with the package and detects deliberate faults."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.arms import load_arm
from maniport.motion import ArmMotion, MotionLimits
from maniport.motion.plan.time_parameterization import retime
from maniport.util.files import save_ellipsoids, save_path

SCRIPT = Path(__file__).parents[1] / "scripts/check_motion.py"
FIRST = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
LAST = FIRST + 0.4


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(SCRIPT.parent))
    spec = importlib.util.spec_from_file_location("check_motion", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(SCRIPT.parent))
    return module


def export(folder, seconds=1.0):
    """Write a slow motion from rest to rest whose targets are its own ellipsoids and positions."""
    arm = load_arm("panda", frame="panda_hand_tcp")
    time = np.arange(0.0, seconds + 1e-9, 1e-3)
    s = time / seconds
    q = FIRST + (s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3))[:, None] * (LAST - FIRST)
    waypoints = time[::100]
    points = q[::100]
    path = arm.forward(points)[:, :3, 3]
    profile = arm.manipulability(points)
    motion = ArmMotion.of_motion(arm, waypoints, profile, time, q, path=path)
    save_ellipsoids(folder / "placed_profile.npz", profile, waypoints)
    save_path(folder / "path.npz", path, waypoints)
    motion.save_joints_csv(folder / "joints.csv")
    motion.save_joints(folder / "joints.npz")


def rewrite(folder, change):
    path = folder / "joints.csv"
    header, *lines = path.read_text().splitlines()
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    change(table)
    path.write_text(
        "\n".join([header, *(",".join(f"{cell:.12f}" for cell in row) for row in table)])
    )


def test_mujoco_agrees_with_the_package(script, tmp_path):
    export(tmp_path)
    rows = script.check(tmp_path)
    values = {name: value for name, value, _ in rows}
    assert values["end effector"].startswith("panda_hand_tcp")
    for start in ("distance (", "position error"):
        value = next(value for name, value in values.items() if name.startswith(start))
        assert_allclose([float(part.split()[0]) for part in value.split(" / ")], 0.0, atol=1e-3)
    assert all(within is not False for _, _, within in rows)


def _jump(table):
    table[500:, 2] += 0.01


def _cut_off(table):
    table[:, 1] += 0.5 * np.linspace(0.0, 1.0, len(table))


@pytest.mark.parametrize(("change", "row"), [(_jump, "jerk"), (_cut_off, "at rest at both ends")])
def test_faults_are_detected(script, tmp_path, change, row):
    export(tmp_path)
    rewrite(tmp_path, change)
    assert {name: within for name, _, within in script.check(tmp_path, "panda_hand_tcp")}[
        row
    ] is False


def test_a_payload_that_was_not_planned_is_detected(script, tmp_path):
    export(tmp_path)
    arm = load_arm("panda", frame="panda_hand_tcp")
    retime(MotionLimits.of(arm), [0.0, 1.0], [FIRST, LAST]).save_joints_csv(tmp_path / "joints.csv")
    for payload, followed in ((0.0, True), (3.0, False)):
        rows = {
            name: within
            for name, _, within in script.check(tmp_path, "panda_hand_tcp", payload=payload)
        }
        assert rows["position error of a servo [mm]: median / 95 % / max"] is followed
