"""The same motion, as many programs write it, gives the same joint angles."""

import numpy as np
import pytest

from dialect_files import SKELETONS, mirrored, motion, write_bvh
from maniport.mocap import fit_arm, read_recording

JOINTS = {"shoulder": "shoulder_r", "elbow": "elbow_r", "wrist": "wrist_r"}
TRUNK = {"trunk_low": "pelvis", "trunk_high": "neck", "trunk_right": "shoulder_r", "trunk_left": "shoulder_l"}


@pytest.fixture(scope="module")
def made():
    """A right arm moves."""
    return motion()


@pytest.fixture(scope="module")
def plain(made):
    """Joint angles from the points themselves, without a file."""
    return fit_arm(made.recording({**JOINTS, **TRUNK})).joint_angles


@pytest.mark.parametrize("name", SKELETONS)
def test_every_skeleton_gives_the_points_and_angles_of_the_motion(tmp_path, made, plain, name):
    """Names, bone axes, rotation order, unit and axis up are recognised: points and angles are those of the motion."""
    skeleton = SKELETONS[name]
    recording = read_recording(write_bvh(tmp_path / "a.bvh", skeleton, made))
    assert recording.up == skeleton.up
    turn = np.eye(3)[[1, 2, 0]] if skeleton.up == "y" else np.eye(3)
    for point, part in mirrored(skeleton.names).items():
        np.testing.assert_allclose(recording.point(point), made.parts[part] @ turn.T, atol=2e-6)
    fit = fit_arm(recording, markers={"hand": None}, side="right")
    np.testing.assert_allclose(fit.joint_angles, plain, atol=1e-4)
