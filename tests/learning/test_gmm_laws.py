"""Changes of axes and units move the learned profile along; models survive files; bad input is named."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone

from maniport import spd
from maniport.learning import ProfileGMM

TIME = np.linspace(0.0, 1.0, 40)


def covariance_tensor(ellipsoids, covariance):
    """E[L_ij L_kl] of tangents L = P^½ V P^½ at ellipsoids P, shape (n, 3, 3, 3, 3)."""
    root = spd.sqrtm(ellipsoids)[:, None]
    basis = root @ spd.from_vector(np.eye(6)) @ root
    return np.einsum("nab,naij,nbkl->nijkl", covariance, basis, basis, optimize=True)


@pytest.fixture(scope="module")
def demos(demonstrate):
    """Times and ellipsoids of three demonstrations together."""
    return np.tile(TIME, 3), demonstrate(np.random.default_rng(0), 3, TIME, 0.2).reshape(-1, 3, 3)


@pytest.fixture(scope="module")
def model(demos):
    """A model of three components."""
    return ProfileGMM(3, random_state=0).fit(*demos, groups=np.repeat([0, 1, 2], 40))


def test_congruence_of_the_data_is_congruence_of_the_prediction(demos, model):
    """C X Cᵀ for all data gives C P Cᵀ, the covariance tensor turned by C, and the same likelihood."""
    time, points = demos
    change = np.array([[1.2, 0.3, -0.5], [0.0, 0.7, 0.4], [0.8, -0.2, 1.5]])
    moved = clone(model).fit(time, change @ points @ change.T, np.repeat([0, 1, 2], 40))
    mean, covariance = model.predict(TIME, return_covariance=True)
    mean_moved, covariance_moved = moved.predict(TIME, return_covariance=True)
    assert_allclose(mean_moved, change @ mean @ change.T, rtol=1e-6, atol=1e-8)
    tensor = np.einsum(
        "ia,jb,kc,ld,nabcd->nijkl", change, change, change, change, covariance_tensor(mean, covariance), optimize=True
    )
    found = covariance_tensor(mean_moved, covariance_moved)
    assert_allclose(found, tensor, atol=1e-6 * np.abs(tensor).max())
    assert moved.log_likelihood_ == pytest.approx(model.log_likelihood_, abs=1e-8)


def test_inversion_of_the_data_inverts_the_prediction(demos, model):
    """Inverse matrices, such as force ellipsoids, give the inverse profile with the same sizes of covariance."""
    time, points = demos
    inverse = clone(model).fit(time, np.linalg.inv(points), np.repeat([0, 1, 2], 40))
    mean, covariance = model.predict(TIME, return_covariance=True)
    mean_inverse, covariance_inverse = inverse.predict(TIME, return_covariance=True)
    assert_allclose(mean_inverse, np.linalg.inv(mean), rtol=1e-6, atol=1e-8)
    assert_allclose(covariance_inverse, covariance, atol=1e-6 * covariance.max())


def test_prediction_is_the_fixed_point_of_the_regression(model):
    """At the prediction the weighted tangents toward the components' own predictions cancel."""
    from maniport.learning.mixture import log_density, regress

    mixture = model._mixture()
    centers, _ = regress(mixture, TIME[:, None])
    for center, time in zip(centers, TIME, strict=True):
        total = np.zeros((3, 3))
        away = time - mixture.inputs[:, 0]
        density = log_density(away[:, None, None], mixture.covariances[:, :1, :1])[0]
        shares = mixture.weights * np.exp(density) / np.sum(mixture.weights * np.exp(density))
        for k, share in enumerate(shares):
            base, sigma = mixture.ellipsoids[k], mixture.covariances[k]
            whitened = spd.from_vector(sigma[1:, 0] / sigma[0, 0] * away[k])
            ahead = spd.transport(spd.sqrtm(base) @ whitened @ spd.sqrtm(base), base, center)
            total += share * (spd.log(center, base) + ahead)
        assert np.abs(total).max() < 1e-7


def test_saved_model_is_the_same(model, tmp_path):
    """A model that was saved and loaded predicts the same and knows its parameters."""
    model.save(tmp_path / "model.npz")
    loaded = ProfileGMM.load(tmp_path / "model.npz")
    for one, other in zip(loaded.predict(TIME, True), model.predict(TIME, True), strict=True):
        assert_array_equal(one, other)
    assert loaded.get_params() == model.get_params()
    assert {key for key in vars(loaded) if key.endswith("_")} == {key for key in vars(model) if key.endswith("_")}
    assert loaded.converged_ is model.converged_
    assert_array_equal(loaded.history_, model.history_)
