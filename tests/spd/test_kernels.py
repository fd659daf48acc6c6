"""Kernels against NumPy, on any number of threads; the search for neighbors against brute force."""

import threading
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import linalg

from maniport import spd
from maniport.errors import NotSPDError
from maniport.spd import kernels
from maniport.spd.affine_invariant import nearest
from maniport.spd.kernels import eigh

sizes = pytest.mark.parametrize("d", [2, 3, 6, 11, 12])


@sizes
@given(seed=st.integers(0, 2**32 - 1), exponent=st.floats(-60, 60))
def test_decomposition_rebuilds_symmetric_matrices(d, seed, exponent, random_symmetric):
    """V diag(λ) Vᵀ is the matrix, V is orthonormal and λ ascending and LAPACK's, at any scale."""
    a = 10.0**exponent * random_symmetric(np.random.default_rng(seed), (2, 5), d)
    values, vectors = eigh(a)
    size = np.abs(a).max()
    assert np.all(np.diff(values, axis=-1) >= 0)
    assert_allclose(values / size, np.linalg.eigvalsh(a) / size, atol=1e-13)
    assert_allclose(
        (vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2) / size, a / size, atol=1e-13
    )
    assert_allclose(
        np.swapaxes(vectors, -1, -2) @ vectors, np.broadcast_to(np.eye(d), a.shape), atol=1e-13
    )


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("rank", [0, 1, 2])
def test_rank_deficient_products_are_decomposed(d, rank, random_spd):
    jacobian = np.random.default_rng(6).standard_normal((30, d, rank))
    products = jacobian @ np.swapaxes(jacobian, 1, 2)
    values, vectors = eigh(products)
    missing = max(d - rank, 0)
    assert np.all(
        np.abs(values[:, :missing]) <= 1e-14 * np.trace(products, axis1=1, axis2=2)[:, None]
    )
    assert_allclose(
        np.swapaxes(vectors, -1, -2) @ vectors,
        np.broadcast_to(np.eye(d), products.shape),
        atol=1e-13,
    )


@pytest.mark.parametrize("d", [2, 3, 6])
def test_threads_change_no_bit(d, random_spd, monkeypatch):
    x, y = (
        np.tile(points, (60, 1, 1)) for points in random_spd(np.random.default_rng(d), (2, 1000), d)
    )

    def everything():
        power = kernels.power_congruence(y[0], x, 0.3, y[1])
        pairs = kernels.congruence(x, y), kernels.distances(x, y)
        return [*kernels.eigh(x), *kernels.roots(x), *pairs, power]

    monkeypatch.setattr(kernels.config, "NUMBA_NUM_THREADS", 4)
    shared = everything()
    monkeypatch.setattr(kernels.config, "NUMBA_NUM_THREADS", 1)
    for together, alone in zip(shared, everything(), strict=True):
        assert_array_equal(together, alone)
        assert_array_equal(together[:1000], alone[-1000:])


def test_concurrent_callers_do_not_disturb_each_other(random_spd):
    x = random_spd(np.random.default_rng(1), (500,), 3)
    expected = spd.mean(x)
    means = {}
    callers = [
        threading.Thread(target=lambda i=i: means.update({i: spd.mean(x)})) for i in range(4)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert all(np.array_equal(means[i], expected) for i in range(4))


def test_one_matrix_serves_a_batch(random_spd):
    x, y = random_spd(np.random.default_rng(2), (2, 5), 3)
    for function, first, other in (
        (kernels.congruence, x, y),
        (kernels.distances, x, y),
        (kernels.compose, x[:, 0], y),
        (spd.distance, x, y),
        (lambda t, y: spd.geodesic(y, x[0], t), np.linspace(0.0, 1.0, 5), y),
    ):
        assert_array_equal(function(first, other[0]), [function(a, other[0]) for a in first])
        assert_array_equal(function(first[0], other), [function(first[0], b) for b in other])


@sizes
def test_matrix_functions_agree_with_scipy(d, random_spd, random_symmetric):
    rng = np.random.default_rng(4)
    x = random_spd(rng, (), d)
    tangent = random_symmetric(rng, (), d)
    for result, expected in (
        (spd.logm(x), linalg.logm(x)),
        (spd.expm(tangent), linalg.expm(tangent)),
        (spd.powm(x, 0.5), linalg.sqrtm(x)),
        (spd.powm(x, 0.37), linalg.fractional_matrix_power(x, 0.37)),
    ):
        assert_allclose(result, expected, rtol=1e-11, atol=1e-10)
        assert_array_equal(result, result.T)


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [10.0, 1e4, 1e6])
@pytest.mark.parametrize(("n", "m"), [(30, 1), (30, 5), (20, 200), (0, 5)])
def test_nearest_equals_brute_force(d, condition, n, m, random_spd):
    rng = np.random.default_rng(d)
    tilt = np.diag(np.geomspace(1.0, condition**0.25, d))
    queries = random_spd(rng, (n,), d, condition)
    points = tilt @ random_spd(rng, (m,), d, condition) @ tilt
    every = spd.distance(queries[:, None], points[None])
    index, distance = nearest(queries, points)
    assert_allclose(distance, every.min(axis=1), rtol=1e-10 * condition)
    assert_allclose(every[np.arange(n), index], every.min(axis=1), rtol=1e-10 * condition)


def test_points_too_ill_conditioned_for_a_search_are_refused(random_spd):
    rng = np.random.default_rng(0)
    queries = random_spd(rng, (500,), 3, 5e12)
    points = random_spd(rng, (1,), 3, 5e12)
    with (
        warnings.catch_warnings(action="error"),
        pytest.raises(NotSPDError, match="ill-conditioned"),
    ):
        nearest(queries, points)
