"""Weights of a tracking task, and the rotation of tangent coordinates from one end of a geodesic to the other."""

import numpy as np
from numpy.testing import assert_allclose

from maniport import spd
from maniport.learning import tracking_weights
from maniport.learning.mixture import coordinates, on_vectors, turns


def test_weights_are_the_precision_without_damping():
    factors = np.random.default_rng(0).standard_normal((7, 6, 6)) * np.linspace(0.1, 1.0, 7)[:, None, None]
    covariance = factors @ np.swapaxes(factors, -1, -2)
    ratio = tracking_weights(covariance, damping=0.0) @ covariance
    assert_allclose(ratio, ratio[0, 0, 0] * np.broadcast_to(np.eye(6), ratio.shape), atol=1e-7 * ratio[0, 0, 0])


def test_coordinates_at_both_ends_differ_by_a_rotation():
    wanted, achieved = spd.expm(spd.from_vector(1.5 * np.random.default_rng(1).standard_normal((2, 9, 6))))
    at_wanted, at_achieved = coordinates(wanted, achieved), coordinates(achieved, wanted)
    basis = on_vectors(turns(wanted, achieved))
    assert_allclose(np.einsum("nij,nj->ni", basis, at_wanted), -at_achieved, atol=1e-10)
    assert_allclose(basis @ np.swapaxes(basis, -1, -2), np.broadcast_to(np.eye(6), basis.shape), atol=1e-10)
