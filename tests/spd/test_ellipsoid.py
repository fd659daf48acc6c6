"""Ellipsoids: axes, lengths, volume, condition, Mandel vectors, and the directions of axes over time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.spd.ellipsoid import axis_over_time, line_angles


def test_singular_ellipsoids_have_axes_of_length_zero():
    flat = np.outer([1.0, 2.0, 2.0], [1.0, 2.0, 2.0])
    lengths, directions = spd.axes(flat)
    assert_allclose(lengths, [0.0, 0.0, 3.0], atol=1e-7)
    assert_allclose(np.abs(directions[:, -1]), np.array([1.0, 2.0, 2.0]) / 3.0, rtol=1e-12)
    assert_allclose(spd.volume(flat), 0.0, atol=1e-12)
    assert_array_equal(spd.lengths(np.zeros((3, 3))), np.zeros(3))


@pytest.fixture
def turning():
    """Ellipsoids that turn about z twice, with their major axis in the plane, and their axes."""
    angle = np.linspace(0, 4.0 * np.pi, 200)
    c = np.cos(angle)
    s = np.sin(angle)
    o = np.zeros(200)
    basis = np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, o + 1]]), 2, 0)
    return (basis * [9.0, 4.0, 1.0]) @ np.swapaxes(basis, 1, 2), basis


def test_a_turning_axis_is_followed_without_jumps(turning):
    points, basis = turning
    vectors = axis_over_time(points, -1)
    assert_allclose(vectors, basis[:, :, 0], atol=1e-12)
    assert_allclose(
        np.abs(axis_over_time(points, 0)),
        np.broadcast_to([0.0, 0.0, 1.0], vectors.shape),
        atol=1e-12,
    )


def test_sign_agrees_again_after_a_place_without_direction(turning):
    points, basis = turning
    like = axis_over_time(points, -1)
    broken = points.copy()
    broken[50:75] = np.eye(3)  # where the axis turns by a quarter
    vectors = axis_over_time(broken, -1, like)
    assert np.isnan(vectors[50:75]).all()
    assert_allclose(vectors[:50], basis[:50, :, 0], atol=1e-12)
    assert_allclose(vectors[75:], basis[75:, :, 0], atol=1e-12)
    leaping = np.concatenate([points[:50], points[75:]])
    assert_allclose(
        axis_over_time(leaping, -1, np.concatenate([like[:50], like[75:]]))[50:],
        like[75:],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("squares", "which"), [([1.0, 1.0, 4.0, 9.0], -1), ([1.0, 4.0, 9.0, 9.0], 0)]
)
def test_an_axis_has_a_direction_where_the_next_differs(squares, which):
    points = np.stack([np.diag(squares)] * 3)
    assert_array_equal(axis_over_time(points, which), np.broadcast_to(np.eye(4)[which], (3, 4)))
    assert np.isnan(axis_over_time(points, -1 - which)).all()


@pytest.mark.parametrize(("degrees", "flipped"), [(100.0, False), (119.0, False), (121.0, True)])
def test_sign_changes_only_where_two_profiles_are_opposite(degrees, flipped):
    """Once it agrees, an axis keeps its sign up to 120° from the other profile's."""
    angle = np.deg2rad(degrees)
    x = np.array([1.0, 0.0, 0.0])
    like = np.stack([x, np.array([np.cos(angle), np.sin(angle), 0.0])])
    points = np.stack([np.diag([9.0, 4.0, 1.0])] * 2)
    assert_array_equal(axis_over_time(points, -1, like), [x, -x if flipped else x])


@given(
    angle=st.one_of(st.floats(0.0, np.pi / 2), st.floats(1e-12, 1e-6)),
    sign=st.sampled_from([-1.0, 1.0]),
)
def test_angles_between_lines(angle, sign):
    """A line turned by an angle up to π/2 makes that angle with itself, whichever way it points, to all its digits."""
    x, y = np.eye(3)[:2]
    first = np.stack([x, x])
    other = sign * np.stack([np.cos(angle) * x + np.sin(angle) * y, x])
    assert_allclose(
        line_angles(first, other), [angle, 0.0], rtol=1e-9, atol=1e-150
    )  # below, squares vanish


def test_mandel_vectors_have_the_stated_order():
    """Diagonal first, then the rows of the upper triangle times √2."""
    matrix = np.array([[1.0, 4.0, 5.0], [4.0, 2.0, 6.0], [5.0, 6.0, 3.0]])
    assert_allclose(
        spd.to_vector(matrix), [1, 2, 3, 4 * 2**0.5, 5 * 2**0.5, 6 * 2**0.5], rtol=1e-15
    )


def test_numbers_of_single_matrices_are_floats():
    point = np.eye(3)
    other = 2.0 * np.eye(3)
    for value in (spd.distance(point, other), spd.volume(point), spd.inner(point, other, point)):
        assert isinstance(value, float)
    assert spd.distance(point, other) == pytest.approx(np.sqrt(3.0) * np.log(2.0), rel=1e-12)
    for values in (spd.distance(point[None], other), spd.volume(other[None])):
        assert values.shape == (1,)
