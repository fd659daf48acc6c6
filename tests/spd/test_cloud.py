"""Tests of the distance between clouds."""

import numpy as np
import pytest
from scipy import stats

from maniport import spd
from maniport.spd import cloud


@pytest.fixture
def rng():
    """A generator of random numbers."""
    return np.random.default_rng(20)


def energy_distance(a, b):
    """Energy distance of two clouds, about the mean of the second."""
    center = spd.mean(b)
    return cloud.energy_between(cloud.log_vectors(a, center), cloud.log_vectors(b, center))


def test_agrees_with_scipy_on_clouds_of_balls():
    """Balls exp(t) I are a line: the energy distance is √d times SciPy's (squared) of the numbers t."""
    rng = np.random.default_rng(0)
    t, u = rng.normal(0.0, 1.0, 40), rng.normal(0.5, 2.0, 70)
    expected = np.sqrt(3.0) * stats.energy_distance(t, u) ** 2
    balls = [np.exp(values)[:, None, None] * np.eye(3) for values in (t, u)]
    assert energy_distance(*balls) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("d", [2, 3, 6])
def test_is_zero_only_for_equal_clouds(random_spd, rng, d):
    """Order does not matter, and any difference between two clouds is seen."""
    a = random_spd(rng, (60,), d)
    assert energy_distance(a, rng.permutation(a)) == pytest.approx(0.0, abs=1e-12)
    moved = a.copy()
    moved[0] = 1.1 * moved[0]
    assert energy_distance(moved, a) > 1e-6


def test_does_not_change_under_congruence(random_spd, rng):
    """X → G X Gᵀ of both clouds is an isometry, and the default center moves along."""
    a, b = random_spd(rng, (30,), 3), random_spd(rng, (50,), 3)
    g = rng.standard_normal((3, 3)) + 2.0 * np.eye(3)
    moved = [g @ points @ g.T for points in (a, b)]
    moved = [0.5 * (points + np.swapaxes(points, -1, -2)) for points in moved]
    assert energy_distance(*moved) == pytest.approx(energy_distance(a, b), rel=1e-6)


def test_log_vectors_keep_distances_to_the_centre_and_shorten_others(random_spd, rng):
    """|x| = d(X, C), and |x − y| ≤ d(X, Y)."""
    points, center = random_spd(rng, (40,), 3), random_spd(rng, (), 3)
    vectors = cloud.log_vectors(points, center)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), spd.distance(center, points), rtol=1e-10)
    chords = np.linalg.norm(vectors[:, None] - vectors[None], axis=-1)
    assert np.all(chords <= spd.distance(points[:, None], points[None]) + 1e-9)
