"""Directions of axes over time."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.spd.ellipsoid import axis_over_time


def turning(count=200, turns=2.0):
    """Make ellipsoids that turn about z, with their major axis in the plane."""
    angle = np.linspace(0, 2 * np.pi * turns, count)
    c, s, o = np.cos(angle), np.sin(angle), np.zeros(count)
    basis = np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, o + 1]]), 2, 0)
    return (basis * [9.0, 4.0, 1.0]) @ np.swapaxes(basis, 1, 2), basis


def test_a_turning_axis_is_followed_without_jumps():
    """Over two full turns the vector goes round with the axis, although eigenvectors have no sign."""
    points, basis = turning()
    vectors = axis_over_time(points, -1)
    assert_allclose(vectors, basis[:, :, 0], atol=1e-12)
    assert np.abs(np.diff(vectors, axis=0)).max() < 0.1
    assert_allclose(np.abs(axis_over_time(points, 0)), np.broadcast_to([0.0, 0.0, 1.0], vectors.shape), atol=1e-12)


def test_sign_agrees_again_after_a_place_without_direction():
    """What was flipped by a pause without direction, or by a leap of the axis, takes the other's sign again."""
    points, basis = turning()
    like = axis_over_time(points, -1)
    broken = points.copy()
    broken[50:75] = np.eye(3)  # meanwhile the axis turns by a quarter
    vectors = axis_over_time(broken, -1, like)
    assert_allclose(vectors[75:], basis[75:, :, 0], atol=1e-12)
    leaping = np.concatenate([points[:50], points[75:]])
    assert_allclose(axis_over_time(leaping, -1, np.concatenate([like[:50], like[75:]]))[50:], like[75:], atol=1e-12)


@pytest.mark.parametrize("which", [-1, 0])
def test_equal_axes_have_no_direction(which):
    """Where the axis and the next one have the same length the direction is nan, and the rest goes on."""
    points, _ = turning()
    points[50:60] = np.eye(3)
    vectors = axis_over_time(points, which)
    assert np.isnan(vectors[50:60]).all()
    assert np.isfinite(vectors[:50]).all()
    assert np.isfinite(vectors[60:]).all()
    assert np.isnan(axis_over_time(np.stack([np.eye(3)] * 4), which, vectors[:4])).all()
