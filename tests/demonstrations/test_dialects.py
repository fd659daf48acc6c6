"""The same motion, as many programs write it, gives the same joint angles."""

import numpy as np
import pytest
from dialect_files import SKELETONS, mirrored, motion, roles_of, write_bvh

from maniport.demonstrations import fit_arm, read_recording

JOINTS = {"shoulder": "shoulder_r", "elbow": "elbow_r", "wrist": "wrist_r"}
TRUNK = {"trunk_low": "pelvis", "trunk_high": "neck", "trunk_right": "shoulder_r", "trunk_left": "shoulder_l"}


@pytest.fixture(scope="module")
def made():
    """A right arm moves."""
    return motion()


def plain(made, parts):
    """Joint angles from the points themselves, without a file."""
    return fit_arm(made.recording({**parts, **TRUNK})).joint_angles


@pytest.mark.parametrize("name", SKELETONS)
def test_every_skeleton_has_the_points_of_the_motion(tmp_path, made, name):
    """Whatever the names, bone axes, rotation order, unit and axis up: the points are where they were."""
    skeleton = SKELETONS[name]
    unit = {0.01: "cm", 0.001: "mm"}.get(skeleton.unit, "CMU")
    recording = read_recording(write_bvh(tmp_path / "a.bvh", skeleton, made), unit=unit, up=skeleton.up)
    turn = np.eye(3)[[1, 2, 0]] if skeleton.up == "y" else np.eye(3)
    for point, part in mirrored(skeleton.names).items():
        np.testing.assert_allclose(recording.point(point), made.parts[part] @ turn.T, atol=2e-6)


@pytest.mark.parametrize("name", ["LAFAN1", "Xsens", "Unreal", "Motive"])
def test_every_skeleton_gives_the_same_joint_angles(tmp_path, made, name):
    """Joint angles are those of the points themselves, to the rounding of the file."""
    skeleton = SKELETONS[name]
    unit = {0.01: "cm", 0.001: "mm"}[skeleton.unit]
    recording = read_recording(write_bvh(tmp_path / "a.bvh", skeleton, made), unit=unit, up=skeleton.up)
    fit = fit_arm(recording, markers={**roles_of(mirrored(skeleton.names)), "hand": None})
    np.testing.assert_allclose(fit.joint_angles, plain(made, JOINTS), atol=1e-4)


def test_a_left_motion_is_the_mirror_image_of_the_right_one(made):
    """Every part of one side is that of the other, seen in a mirror."""
    left = motion("left")
    np.testing.assert_allclose(left.parts["wrist_l"] * [1, -1, 1], made.parts["wrist_r"], atol=1e-12)
    np.testing.assert_allclose(left.parts["neck"] * [1, -1, 1], made.parts["neck"], atol=1e-12)
