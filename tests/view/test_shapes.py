"""Shapes in space as numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from maniport.view.bodies import SIZE, bones, from_roll_pitch_yaw, quaternion, rings, roll_pitch_yaw, rotation_of, shell

angle = st.floats(-180.0, 180.0)


@given(angle, angle, angle)
def test_roll_pitch_yaw_give_the_rotation_back(roll, pitch, yaw):
    """The angles on the sliders mean the rotation that is shown, also where they are not unique."""
    rotation = from_roll_pitch_yaw(np.array([roll, pitch, yaw]))
    assert from_roll_pitch_yaw(roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-7)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_roll_pitch_yaw_at_the_poles(pitch):
    """Straight up and down, where roll and yaw turn about one axis, the rotation comes back too."""
    rotation = from_roll_pitch_yaw(np.array([30.0, pitch, -50.0]))
    assert from_roll_pitch_yaw(roll_pitch_yaw(rotation)) == pytest.approx(rotation, abs=1e-7)


def test_quaternions_give_the_rotation_back():
    """The scalar comes first, as the page wants it."""
    assert quaternion(np.eye(3)) == pytest.approx([1, 0, 0, 0])
    rotation = Rotation.random(random_state=0).as_matrix()
    assert rotation_of(quaternion(rotation)) == pytest.approx(rotation)
    both = np.array([np.eye(3), rotation])
    assert rotation_of(quaternion(both)) == pytest.approx(both)


def test_a_scaled_and_turned_ball_is_the_ellipsoid():
    """Axes and turn put together give the matrix, in the size that it is drawn in."""
    root = np.random.default_rng(0).normal(size=(3, 3))
    semi_axes, turn = shell(root @ root.T)
    rotation = rotation_of(turn)
    drawn = rotation @ np.diag(np.square(semi_axes)) @ rotation.T
    assert drawn == pytest.approx(SIZE**2 * root @ root.T)


def test_rings_are_three_closed_lines_about_the_ball():
    """Each line starts where the one before it ends; all corners lie a trace outside, in a plane of symmetry."""
    lines = rings(16).reshape(3, 16, 2, 3)
    assert lines[:, :, 1] == pytest.approx(np.roll(lines[:, :, 0], -1, axis=1))
    assert np.linalg.norm(lines, axis=-1) == pytest.approx(1.0, abs=0.01)
    assert np.linalg.norm(lines, axis=-1).min() > 1.0
    assert sorted(np.abs(lines).max(axis=(1, 2)).argmin(axis=-1)) == [0, 1, 2]


def test_a_flat_ellipsoid_can_be_drawn():
    """The ellipsoid of a stretched arm has a thickness that is still to be seen."""
    assert min(shell(np.diag([1.0, 0.5, 0.0]))[0]) > 0


def test_bones_lie_along_the_polyline():
    """A bone's z axis, times its length, leads from each point to the next, in all directions."""
    points = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 0.5], [1, 2, 0.5], [1, 2, 0.5], [0.3, 0.2, 0.1]], dtype=float)
    turns, starts, lengths = bones(points)
    ends = starts + lengths[:, None] * np.array([rotation_of(turn)[:, 2] for turn in turns])
    assert ends == pytest.approx(points[1:], abs=1e-5)
