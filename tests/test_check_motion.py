"""The independent check of exported motions agrees with the package, and finds deliberate faults."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.arms import load_arm
from maniport.motion import ArmMotion
from maniport.util.files import save_ellipsoids, save_path

SCRIPT = Path(__file__).parents[1] / "scripts/check_motion.py"
FIRST = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
LAST = FIRST + 0.4


@pytest.fixture(scope="module")
def check():
    """The script as a module, with what stands beside it."""
    sys.path.insert(0, str(SCRIPT.parent))
    found = importlib.util.spec_from_file_location("check_motion", SCRIPT)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    sys.path.remove(str(SCRIPT.parent))
    return module


def export(folder, last=LAST, seconds=1.0):
    """A calm motion from rest to rest with its own ellipsoids and tip for targets, as results folders hold it."""
    arm, time = load_arm("panda", frame="panda_hand_tcp"), np.arange(0.0, seconds + 1e-9, 1e-3)
    s = time / seconds
    q = FIRST + (s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3))[:, None] * (last - FIRST)
    at, points = time[::100], q[::100]
    path, profile = arm.forward(points)[:, :3, 3], arm.manipulability(points)
    motion = ArmMotion.of_motion(arm, at, profile, time, q, path=path)
    save_ellipsoids(folder / "placed_profile.npz", profile, at)
    save_path(folder / "path.npz", path, at)
    motion.save_joints_csv(folder / "joints.csv")
    motion.save_joints(folder / "joints.npz")
    return motion


def broken(folder, change):
    """Rewrite the numbers of joints.csv."""
    path = folder / "joints.csv"
    header, *lines = path.read_text().splitlines()
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    change(table)
    path.write_text("\n".join([header, *(",".join(f"{cell:.12f}" for cell in row) for row in table)]))


def verdicts(check, folder, tip=None):
    """Return text and verdict of each row, by the first word of its name."""
    return {name.split(",")[0]: (said, within) for name, said, within in check.judge(folder, tip, None)}


def test_what_the_package_exports_is_what_mujoco_sees(check, tmp_path):
    """Kinematics, ellipsoids and distances of two programs that share no code agree, and a calm motion passes."""
    export(tmp_path)
    found = verdicts(check, tmp_path)
    assert found["tip"][0].startswith("panda_hand_tcp")
    for name in ("d", "tip beside its path [mm]: same"):
        figures = found[name][0] if name in found else next(v[0] for k, v in found.items() if k.startswith(name))
        assert_allclose([float(part.split()[0]) for part in figures.split(" / ")], 0.0, atol=1e-3)
    assert all(within is not False for _, within in found.values())


def _jump(table):
    table[500:, 2] += 0.01


def _cut_off(table):
    table[:, 1] += 0.5 * np.linspace(0.0, 1.0, len(table))


@pytest.mark.parametrize(("change", "row"), [(_jump, "jerk"), (_cut_off, "at rest at both ends")])
def test_broken_files_are_found(check, tmp_path, change, row):
    """A jump shows in the jerk, a motion that is cut off in its ends."""
    export(tmp_path)
    broken(tmp_path, change)
    assert verdicts(check, tmp_path, "panda_hand_tcp")[row][1] is False
