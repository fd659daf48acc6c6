"""Real recordings, and one motion in every dialect and every format, go the whole way of ``maniport transfer``.

The verb is the real one; domains are small, motions of as many frames share one judgement, and no pictures are drawn:
none of these depends on where a recording comes from.
"""

import json
import shutil
from functools import cache, partial
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from dialect_files import BESIDE, POINTS, SKELETONS, mirrored, motion, write_bvh
from format_files import (
    DOWN,
    HIPS,
    SAUL,
    amass,
    landmarks,
    write_csv,
    write_json,
    write_mot,
    write_motive,
    write_mvnx,
    write_nexus,
    write_qualisys,
    write_trc,
)
from maniport.cli import app
from maniport.demonstrations import fit_arm, read_recording, shipped_recording
from maniport.demonstrations.readers.orders import MEDIAPIPE
from maniport.evaluation import evaluate
from maniport.files import load_ellipsoids
from maniport.pipeline import transfer_recording

DATA = Path(__file__).parent / "demonstrations" / "data"
METHOD = "recentring"
CLIPS = {
    **{file.name: (file, ("--fps", "30", "--stop", "1.17")) for file in sorted(DATA.glob("*.npy"))},
    **{file.name: (file, ()) for file in sorted(DATA.glob("*.bvh"))},
    "freeform.c3d": (shipped_recording("freeform"), ("--stop", "0.88")),
}
ONE_ARM = ("freeform.c3d", "ISB without side")
"""Those that hold the right arm alone."""

JOINTS = ("shoulder", "elbow", "wrist")
TRUNK = {"trunk_low": "pelvis", "trunk_high": "neck", "trunk_right": "shoulder_r", "trunk_left": "shoulder_l"}
BENEATH = ("Unreal", "MediaPipe")
"""Families of which the hand's point is not used: a bone's end along x, one finger of two."""

PERSON = cache(partial(motion, n=8))


@cache
def arm_of(side, *more):
    """Joint angles [deg] by shoulder, elbow, wrist, trunk and more points, under their plain names, without a file."""
    parts = {name: f"{name}_{side[0]}" for name in (*JOINTS, *more)}
    return np.degrees(fit_arm(PERSON().recording(parts | TRUNK), side=side).joint_angles)


COMMAND = cache(get_command)
"""The command line, made once."""
JUDGED = {}


def judged_once(adapter, teacher, student, profile, **options):
    """The judgement of the first motion of as many frames."""
    if len(profile) not in JUDGED:
        JUDGED[len(profile)] = evaluate(adapter, teacher, student, profile, **options)
    return JUDGED[len(profile)]


@pytest.fixture
def transfer(tmp_path):
    """Run the verb on a file for one arm; return the arm that was taken and its joint angles [deg]."""

    def small(*recording, **job):
        return transfer_recording(*recording, **job, n_teacher=32, n_student=64)

    def call(file, *options):
        out = tmp_path / f"out-{len(list(tmp_path.iterdir()))}"
        with (
            mock.patch("maniport.pipeline.transfer_recording", small),
            mock.patch("maniport.pipeline.work.evaluate", judged_once),
            mock.patch("maniport.telling.page.motions.motion_of"),
            mock.patch("maniport.telling.page.write_page"),
            mock.patch("typer.testing._get_command", COMMAND),
        ):
            words = ["transfer", str(file), "--no-move", "--no-collisions", "--method", METHOD, "-o", str(out)]
            result = CliRunner().invoke(app, [*words, *options])
        assert result.exit_code == 0, result.exception
        told = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        assert told["run"]["method"] == METHOD
        angles = np.loadtxt(out / "person.csv", delimiter=",", skiprows=1)[:, 1:]
        target, time = load_ellipsoids(out / "target_profile.npz")  # refuses what is not finite, or not SPD
        assert len(target) == len(time) == len(angles) == told["person"]["frames"]
        assert np.linalg.eigvalsh(target).min() > 0.0
        assert np.all(np.isfinite(angles))
        return told["person"]["side"], angles

    return call


def sides_of(name):
    """The arms that are in a file."""
    return ("right",) if name in ONE_ARM else ("right", "left")


@pytest.mark.parametrize("name", CLIPS)
def test_real_recordings(transfer, name):
    """Every clip is read as it is, and each arm that it holds becomes target ellipsoids of the robot."""
    file, options = CLIPS[name]
    for side in sides_of(name):
        taken, angles = transfer(file, *options, "--arm", side)
        assert taken == side
        assert np.ptp(angles, axis=0).max() > 5.0  # the arm moves


def points(family):
    """The motion under the names of a family, both arms where the names tell them apart."""
    names = POINTS[family]
    return PERSON().recording(names if family in ONE_ARM else mirrored(names))


def saved(family, path):
    """A family's names in our own format."""
    points(family).save(path)
    return path


FORMATS = {
    "trc": ("OpenCap", lambda folder, seen: write_trc(folder / "a.trc", seen)),
    "csv": ("COCO", lambda folder, seen: write_csv(folder / "a.csv", seen)),
    "csv with dots": ("COCO", lambda folder, seen: write_csv(folder / "a.csv", seen, dot=True)),
    "long csv": ("COCO", lambda folder, seen: write_csv(folder / "a.csv", seen, long=True)),
    "Motive's csv": ("Plug-in Gait", lambda folder, seen: write_motive(folder / "a.csv", seen)),
    "Nexus' csv": ("Plug-in Gait", lambda folder, seen: write_nexus(folder / "a.csv", seen)),
    "Qualisys' tsv": ("Plug-in Gait", lambda folder, seen: write_qualisys(folder / "a.tsv", seen)),
    "mvnx": ("MVNX", lambda folder, seen: write_mvnx(folder / "a.mvnx", seen)),
    "keypoints": (
        "MediaPipe",
        lambda folder, seen: write_json(folder / "a.json", landmarks(seen, MEDIAPIPE, DOWN, HIPS)),
    ),
}
"""What writes each format of points, and the family whose names it holds."""


def same_angles(transfer, file, family, parts, sides=None):
    """The right arm moves more and is taken; the angles of each arm are those of its points without a file."""
    seen = {part[:-2] for part in parts if part.endswith("_r")}
    more = ("hand",) if "hand" in seen and family not in BENEATH else ()
    more += BESIDE if "wrist_radial" in seen else ()
    for side in sides or sides_of(family):
        taken, angles = transfer(file, "--arm", "auto" if side == "right" else side)
        assert taken == side
        np.testing.assert_allclose(angles, arm_of(side, *more), atol=0.03)


@pytest.mark.parametrize("family", POINTS)
def test_names_of_points(transfer, tmp_path, family):
    """Every family of names tells the same motion of either arm."""
    same_angles(transfer, saved(family, tmp_path / "a.npz"), family, POINTS[family].values())


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", SKELETONS)
def test_skeletons(transfer, tmp_path, name, side):
    """Every program's BVH tells the same motion of either arm; the ends of the hands are in it."""
    file = write_bvh(tmp_path / "a.bvh", SKELETONS[name], PERSON())
    same_angles(transfer, file, name, ("hand_r",), (side,))


@pytest.mark.parametrize("name", FORMATS)
def test_formats_of_points(transfer, tmp_path, name):
    """Every format tells the same motion of either arm."""
    family, write = FORMATS[name]
    same_angles(transfer, write(tmp_path, points(family)), family, POINTS[family].values())


def test_c3d_in_the_format_of_tables(transfer, tmp_path):
    """The shipped C3D gives the same angles as OpenSim's table of its points."""
    whole = read_recording("freeform").crop(0, 0.18)
    table = write_trc(tmp_path / "a.trc", whole, "mm", 0.001)
    file = shutil.copy(shipped_recording("freeform"), tmp_path / "a.c3d")
    np.testing.assert_allclose(transfer(table)[1], transfer(file, "--stop", "0.18")[1], atol=2e-3)


def test_joint_angles_and_poses(transfer, tmp_path):
    """Joint angles come back as they are, poses of SMPL as the directions that they turn bones to."""
    made = PERSON()
    taken, angles = transfer(write_mot(tmp_path / "a.mot", made.time, made.joint_angles, SAUL))
    assert taken == "right"
    np.testing.assert_allclose(angles, np.degrees(made.joint_angles), atol=0.1)
    np.savez(tmp_path / "a.npz", **amass(made))
    same_angles(transfer, tmp_path / "a.npz", "AMASS", ("hand_r",))
