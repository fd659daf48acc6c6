"""The examples run as they are, say what they do, and the physics check holds."""

import ast
import re
import runpy
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from importlib import metadata
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.bodies import load_arm

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
PLACED, PHYSICS = "06_place_and_track.py", "08_replay_in_mujoco.py"
OPTIONS = {"10_live.py": ["--fast"]}
"""With which examples are run here."""
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


def run(script, *arguments, cwd):
    """Run a script the way a reader does."""
    command = [sys.executable, str(script), *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


@cache
def ran(name, folder):
    """Run an example once in a folder of its own."""
    empty = folder / f"{name} runs here"
    empty.mkdir()
    return run(FOLDER / name, folder / name / "results", *OPTIONS.get(name, ()), cwd=empty), list(empty.iterdir())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the examples write."""
    return tmp_path_factory.mktemp("examples")


@pytest.fixture(scope="module")
def physics():
    """What the physics example defines."""
    return runpy.run_path(str(FOLDER / PHYSICS), run_name="physics")


@pytest.fixture(scope="module")
def panda():
    """The Panda with its hand."""
    return load_arm("panda")


@pytest.mark.parametrize("name", [example.name for example in EXAMPLES if example.name != PLACED])
def test_example_runs(name, folder):
    """It ends well, prints something and no warning, and writes into the folder that it is given and nowhere else."""
    result, beside = ran(name, folder)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip()
    assert "Warning" not in result.stderr
    assert not beside
    assert any((folder / name / "results").iterdir())


def test_the_motion_that_physics_replays_is_made_and_written(folder):
    """Example 06 runs whole within 08, which asks for its motion; alone it would start as 05 does."""
    result, _ = ran(PHYSICS, folder)
    assert all(f"\n{word}" in f"\n{result.stdout}" for word in ("person: ", "d ", "hand ", "jerk ", "joints in "))
    assert (folder / PHYSICS / "results" / "joints.csv").stat().st_size > 10_000
    lines = [(FOLDER / name).read_text(encoding="utf-8").splitlines() for name in (PLACED, "05_follow_a_profile.py")]
    assert lines[0][-2:] == lines[1][-2:]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_example_is_short_and_says_what_one_learns(example):
    """It has fewer than 80 lines and a docstring with more than a title, and the index lists it."""
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 80
    assert len((ast.get_docstring(ast.parse(text)) or "").splitlines()) >= 3
    assert f"({example.name})" in (FOLDER / "README.md").read_text(encoding="utf-8")


def test_motion_survives_physics(folder):
    """Simulated, d changes by less than 0.02 (95 %), no motor comes to its limit, and feed-forward helps."""
    output = ran(PHYSICS, folder)[0].stdout
    without, change = map(float, re.findall(r"change of d ([\d.]+)", output))
    assert change < 0.02
    assert change < without
    assert all(int(share) < 100 for share in re.findall(r"torque (\d+)%", output))


def test_motion_that_does_not_survive_is_told(tmp_path):
    """A motion that the motors cannot make ends with a non-zero exit code and a sentence."""
    for name in (PHYSICS, "panda_inertia.csv"):
        shutil.copy(FOLDER / name, tmp_path)
    (tmp_path / PLACED).write_text(VIOLENT, encoding="utf-8")
    result = run(tmp_path / PHYSICS, tmp_path / "results", cwd=tmp_path)
    assert result.returncode != 0
    assert "does not survive physics" in result.stderr
    assert "Traceback" not in result.stderr


def test_physical_panda_has_the_arm_kinematics(physics, panda):
    """The links of the MuJoCo model are where those of the arm are."""
    model = physics["physical_panda"](panda)
    data = mujoco.MjData(model)
    for q in panda.sample(5, 0):
        data.qpos = q
        mujoco.mj_kinematics(model, data)
        assert_allclose(data.xpos[1:], panda.point_positions(q, LINKS), atol=1e-12)


def test_motors_of_the_physical_panda_carry_its_weight(physics, panda):
    """At rest the motors' torques are the slope of the potential energy, and nothing moves."""
    model = physics["physical_panda"](panda)
    data = mujoco.MjData(model)
    rows = np.loadtxt(FOLDER / "panda_inertia.csv", delimiter=",")

    def energy(q):
        poses = np.stack([panda.restricted(frame=link).forward(q[: min(i + 1, 7)]) for i, link in enumerate(LINKS)])
        centres = np.einsum("nij,nj->ni", poses[:, :3, :3], rows[:, 1:4]) + poses[:, :3, 3]
        return 9.81 * rows[:, 0] @ centres[:, 2]

    for q in panda.sample(3, 1):
        data.qpos, data.ctrl, data.qvel = q, q, 0.0
        mujoco.mj_forward(model, data)
        slope = [(energy(q + step) - energy(q - step)) / 2e-6 for step in 1e-6 * np.eye(7)]
        assert_allclose(data.qfrc_actuator, slope, atol=1e-6)
        assert_allclose(data.qacc, 0.0, atol=1e-6)


def test_inertia_is_that_of_the_urdf():
    """Mass, centre and inertia of each link are those of example-robot-data's Panda, where it is installed."""
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    path = next(file.locate() for file in files if file.name == "panda.urdf")
    links = {link.get("name"): link.find("inertial") for link in ElementTree.parse(path).getroot().iter("link")}
    for name, row in zip(LINKS, np.loadtxt(FOLDER / "panda_inertia.csv", delimiter=","), strict=True):
        inertial = links[name]
        tensor = inertial.find("inertia")
        assert row[0] == float(inertial.find("mass").get("value"))
        assert_allclose(row[1:4], [float(x) for x in inertial.find("origin").get("xyz").split()])
        assert_allclose(row[4:], [float(tensor.get(f"i{axes}")) for axes in ("xx", "yy", "zz", "xy", "xz", "yz")])
