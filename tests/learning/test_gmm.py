"""What the Gaussian mixture learns: known profiles, known covariances, known numbers of components."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2
from sklearn.base import clone
from sklearn.mixture import GaussianMixture

from maniport import spd
from maniport.errors import InvalidInputError
from maniport.learning import ProfileGMM, align, tracking_weights

TIME = np.linspace(0.0, 1.0, 40)


@pytest.fixture(scope="module")
def taught(demonstrate):
    """Five demonstrations that agree at both ends and differ in the middle, and the model learned from them."""
    time = np.linspace(0.0, 1.0, 80)
    amplitude = 0.03 + 0.3 * np.exp(-0.5 * ((time - 0.5) / 0.12) ** 2)
    demos = demonstrate(np.random.default_rng(0), 5, time, amplitude)
    model = ProfileGMM(6).fit(np.tile(time, 5), demos.reshape(-1, 3, 3))
    return time, amplitude, demos, model


def test_mean_is_recovered_and_covariance_is_larger_where_demonstrations_differ(taught, truth):
    time, amplitude, demos, model = taught
    error = spd.distance(model.predict(time), truth(time))
    assert error.mean() < 0.4 * spd.distance(demos, truth(time)).mean()
    assert np.all(error < 2.5 * amplitude)
    _, covariance = model.predict(time, return_covariance=True)
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 6)
    assert np.corrcoef(deviation, amplitude)[0, 1] > 0.9
    assert deviation[40] / deviation[[0, -1]].max() > 3.0


def test_one_component_is_a_geodesic_regression(scatter):
    rng = np.random.default_rng(1)
    base = spd.expm(spd.from_vector(rng.standard_normal(6)))
    slope = rng.standard_normal(6)
    time = np.linspace(-1.0, 1.0, 21)
    points = scatter(np.broadcast_to(base, (21, 3, 3)), time[:, None] * slope)
    model = ProfileGMM(1, regularization=1e-12).fit(time, points)
    ahead = np.array([-1.5, 0.3, 1.2])
    wanted = scatter(np.broadcast_to(base, (3, 3, 3)), ahead[:, None] * slope)
    assert spd.distance(model.predict(ahead), wanted).max() < 1e-6


def test_small_spread_equals_the_euclidean_mixture():
    """Ellipsoids close to the identity give scikit-learn's mixture of log-vectors, and its linear regression."""
    rng = np.random.default_rng(3)
    small = 1e-4
    time = rng.random(400)
    kinks = np.abs(time - 0.5)[:, None] * rng.standard_normal(6) + time[
        :, None
    ] * rng.standard_normal(6)
    vectors = kinks + 0.05 * rng.standard_normal((400, 6))
    points = spd.expm(spd.from_vector(small * vectors))
    ridge = 1e-6
    options = {"n_components": 2, "tol": 1e-9, "max_iter": 500}
    model = ProfileGMM(regularization=ridge * small**2, **options).fit(time, points)
    scaled = np.column_stack([time, vectors])
    flat = GaussianMixture(
        reg_covar=ridge, random_state=0, means_init=_in_flat(model, small), **options
    ).fit(scaled)
    assert_allclose(model.weights_, flat.weights_, atol=2e-3)
    assert_allclose(_in_flat(model, small), flat.means_, atol=2e-3)
    scale = np.r_[1.0, np.full(6, small)]
    assert_allclose(model.covariances_ / np.outer(scale, scale), flat.covariances_, atol=2e-3)
    assert model.log_likelihood_ + 6 * np.log(small) == pytest.approx(flat.score(scaled), abs=1e-4)
    assert model.held_out_ == {}


def _in_flat(model, small):
    return np.column_stack([model.input_means_, spd.to_vector(spd.logm(model.means_)) / small])


def test_likelihood_rises_in_em(demonstrate):
    time = np.linspace(0.0, 1.0, 30)
    demos = demonstrate(np.random.default_rng(4), 3, time, 0.3)
    inputs = np.tile(time, 3)
    points = demos.reshape(-1, 3, 3)
    model = ProfileGMM(2, tol=1e-7, regularization=1e-9).fit(inputs, points)
    assert model.converged_
    assert np.diff(model.history_).min() > -1e-4
    assert model.log_likelihood_ == model.history_.max()


@pytest.mark.parametrize("count", [1, 4])
def test_held_out_points_find_the_number_of_separate_components(count, scatter):
    rng = np.random.default_rng(count)
    centers = spd.expm(spd.from_vector(1.5 * rng.standard_normal((count, 6))))
    which = np.arange(160) % count
    points = scatter(centers[which], 0.1 * rng.standard_normal((160, 6)))
    model = ProfileGMM().fit(which + 0.1 * rng.standard_normal(160), points)
    assert model.n_components_ == count
    assert max(model.held_out_, key=model.held_out_.get) == count
    assert len(model.held_out_) == (3 if count == 1 else 6)
    assert_allclose(np.sort(model.weights_), 1 / count, atol=0.05)


def covered(model, demonstration):
    """Share of a demonstration inside the 95 % ellipsoids of a model."""
    expected, covariance = model.predict(TIME, return_covariance=True)
    whitening = spd.powm(expected, -0.5)
    errors = spd.to_vector(spd.logm(whitening @ demonstration @ whitening))
    squares = np.einsum("na,nab,nb->n", errors, np.linalg.inv(covariance), errors)
    return float(np.mean(squares <= chi2.ppf(0.95, 6)))


def test_default_model_covers_a_further_demonstration(demonstrate):
    """Of smooth deviations, many Gaussians have a smaller covariance than five demonstrations justify."""
    demos = demonstrate(np.random.default_rng(1), 6, TIME, 0.3, smooth=True)
    times = np.tile(TIME, 5)
    groups = np.repeat(np.arange(5), len(TIME))
    model = ProfileGMM().fit(times, demos[:5].reshape(-1, 3, 3), groups)
    many = ProfileGMM(6).fit(times, demos[:5].reshape(-1, 3, 3), groups)
    assert model.n_components_ < 6
    assert covered(model, demos[5]) > covered(many, demos[5]) + 0.1
    assert model.held_out_[model.n_components_] == max(model.held_out_.values())


def covariance_tensor(ellipsoids, covariance):
    """E[L_ij L_kl] of tangents L = P^½ V P^½ at ellipsoids P, shape (n, 3, 3, 3, 3)."""
    root = spd.powm(ellipsoids, 0.5)[:, None]
    basis = root @ spd.from_vector(np.eye(6)) @ root
    return np.einsum("nab,naij,nbkl->nijkl", covariance, basis, basis, optimize=True)


def test_congruence_of_the_data_is_congruence_of_the_prediction(demonstrate):
    """C X Cᵀ for all data gives C P Cᵀ, the covariance tensor turned by C, and the same likelihood."""
    time = np.tile(TIME, 3)
    groups = np.repeat([0, 1, 2], 40)
    points = demonstrate(np.random.default_rng(0), 3, TIME, 0.2).reshape(-1, 3, 3)
    model = ProfileGMM(3).fit(time, points, groups)
    change = np.array([[1.2, 0.3, -0.5], [0.0, 0.7, 0.4], [0.8, -0.2, 1.5]])
    moved = clone(model).fit(time, change @ points @ change.T, groups)
    mean, covariance = model.predict(TIME, return_covariance=True)
    mean_moved, covariance_moved = moved.predict(TIME, return_covariance=True)
    assert_allclose(mean_moved, change @ mean @ change.T, rtol=1e-6, atol=1e-8)
    tensor = np.einsum(
        "ia,jb,kc,ld,nabcd->nijkl",
        change,
        change,
        change,
        change,
        covariance_tensor(mean, covariance),
        optimize=True,
    )
    found = covariance_tensor(mean_moved, covariance_moved)
    assert_allclose(found, tensor, atol=1e-6 * np.abs(tensor).max())
    assert moved.log_likelihood_ == pytest.approx(model.log_likelihood_, abs=1e-8)


def test_weights_are_the_precision_without_damping():
    factors = (
        np.random.default_rng(0).standard_normal((7, 6, 6))
        * np.linspace(0.1, 1.0, 7)[:, None, None]
    )
    covariance = factors @ np.swapaxes(factors, -1, -2)
    ratio = tracking_weights(covariance, damping=0.0) @ covariance
    assert_allclose(
        ratio, ratio[0, 0, 0] * np.broadcast_to(np.eye(6), ratio.shape), atol=1e-7 * ratio[0, 0, 0]
    )


GOOD = np.broadcast_to(np.eye(3), (4, 3, 3)).copy()
EYES = np.broadcast_to(np.eye(3), (40, 3, 3)) * (1 + TIME[:, None, None])
SQUARE = np.broadcast_to(np.eye(6), (3, 6, 6))
ONE = ProfileGMM(1)
HALF = TIME[:, None, None] > 0.5


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: align([]), "profiles"),
        (lambda: align([GOOD, np.where(np.eye(3) > 0, np.nan, GOOD)]), r"profiles\[1\]"),
        (lambda: align([GOOD, GOOD * [1.0, 1.0, 0.0]]), r"profiles\[1\]\[0\] is singular"),
        (lambda: align([GOOD, GOOD[:, :2, :2]]), "3×3 matrices; found 2×2"),
        (lambda: align([GOOD, GOOD[:1]]), r"profiles\[1\]"),
        (lambda: align([GOOD, GOOD], reference=2), "reference"),
        (lambda: align([GOOD, GOOD], reference=-1), "reference"),
        (lambda: align([GOOD, GOOD], [[0, 1, 2, 3]]), "times"),
        (lambda: align([GOOD], [[0, 1, 2]]), r"times\[0\]"),
        (lambda: align([GOOD], [[0, 2, 1, 3]]), r"times\[0\]"),
        (lambda: align([GOOD, GOOD]).warp([[0.0]]), "signals"),
        (lambda: align([GOOD, GOOD]).warp([np.zeros((4, 3)), np.zeros((3, 3))]), r"signals\[1\]"),
        (lambda: ONE.fit(TIME, np.where(HALF, np.nan, EYES)), "ellipsoids"),
        (lambda: ONE.fit(TIME[1:], EYES), "time must be 40 numbers"),
        (lambda: ONE.fit(np.ones(40), EYES), "time"),
        (lambda: ProfileGMM(6).fit(TIME, EYES), "48 ellipsoids, .* found 40"),
        (lambda: ONE.fit(TIME, EYES, [1, 2]), "groups"),
        (lambda: ONE.fit(TIME, EYES, np.zeros(40)), "groups"),
        (lambda: ProfileGMM(0).fit(TIME, EYES), "n_components"),
        (lambda: ONE.fit(TIME, EYES).predict(np.ones((2, 3))), "time"),
        (lambda: ONE.fit(TIME, EYES).predict([np.nan]), "time"),
        (lambda: ONE.fit(TIME, EYES).predict([1e6]), "the prediction at these times"),
        (lambda: tracking_weights(SQUARE * np.nan), "covariance"),
        (lambda: tracking_weights(np.ones((3, 6))), "covariance"),
        (lambda: tracking_weights(0.0 * SQUARE), "covariance is zero"),
        (lambda: tracking_weights(np.ones((1, 6, 6)), 0.0), "singular"),
        (lambda: tracking_weights(-SQUARE), "no negative eigenvalue"),
        (lambda: tracking_weights(SQUARE, -0.1), "damping"),
    ],
)
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises(InvalidInputError, match=words):
        call()
