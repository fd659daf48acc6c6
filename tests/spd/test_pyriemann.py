"""The same numbers as pyRiemann, an independent implementation."""

import os

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd

if not os.environ.get("CI"):  # in CI a missing reference is a failure
    pytest.importorskip("pyriemann.geometry")

from pyriemann.geometry import distance, geodesic, mean, tangentspace

pytestmark = pytest.mark.parametrize("d", [2, 3, 6, 12])


@pytest.fixture
def pairs(d, random_spd):
    """Make two batches of points."""
    return random_spd(np.random.default_rng(d), (2, 8), d, condition=100.0)


def test_metric(d, pairs, random_symmetric):
    """Distance, geodesic, log, exp, inner product and transport agree."""
    a, b = pairs
    first, other = random_symmetric(np.random.default_rng(0), (2, 8), d)
    base = a[0]
    small = 0.1 * first
    table = {
        "distance": (spd.distance(a, b), distance.distance_riemann(a, b)),
        "geodesic": (spd.geodesic(a, b, 0.3), geodesic.geodesic_riemann(a, b, 0.3)),
        "log": (spd.log(base, b), tangentspace.log_map_riemann(b, base, C12=True)),
        "exp": (spd.exp(base, small), tangentspace.exp_map_riemann(small, base, Cm12=True)),
        "inner": (
            spd.inner(base, first, other),
            tangentspace.innerproduct_riemann(first, other, base),
        ),
        "transport": (
            spd.transport(first, base, b[0]),
            tangentspace.transport_riemann(first, base, b[0]),
        ),
    }
    for name, (result, expected) in table.items():
        assert_allclose(result, expected, rtol=1e-8, atol=1e-8, err_msg=name)


def test_mean(d, pairs):
    """The weighted Fréchet mean agrees."""
    points = pairs[0]
    weights = np.arange(1.0, 9.0)
    expected = mean.mean_riemann(points, tol=1e-12, maxiter=200, sample_weight=weights)
    assert_allclose(spd.mean(points, weights), expected, atol=1e-9)
