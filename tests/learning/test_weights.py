"""Weights of a tracking task from the covariance of a profile, in the bases of both ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.learning import tracking_weights, weights_at
from maniport.learning.tangent import coordinates, on_vectors, turns


@pytest.fixture(scope="module")
def covariance():
    """Covariances (7, 6, 6) of different sizes."""
    factors = np.random.default_rng(0).standard_normal((7, 6, 6)) * np.linspace(0.1, 1.0, 7)[:, None, None]
    return factors @ np.swapaxes(factors, -1, -2)


def pairs(seed, n=9, spread=1.0):
    """Pairs of ellipsoids (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    return tuple(spd.expm(spd.from_vector(spread * rng.standard_normal((n, 6)))) for _ in range(2))


def test_weights_are_the_precision_without_damping(covariance):
    """Without damping the weights are proportional to the inverse covariance, and the root squares to them."""
    weights = tracking_weights(covariance, damping=0.0)
    ratio = weights @ covariance
    assert_allclose(ratio, ratio[0, 0, 0] * np.broadcast_to(np.eye(6), ratio.shape), atol=1e-7 * ratio[0, 0, 0])
    root = tracking_weights(covariance, damping=0.0, root=True)
    assert_allclose(root @ root, weights, rtol=1e-8, atol=1e-8)
    assert_allclose(root, np.swapaxes(root, -1, -2))


def test_coordinates_at_both_ends_differ_by_a_rotation():
    """The whitened log at one end is minus the turned whitened log at the other, at any distance."""
    wanted, achieved = pairs(1, spread=1.5)
    at_wanted, at_achieved = coordinates(wanted, achieved), coordinates(achieved, wanted)
    basis = on_vectors(turns(wanted, achieved))
    assert_allclose(np.einsum("nij,nj->ni", basis, at_wanted), -at_achieved, atol=1e-10)
    assert_allclose(basis @ np.swapaxes(basis, -1, -2), np.broadcast_to(np.eye(6), basis.shape), atol=1e-10)


def test_weighted_error_is_the_same_at_both_ends(covariance):
    """eᵀ W e of the tracking error at the achieved ellipsoids equals vᵀ C⁻¹ v at the wanted ones."""
    wanted, achieved = pairs(4, n=7)
    precision = np.linalg.inv(covariance)
    v, e = coordinates(wanted, achieved), coordinates(achieved, wanted)
    turned = weights_at(precision, wanted, achieved)
    assert_allclose(np.einsum("ni,nij,nj->n", e, turned, e), np.einsum("ni,nij,nj->n", v, precision, v), rtol=1e-7)
