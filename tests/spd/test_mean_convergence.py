"""How the mean is found: derivatives by finite differences, few Newton steps, honest warnings."""

import importlib
import re
import warnings

import numpy as np
import numpy_kernels
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import ConvergenceWarning, NotSPDError
from maniport.spd.kernels import congruence, moments

newton = importlib.import_module("maniport.spd.mean")  # `maniport.spd.mean` itself is the function


def cost_at(step, x, weights):
    """Return half the weighted sum of squared distances from exp(step) to the points."""
    return 0.5 * weights @ spd.distance(spd.expm(step), x) ** 2


@pytest.fixture(params=[2, 3, 6])
def problem(request, random_spd):
    """Points with weights; every other one has two equal eigenvalues, where the Hessian needs its limit."""
    rng = np.random.default_rng(request.param)
    x, weights = random_spd(rng, (6,), request.param, condition=50.0), rng.uniform(0.1, 1.0, 6)
    x[0] = np.eye(request.param)
    x[1] = 2.0 * np.eye(request.param) + 1e-7 * x[1]
    return x, weights / weights.sum()


@pytest.fixture
def steps_taken(monkeypatch):
    """Count the Newton steps that the mean takes."""
    counted = []
    direction = newton._newton_direction
    monkeypatch.setattr(newton, "_newton_direction", lambda *a: counted.append(1) or direction(*a))
    return counted


def moments_at_identity(x, weights, implementation=moments):
    """Cost, gradient and Hessian of the mean of x about the identity."""
    return implementation(x, np.eye(x.shape[-1]), weights, np.ones(len(x)), True)


def gradient_norm(center, x):
    """Norm of the Riemannian gradient that is left at the mean of x."""
    whitened = congruence(spd.invsqrtm(center), x)
    return np.linalg.norm(moments_at_identity(whitened, np.full(len(x), 1 / len(x))).gradient)


implementations = pytest.mark.parametrize("implementation", [moments, numpy_kernels.moments], ids=["compiled", "NumPy"])


@implementations
def test_gradient_matches_finite_differences(implementation, problem, random_symmetric):
    """The slope of the cost along any tangent at the identity is minus its inner product with the step direction."""
    x, weights = problem
    at = moments_at_identity(x, weights, implementation)
    assert_allclose(at.cost, cost_at(np.zeros(x.shape[1:]), x, weights), rtol=1e-12)
    h = 1e-5
    for tangent in random_symmetric(np.random.default_rng(1), (8,), x.shape[-1]):
        slope = (cost_at(h * tangent, x, weights) - cost_at(-h * tangent, x, weights)) / (2 * h)
        assert_allclose(slope, -np.sum(at.gradient * tangent), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("d", [2, 3, 6, 12])
@pytest.mark.parametrize("curved", [False, True])
def test_compiled_moments_agree_with_their_twin(d, curved, random_spd):
    """The compiled pass and the NumPy one agree in cost, rounding, gradient and Hessian, last block half full."""
    rng = np.random.default_rng(d)
    x, whitening = random_spd(rng, (37,), d), random_spd(rng, (), d, condition=10.0)
    weights, sizes = rng.uniform(0.1, 1.0, 37), rng.uniform(0.1, 1.0, 37)
    for compiled, twin in zip(
        moments(x, whitening, weights, sizes, curved),
        numpy_kernels.moments(x, whitening, weights, sizes, curved),
        strict=True,
    ):
        assert (compiled is None) == (twin is None)
        if twin is not None:
            assert_allclose(compiled, twin, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("d", "count", "most"), [(3, 400, 3), (6, 10, 5), (6, 200, 4), (12, 50, 4)])
def test_nearly_singular_points_converge_in_a_few_steps(d, count, most, random_spd, steps_taken):
    """Points of condition 7e5 reach a gradient below 1e-10 in at most five Newton steps."""
    x = random_spd(np.random.default_rng(0), (count,), d, condition=7e5)
    center = spd.mean(x)
    assert gradient_norm(center, x) < 2e-10
    assert len(steps_taken) <= most


@pytest.mark.parametrize("condition", [1e8, 1e10, 1e12])
def test_points_near_the_limit_stop_where_rounding_does(condition, random_spd, steps_taken):
    """Beyond condition 1e8 the iteration ends at the gradient that rounding leaves, soon and without a warning."""
    x = random_spd(np.random.default_rng(1), (20,), 6, condition=condition)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        center = spd.mean(x)
    assert gradient_norm(center, x) < 1e-16 * condition
    assert len(steps_taken) <= 12


def test_points_without_a_computable_mean_are_refused(random_spd):
    """Where rounding makes whitened points indefinite there is an error, never nan."""
    found = []
    for seed in range(20):
        x = random_spd(np.random.default_rng(seed), (2,), 6, condition=5e12)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # the other honest answer
                assert np.isfinite(spd.mean(x)).all()
        except NotSPDError as error:
            found.append(str(error))
    assert found
    assert all(message.startswith("points are too ill-conditioned for their mean") for message in found)


def test_stopping_early_warns_and_states_the_gradient(random_spd):
    """With too few steps allowed, the warning states the gradient norm that was reached, and the mean is returned."""
    x = random_spd(np.random.default_rng(0), (10,), 6, condition=7e5)
    with pytest.warns(ConvergenceWarning, match="the mean of 10 matrices stopped after 1 steps") as caught:
        center = spd.mean(x, max_iter=1)
    stated = float(re.search(r"gradient norm (\S+);", str(caught[0].message)).group(1))
    assert_allclose(stated, gradient_norm(center, x), rtol=1e-2)
    assert caught[0].filename == __file__
