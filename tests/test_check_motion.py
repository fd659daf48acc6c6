"""The independent check of exported motions agrees with the package, and finds what was broken on purpose."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.bodies import load_arm
from maniport.files import save_ellipsoids, save_path
from maniport.tracking import TrackResult

SCRIPT = Path(__file__).parents[1] / "scripts/check_motion.py"
FIRST = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
LAST = FIRST + 0.4
FOLDED = np.array([0.0, -1.6, 0.0, -3.0, 0.0, 0.1, 0.0])
"""The hand within the first links."""


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
    motion = TrackResult.of_motion(arm, at, profile, time, q, path=path)
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


def export_both(folder, way):
    """Two arms that move alike, so far apart [m], as the folder of both holds it; return their bases."""
    bases = {"left": (0.0, 0.5 * way, 0.0, 90.0), "right": (0.0, -0.5 * way, 0.0, 90.0)}
    tables = []
    for side, base in bases.items():
        (folder / side).mkdir(parents=True)
        motion = export(folder / side)
        turned = motion.path @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        save_path(folder / side / "path.npz", turned + base[:3], motion.time)
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        save_ellipsoids(folder / side / "placed_profile.npz", turn @ motion.target @ turn.T, motion.time)
        header, *lines = (folder / side / "joints.csv").read_text().splitlines()
        tables.append(([name.replace("panda", f"{side}_panda") for name in header.split(",")],
                       np.array([line.split(",") for line in lines])))  # fmt: skip
    parts = [(name, table[:, i]) for names, table in tables for i, name in enumerate(names)]
    order = {"_rad": 1, "_rad/s": 2, "_rad/s2": 3}
    joints = sorted(
        (one for one in parts if one[0] != "time_s"), key=lambda one: order["_rad" + one[0].split("_rad")[1]]
    )
    columns = [parts[0], *joints]
    rows = [",".join(row) for row in np.stack([column for _, column in columns], axis=1)]
    (folder / "joints.csv").write_text("\n".join([",".join(name for name, _ in columns), *rows]))
    return bases


def verdicts(check, folder, tip=None):
    """What the check says of each row, by the first word of its name."""
    return {name.split(",")[0]: (said, within) for name, said, within in check.judge(folder, tip, None)}


def test_what_the_package_exports_is_what_mujoco_sees(check, tmp_path):
    """Kinematics, ellipsoids and distances of two programmes that share no code agree, and a calm motion passes."""
    export(tmp_path)
    found = verdicts(check, tmp_path)
    assert found["tip"][0].startswith("panda_hand_tcp")
    for name in ("d", "tip beside its path [mm]: same"):
        figures = found[name][0] if name in found else next(v[0] for k, v in found.items() if k.startswith(name))
        assert_allclose([float(part.split()[0]) for part in figures.split(" / ")], 0.0, atol=1e-3)
    assert all(within is not False for _, within in found.values())


def test_two_arms_stand_on_their_bases(check, tmp_path, monkeypatch):
    """Tips and ellipsoids of both are where their bases put them; arms too near one another are found to touch."""
    monkeypatch.setattr(check, "EVERY", 250)
    rows = {
        name: (said, within) for name, said, within in check.judge(tmp_path, None, None, export_both(tmp_path, 1.2))
    }
    figures = [
        float(said.split(" / ")[1]) for name, (said, _) in rows.items() if "d, damping" in name or "path" in name
    ]
    assert len(figures) == 4
    assert max(figures) < 1e-3
    assert all(within is not False for _, within in rows.values())
    said, within = check.judge(tmp_path / "near", None, None, export_both(tmp_path / "near", 0.4))[-1][1:]
    assert within is False
    assert "left_panda_" in said
    assert "right_panda_" in said


def test_distances_are_the_package_s(check):
    """Generalized eigenvalues give the distance that the package computes."""
    from maniport.spd import distance

    arm = load_arm("panda")
    a, b = (arm.manipulability(arm.sample(50, seed)) for seed in (1, 2))
    lift = 0.01 * np.eye(3)
    assert_allclose(check.distances(a, b, 0.01), distance(a + lift, b + lift), rtol=1e-9)


def _scaled(table):
    table[:, 4] *= 1.02


def _jump(table):
    table[500:, 2] += 0.01


def _cut_off(table):
    table[:, 1] += 0.5 * np.linspace(0.0, 1.0, len(table))


@pytest.mark.parametrize(
    ("change", "row", "beside"),
    [(_scaled, "tip beside its path [mm]: same", 1.0), (_jump, "jerk", None), (_cut_off, "at rest at both ends", None)],
)
def test_broken_files_are_found_out(check, tmp_path, change, row, beside):
    """A scaled joint shows in the tip, a jump in the jerk, a motion that is cut off in its ends."""
    export(tmp_path)
    broken(tmp_path, change)
    said, within = verdicts(check, tmp_path, "panda_hand_tcp")[row]
    assert within is False if beside is None else float(said.split()[0]) > beside


def test_an_arm_in_itself_is_found_out_and_the_programme_ends_with_1(check, tmp_path, monkeypatch, capsys):
    """A motion into the robot's own links is named, and the exit code says that something is wrong."""
    export(tmp_path, FOLDED, 2.0)
    monkeypatch.setattr(sys, "argv", ["check_motion.py", str(tmp_path), "--tip", "panda_hand_tcp"])
    with pytest.raises(SystemExit) as ended:
        check.main()
    line = next(line for line in capsys.readouterr().out.splitlines() if "self-collision" in line)
    assert ended.value.code == 1
    assert line.startswith("NO")
    assert "panda_" in line
