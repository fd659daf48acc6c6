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


@pytest.mark.parametrize(("ours", "suffix"), [(spd, "riemann"), (log_euclidean, "logeuclid")], ids=["AI", "LE"])
def test_metric(d, pairs, ours, suffix, random_symmetric):
    """Distance, geodesic, log, exp, inner product and transport of both metrics agree."""
    a, b = pairs
    first, other = random_symmetric(np.random.default_rng(0), (2, 8), d)
    base, small = a[0], 0.1 * first
    whitened = ({"C12": True}, {"Cm12": True}) if ours is spd else ({}, {})
    table = {
        "distance": (ours.distance(a, b), getattr(distance, f"distance_{suffix}")(a, b)),
        "geodesic": (ours.geodesic(a, b, 0.3), getattr(geodesic, f"geodesic_{suffix}")(a, b, 0.3)),
        "log": (ours.log(base, b), getattr(tangentspace, f"log_map_{suffix}")(b, base, **whitened[0])),
        "exp": (ours.exp(base, small), getattr(tangentspace, f"exp_map_{suffix}")(small, base, **whitened[1])),
        "inner": (ours.inner(base, first, other), getattr(tangentspace, f"innerproduct_{suffix}")(first, other, base)),
        "transport": (
            ours.transport(first, base, b[0]),
            getattr(tangentspace, f"transport_{suffix}")(first, base, b[0]),
        ),
    }
    for name, (result, expected) in table.items():
        assert_allclose(result, expected, rtol=1e-8, atol=1e-8, err_msg=name)


def test_mean(d, pairs):
    """The weighted Fréchet mean agrees."""
    points, weights = pairs[0], np.arange(1.0, 9.0)
    expected = mean.mean_riemann(points, tol=1e-12, maxiter=200, sample_weight=weights)
    assert_allclose(spd.mean(points, weights), expected, atol=1e-9)
