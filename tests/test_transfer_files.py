"""Real recordings, and one motion in every format and under every family of names, give the person's joint angles."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dialect_files import BESIDE, POINTS, mirrored, motion
from maniport.mocap import fit_arm, read_recording
from maniport.mocap.marker_sets import load_names

pytestmark = pytest.mark.filterwarnings("default::maniport.errors.ManiportWarning")
DATA = Path(__file__).parent / "mocap" / "data"
CLIPS = {
    **{file.name: (file, {"rate": 30.0}, 1.17) for file in sorted(DATA.glob("*.npy"))},
    **{file.name: (file, {}, None) for file in sorted(DATA.glob("*.bvh"))},
}
MEDIAPIPE = load_names("joint_orders.yaml")["by_count"][33]
ONE_ARM = ("ISB without side",)  # families of names without sides
TRUNK = {"trunk_low": "pelvis", "trunk_high": "neck", "trunk_right": "shoulder_r", "trunk_left": "shoulder_l"}
WITHOUT_HAND = ("Unreal", "MediaPipe")  # families whose point of the hand is not used
PERSON = cache(lambda: motion(n=8))


def angles_in(file, side="auto", **options):
    """Return the joint angles [deg] of an arm in a file, by default of the one that moves more, and its side."""
    fit = fit_arm(read_recording(file, **options), side=side)
    return np.degrees(fit.joint_angles), fit.arm.side


@cache
def expected_angles(side, *more):
    """Return joint angles [deg] by shoulder, elbow, wrist, trunk and more points, without a file."""
    parts = {name: f"{name}_{side[0]}" for name in ("shoulder", "elbow", "wrist", *more)}
    return np.degrees(fit_arm(PERSON().recording(parts | TRUNK), side=side).joint_angles)


def points(family):
    """Return the motion under the names of a family, both arms where the names tell them apart."""
    return PERSON().recording(POINTS[family] if family in ONE_ARM else mirrored(POINTS[family]))


def check_angles(file, family, parts, sides=("right", "left")):
    """The right arm moves more and is the default; each arm has the angles of its points without a file."""
    measured = {part[:-2] for part in parts if part.endswith("_r")}
    more = ("hand",) if "hand" in measured and family not in WITHOUT_HAND else ()
    more += BESIDE if "wrist_radial" in measured else ()
    for side in sides[:1] if family in ONE_ARM else sides:
        angles, found = angles_in(file, "auto" if side == "right" else side)
        assert found == side
        np.testing.assert_allclose(angles, expected_angles(side, *more), atol=0.03)


@pytest.mark.parametrize("name", CLIPS)
def test_real_recordings(name):
    """Each arm is fitted, and it moves."""
    file, options, stop = CLIPS[name]
    recording = read_recording(file, **options)
    for side in ("right", "left"):
        angles = np.degrees(fit_arm(recording if stop is None else recording.crop(0, stop), side=side).joint_angles)
        assert np.all(np.isfinite(angles))
        assert np.ptp(angles, axis=0).max() > 5.0


@pytest.mark.parametrize("family", POINTS)
def test_names_of_points(tmp_path, family):
    """Every family of names."""
    points(family).save(tmp_path / "a.npz")
    check_angles(tmp_path / "a.npz", family, POINTS[family].values())
