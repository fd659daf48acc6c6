"""Laws of the Fréchet mean, dispersion and whitening."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import InvalidInputError

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
    ("function", "arguments", "word"),
    [
        (spd.dispersion, {"kind": "median"}, "kind"),
        (spd.dispersion, {"center": np.stack([np.eye(3)] * 2)}, "center"),
        (spd.dispersion, {"center": np.eye(2)}, "center"),
        (spd.mean, {"weights": [1.0, 1.0]}, "weights"),
        (spd.mean, {"weights": [1.0, 1.0, -1.0, 1.0]}, "weights"),
        (spd.mean, {"weights": np.zeros(4)}, "weights"),
        (spd.mean, {"weights": [1.0, np.nan, 1.0, 1.0]}, "weights"),
        (spd.mean, {"tol": 0.0}, "tol"),
        (spd.mean, {"max_iter": 0}, "max_iter"),
    ],
)
def test_wrong_arguments_are_refused_by_name(function, arguments, word):
    """Weights, centers, tolerances and limits."""
    with pytest.raises(InvalidInputError, match=word):
        function(np.stack([np.eye(3)] * 4), **arguments)
