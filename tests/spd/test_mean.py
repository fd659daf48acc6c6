"""Fréchet mean and dispersion: laws, derivatives by finite differences, few Newton steps, honest warnings."""

import importlib
import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import ConvergenceWarning, InvalidInputError, NotSPDError
from maniport.spd.kernels import congruence

newton = importlib.import_module("maniport.spd.mean")  # `maniport.spd.mean` itself is the function


@pytest.fixture
def steps_taken(monkeypatch):
    counted = []
    direction = newton._newton_direction
    monkeypatch.setattr(newton, "_newton_direction", lambda *a: counted.append(1) or direction(*a))
    return counted


def gradient_norm(center, x):
    return np.linalg.norm(spd.logm(congruence(spd.powm(center, -0.5), x)).mean(axis=0))


@pytest.mark.parametrize("d", [2, 3, 6, 12])
@settings(max_examples=5)
@given(seed=st.integers(0, 2**32 - 1))
def test_gradient_vanishes_at_the_mean(d, seed, random_spd):
    rng = np.random.default_rng(seed)
    x = random_spd(rng, (7,), d)
    weights = np.append(0.0, rng.uniform(0.1, 9.0, 6))
    center = spd.mean(x, weights)
    gradient = np.einsum("n,nij->ij", weights / weights.sum(), spd.log(center, x))
    assert np.sqrt(spd.inner(center, gradient, gradient)) < 1e-9


@pytest.mark.parametrize(
    ("d", "count", "most"), [(3, 400, 3), (6, 10, 5), (6, 200, 4), (12, 50, 4)]
)
def test_nearly_singular_points_converge_in_a_few_steps(d, count, most, random_spd, steps_taken):
    x = random_spd(np.random.default_rng(0), (count,), d, condition=7e5)
    center = spd.mean(x)
    assert gradient_norm(center, x) < 2e-10
    assert len(steps_taken) <= most


@pytest.mark.parametrize("condition", [1e8, 1e10, 1e12])
def test_points_near_the_limit_stop_where_rounding_does(condition, random_spd, steps_taken):
    x = random_spd(np.random.default_rng(1), (20,), 6, condition=condition)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        center = spd.mean(x)
    assert gradient_norm(center, x) < 1e-16 * condition
    assert len(steps_taken) <= 12


def test_points_without_a_computable_mean_are_refused(random_spd):
    messages = []
    for seed in range(20):
        x = random_spd(np.random.default_rng(seed), (2,), 6, condition=5e12)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # the other honest answer
                assert np.isfinite(spd.mean(x)).all()
        except NotSPDError as error:
            messages.append(str(error))
    assert messages
    assert all(
        message.startswith("points are too ill-conditioned for their mean") for message in messages
    )


def test_stopping_early_warns_and_states_the_gradient(monkeypatch, random_spd):
    monkeypatch.setattr(newton, "_line_search", lambda *_: None)
    x = random_spd(np.random.default_rng(0), (10,), 6, condition=7e5)
    with pytest.warns(ConvergenceWarning, match="gradient norm") as caught:
        center = spd.mean(x)
    stated = float(re.search(r"gradient norm (\S+);", str(caught[0].message)).group(1))
    assert_allclose(stated, gradient_norm(center, x), rtol=1e-2)
    assert caught[0].filename == __file__


def test_dispersion_is_the_mean_distance(random_spd):
    x = random_spd(np.random.default_rng(0), (6,), 3)
    distances = spd.distance(spd.mean(x), x)
    assert_allclose(spd.dispersion(x), distances.mean(), rtol=1e-12)
    assert_allclose(spd.dispersion(x[:1]), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("function", "name", "value"),
    [
        (spd.dispersion, "center", np.stack([np.eye(3)] * 2)),
        (spd.dispersion, "center", np.eye(2)),
        (spd.dispersion, "center", np.diag([1.0, 1.0, 0.0])),
        (spd.mean, "weights", [1.0, 1.0]),
        (spd.mean, "weights", [1.0, 1.0, -1.0, 1.0]),
        (spd.mean, "weights", np.zeros(4)),
        (spd.mean, "weights", [1.0, np.nan, 1.0, 1.0]),
        (spd.mean, "tol", 0.0),
    ],
)
def test_wrong_arguments_are_refused_by_name(function, name, value):
    with pytest.raises(InvalidInputError, match=name):
        function(np.stack([np.eye(3)] * 4), **{name: value})
