"""The same numbers as pyRiemann, an independent implementation, to what both can compute."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.spd import log_euclidean

if not os.environ.get("CI"):  # in CI a missing reference is a failure
    pytest.importorskip("pyriemann.geometry")

from pyriemann.geometry import distance, geodesic, mean, tangentspace

pytestmark = pytest.mark.parametrize("d", [2, 3, 6, 12])


@pytest.fixture
def pairs(d, random_spd):
    """Make two batches of points."""
    return random_spd(np.random.default_rng(d), (2, 8), d, condition=100.0)


def test_affine_invariant_metric(d, pairs, random_symmetric):
    """Distance, geodesic, log, exp, inner product and transport of the affine-invariant metric agree."""
    a, b = pairs
    one, two = random_symmetric(np.random.default_rng(0), (2, 8), d)
    assert_allclose(spd.distance(a, b), distance.distance_riemann(a, b), rtol=1e-9)
    assert_allclose(spd.geodesic(a, b, 0.3), geodesic.geodesic_riemann(a, b, 0.3), atol=1e-9)
    base = a[0]
    assert_allclose(spd.log(base, b), tangentspace.log_map_riemann(b, base, C12=True), atol=1e-9)
    small = 0.1 * one
    assert_allclose(spd.exp(base, small), tangentspace.exp_map_riemann(small, base, Cm12=True), atol=1e-9)
    assert_allclose(spd.inner(base, one, two), tangentspace.innerproduct_riemann(one, two, base), rtol=1e-8, atol=1e-8)
    assert_allclose(spd.transport(one, base, b[0]), tangentspace.transport_riemann(one, base, b[0]), atol=1e-8)


def test_log_euclidean_metric(d, pairs, random_symmetric):
    """Distance, geodesic, log, exp, inner product and transport of the log-Euclidean metric agree."""
    a, b = pairs
    one, two = random_symmetric(np.random.default_rng(0), (2, 8), d)
    assert_allclose(log_euclidean.distance(a, b), distance.distance_logeuclid(a, b), rtol=1e-9)
    assert_allclose(log_euclidean.geodesic(a, b, 0.3), geodesic.geodesic_logeuclid(a, b, 0.3), atol=1e-9)
    base = a[0]
    assert_allclose(log_euclidean.log(base, b), tangentspace.log_map_logeuclid(b, base), atol=1e-9)
    small = 0.1 * one
    assert_allclose(log_euclidean.exp(base, small), tangentspace.exp_map_logeuclid(small, base), atol=1e-9)
    expected = tangentspace.innerproduct_logeuclid(one, two, base)
    assert_allclose(log_euclidean.inner(base, one, two), expected, rtol=1e-8, atol=1e-8)
    moved = tangentspace.transport_logeuclid(one, base, b[0])
    assert_allclose(log_euclidean.transport(one, base, b[0]), moved, atol=1e-8)


def test_mean(d, pairs):
    """The weighted Fréchet mean agrees."""
    points, weights = pairs[0], np.arange(1.0, 9.0)
    expected = mean.mean_riemann(points, tol=1e-12, maxiter=200, sample_weight=weights)
    assert_allclose(spd.mean(points, weights), expected, atol=1e-9)
