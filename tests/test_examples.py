"""The physics of the examples holds; `make docs` runs each example and fails where one does."""

import ast
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.bodies import load_arm

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
PLACED, PHYSICS = "06_place_and_track.py", "08_replay_in_mujoco.py"
LINKS = (*(f"panda_link{i}" for i in range(1, 8)), "panda_hand")

VIOLENT = '''
"""A stand-in for example 06: half a radian to and fro, four times a second."""
import numpy as np
import maniport as mp
from maniport.tracking import TrackResult

def main(folder):
    arm, time = mp.load_arm("panda"), np.linspace(0.0, 0.5, 51)
    q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0]) + 0.5 * np.sin(8.0 * np.pi * time[:, None])
    path = arm.forward(q)[:, :3, 3]
    return TrackResult.of_motion(arm, time, arm.manipulability(q), time, q, path=path)
'''


def run(script, folder):
    """Run a script the way a reader does."""
    command = [sys.executable, str(script), str(folder / "results")]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_examples_are_short_and_explain_themselves(example):
    """Fewer than 80 lines and a docstring with more than a title; the index lists them."""
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 80
    assert len((ast.get_docstring(ast.parse(text)) or "").splitlines()) >= 3
    assert f"({example.name})" in (FOLDER / "README.md").read_text(encoding="utf-8")


def test_a_planned_motion_survives_physics(tmp_path):
    """Simulated, the distance changes by less than 0.02 (95 %), no motor saturates, and feed-forward helps."""
    result = run(FOLDER / PHYSICS, tmp_path)
    assert result.returncode == 0, result.stderr
    assert "Warning" not in result.stderr
    without, change = map(float, re.findall(r"change of d ([\d.]+)", result.stdout))
    assert change < 0.02
    assert change < without
    assert all(int(share) < 100 for share in re.findall(r"torque (\d+)%", result.stdout))
    assert (tmp_path / "results" / "joints.csv").stat().st_size > 10_000


def test_a_violent_motion_does_not_survive_physics(tmp_path):
    """It ends with a non-zero exit code and a sentence."""
    for name in (PHYSICS, "panda_inertia.csv"):
        shutil.copy(FOLDER / name, tmp_path)
    (tmp_path / PLACED).write_text(VIOLENT, encoding="utf-8")
    result = run(tmp_path / PHYSICS, tmp_path)
    assert result.returncode != 0
    assert "does not survive physics" in result.stderr
    assert "Traceback" not in result.stderr


def test_the_physical_panda_is_the_panda():
    """Its links are where the arm's are; at rest its motors balance the gradient of the potential energy."""
    panda = load_arm("panda")
    model = runpy.run_path(str(FOLDER / PHYSICS), run_name="physics")["physical_panda"](panda)
    data = mujoco.MjData(model)
    rows = np.loadtxt(FOLDER / "panda_inertia.csv", delimiter=",")

    def energy(q):
        poses = np.stack([panda.restricted(frame=link).forward(q[: min(i + 1, 7)]) for i, link in enumerate(LINKS)])
        centres = np.einsum("nij,nj->ni", poses[:, :3, :3], rows[:, 1:4]) + poses[:, :3, 3]
        return 9.81 * rows[:, 0] @ centres[:, 2]

    for q in panda.sample(3, 1):
        data.qpos, data.ctrl, data.qvel = q, q, 0.0
        mujoco.mj_forward(model, data)
        assert_allclose(data.xpos[1:], panda.point_positions(q, LINKS), atol=1e-12)
        slope = [(energy(q + step) - energy(q - step)) / 2e-6 for step in 1e-6 * np.eye(7)]
        assert_allclose(data.qfrc_actuator, slope, atol=1e-6)
        assert_allclose(data.qacc, 0.0, atol=1e-6)
