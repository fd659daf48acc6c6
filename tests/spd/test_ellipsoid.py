"""Ellipsoids: axes, lengths, volume, condition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd

sizes = pytest.mark.parametrize(("d", "shape"), [(2, ()), (3, (5,)), (6, (2, 3)), (12, (5,))])
seeds = given(seed=st.integers(0, 2**32 - 1))


@sizes
@seeds
def test_axes_rebuild_the_matrix(d, shape, seed, random_spd):
    """Lengths are ascending, directions orthonormal, and together they give the matrix back."""
    x = random_spd(np.random.default_rng(seed), shape, d)
    lengths, directions = spd.axes(x)
    assert np.all(np.diff(lengths, axis=-1) >= 0)
    identity = np.swapaxes(directions, -1, -2) @ directions
    assert_allclose(identity, np.broadcast_to(np.eye(d), x.shape), atol=1e-13)
    assert_allclose((directions * lengths[..., None, :] ** 2) @ np.swapaxes(directions, -1, -2), x, atol=1e-12)
    assert_array_equal(spd.lengths(x), lengths)


@sizes
@seeds
def test_end_points_of_the_axes_lie_on_the_ellipsoid(d, shape, seed, random_spd):
    """Every semi-axis v satisfies vᵀ M⁻¹ v = 1."""
    x = random_spd(np.random.default_rng(seed), shape, d)
    lengths, directions = spd.axes(x)
    ends = np.swapaxes(directions * lengths[..., None, :], -1, -2)
    assert_allclose(np.einsum("...ai,...ij,...aj->...a", ends, np.linalg.inv(x), ends), 1.0, rtol=1e-9)


@sizes
@seeds
def test_condition_and_volume_follow_the_eigenvalues(d, shape, seed, random_spd):
    """The condition number is NumPy's, it ignores scale, and the volume grows by |det C| under congruence."""
    rng = np.random.default_rng(seed)
    x = random_spd(rng, shape, d)
    assert_allclose(spd.condition(x), np.linalg.cond(x), rtol=1e-9)
    assert_allclose(spd.condition(4.0 * x), spd.condition(x), rtol=1e-9)
    c = np.eye(d) + 0.1 * rng.standard_normal((d, d))
    assert_allclose(spd.volume(c @ x @ c.T), abs(np.linalg.det(c)) * spd.volume(x), rtol=1e-8)


def test_volume_of_known_bodies():
    """A disc has area π a b, a ball volume 4/3 π r³, and the unit ball in four dimensions π² / 2."""
    assert_allclose(spd.volume(np.diag([4.0, 9.0])), 6.0 * np.pi, rtol=1e-14)
    assert_allclose(spd.volume(4.0 * np.eye(3)), 4 / 3 * np.pi * 8.0, rtol=1e-14)
    assert_allclose(spd.volume(np.eye(4)), np.pi**2 / 2, rtol=1e-14)


def test_singular_ellipsoids_have_axes_of_length_zero():
    """A flat ellipsoid has a zero axis and no volume, but its condition number is refused."""
    flat = np.outer([1.0, 2.0, 2.0], [1.0, 2.0, 2.0])
    lengths, directions = spd.axes(flat)
    assert_allclose(lengths, [0.0, 0.0, 3.0], atol=1e-7)
    assert_allclose(np.abs(directions[:, -1]), np.array([1.0, 2.0, 2.0]) / 3.0, rtol=1e-12)
    assert_allclose(spd.volume(flat), 0.0, atol=1e-12)
    assert_array_equal(spd.lengths(np.zeros((3, 3))), np.zeros(3))
    with pytest.raises(ValueError, match="points is singular"):
        spd.condition(flat)


def test_empty_batch_has_no_axes():
    """No ellipsoids in, no numbers out."""
    empty = np.zeros((0, 3, 3))
    assert spd.lengths(empty).shape == (0, 3)
    assert spd.volume(empty).shape == spd.condition(empty).shape == (0,)
