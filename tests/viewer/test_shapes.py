"""Shapes of the page: ellipsoids, bones, and a robot's surface that moves with its joints."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from maniport import Arm, load_arm
from maniport.errors import FileFormatError
from maniport.viewer.panel import from_roll_pitch_yaw, roll_pitch_yaw
from maniport.viewer.scene import SIZE, find_surfaces, shell


def rotation_of_quaternion(wxyz):
    """Return the rotation matrix of a quaternion w, x, y, z."""
    return Rotation.from_quat(wxyz, scalar_first=True).as_matrix()


angle = st.floats(-180.0, 180.0)


@given(angle, angle, angle)
def test_roll_pitch_yaw_give_the_rotation_back(roll, pitch, yaw):
    """The angles on the sliders mean the rotation that is shown, also where they are not unique."""
    rotation = from_roll_pitch_yaw(np.array([roll, pitch, yaw]))
    assert from_roll_pitch_yaw(roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-7)


def test_a_scaled_and_turned_ball_is_the_ellipsoid():
    """Axes and turn put together give the matrix, in the size that it is drawn in."""
    root = np.random.default_rng(0).normal(size=(3, 3))
    semi_axes, turn = shell(root @ root.T)
    rotation = rotation_of_quaternion(turn)
    drawn = rotation @ np.diag(np.square(semi_axes)) @ rotation.T
    assert drawn == pytest.approx(SIZE**2 * root @ root.T)
    assert min(shell(np.diag([1.0, 0.5, 0.0]))[0]) > 0, "a flat ellipsoid can be seen"


@pytest.fixture
def panda():
    """The shipped robot, which brings its surface."""
    return load_arm("panda")


def test_why_a_robot_is_bare_is_told(panda, monkeypatch):
    """Missing meshes and descriptions without shapes leave a reason, in one line, and no error."""
    found, why = find_surfaces(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]]))
    assert (found, why) == ([()], "the description of planar names no shapes")

    def fail(self):
        raise FileFormatError("robot.urdf: a mesh is missing:\n  'hand.dae'")

    monkeypatch.setattr(Arm, "surfaces", fail)
    assert find_surfaces(panda) == ([()], "robot.urdf: a mesh is missing: 'hand.dae'")
