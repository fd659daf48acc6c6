"""Laws of the Fréchet mean, dispersion and whitening."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport import spd

sizes = pytest.mark.parametrize("d", [2, 3, 6, 12])


def seeds(test):
    """Run a test on a few seeds."""
    return settings(max_examples=5)(given(seed=st.integers(0, 2**32 - 1))(test))


@sizes
@seeds
def test_gradient_vanishes_at_the_mean(d, seed, random_spd):
    """Seen from the mean, the weighted tangents to the points sum to zero."""
    rng = np.random.default_rng(seed)
    x, weights = random_spd(rng, (7,), d), rng.uniform(0.1, 1.0, 7)
    center = spd.mean(x, weights)
    gradient = np.einsum("n,nij->ij", weights / weights.sum(), spd.log(center, x))
    assert np.sqrt(spd.inner(center, gradient, gradient)) < 1e-9


@sizes
@seeds
def test_integer_weights_are_repetitions(d, seed, random_spd):
    """A point of weight two counts like the point twice, one of weight zero like no point, at any common scale."""
    x = random_spd(np.random.default_rng(seed), (4,), d)
    repeated = spd.mean(x[[0, 1, 1, 2, 2, 2]])
    assert_allclose(spd.distance(spd.mean(x, weights=[1, 2, 3, 0]), repeated), 0.0, atol=1e-9)
    assert_allclose(spd.distance(spd.mean(x, weights=[10, 20, 30, 0]), repeated), 0.0, atol=1e-9)


@sizes
@seeds
def test_mean_of_two_lies_on_their_geodesic(d, seed, random_spd):
    """The mean of two points is the midpoint of their geodesic; weights divide it."""
    a, b = random_spd(np.random.default_rng(seed), (2,), d)
    assert_allclose(spd.distance(spd.mean([a, b]), spd.geodesic(a, b, 0.5)), 0.0, atol=1e-9)
    assert_allclose(spd.distance(spd.mean([a, b], weights=[0.7, 0.3]), spd.geodesic(a, b, 0.3)), 0.0, atol=1e-9)


def test_dispersion_kinds(random_spd):
    """Dispersion is the mean distance from the mean, or the root of the mean squared distance, which is larger."""
    x = random_spd(np.random.default_rng(0), (6,), 3)
    distances = spd.distance(spd.mean(x), x)
    assert_allclose(spd.dispersion(x), distances.mean(), rtol=1e-12)
    assert_allclose(spd.dispersion(x, kind="rms"), np.sqrt(np.mean(distances**2)), rtol=1e-12)
    assert spd.dispersion(x, kind="rms") > spd.dispersion(x)
    assert_allclose(spd.dispersion(x[:1]), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "median"}, r"unknown kind 'median'"),
        ({"center": np.stack([np.eye(3)] * 2)}, r"center must be one matrix.*found shape \(2, 3, 3\)"),
        ({"center": np.eye(2)}, r"center must hold 3×3 matrices; found 2×2"),
    ],
)
def test_dispersion_names_what_is_wrong(arguments, message):
    """A wrong kind or centre is refused with what was found and what is allowed."""
    with pytest.raises(ValueError, match=message):
        spd.dispersion(np.stack([np.eye(3)] * 4), **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"weights": [1.0, 1.0]}, r"weights must have shape \(4,\), one for each point; found shape \(2,\)"),
        ({"weights": [1.0, 1.0, -1.0, 1.0]}, r"weights must be non-negative.*found minimum -1"),
        ({"weights": np.zeros(4)}, r"weights must be .*positive sum; found minimum 0, maximum 0"),
        ({"weights": [1.0, np.nan, 1.0, 1.0]}, r"weights must be finite; found nan at index 1"),
        ({"tol": 0.0}, r"tol must be a number above 0; found 0.0"),
        ({"max_iter": 0}, r"max_iter must be a whole number of at least 1; found 0"),
    ],
)
def test_mean_names_what_is_wrong(arguments, message):
    """Wrong weights, tolerance or limit are refused with what was found and what is allowed."""
    with pytest.raises(ValueError, match=message):
        spd.mean(np.stack([np.eye(3)] * 4), **arguments)
