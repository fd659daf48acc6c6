import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.learning import ProfileGMM, align, tracking_weights
from maniport.learning.alignment import matched
from properties.strategies import cases, congruent, fewer

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def demonstrations(case, k=3):
    """Demonstrations (k, 24, d, d) that run alike along a path of four points of the case."""
    corners = spd.logm(case.spd(4))
    at = np.linspace(0.0, 2.999, 24)
    first = at.astype(int)
    part = (at % 1.0)[:, None, None]
    path = (1.0 - part) * corners[first] + part * corners[first + 1]
    return spd.expm(path + 0.05 * case.with_scale(1.0).symmetric(k, 24))


def covariances(case, n=3):
    """Covariances (n, m, m) for ellipsoids of the case."""
    m = case.d * (case.d + 1) // 2
    factors = case.rng.standard_normal((n, m, m + 2))
    matrices = case.scale * factors @ np.swapaxes(factors, -1, -2)
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


@given(case=cases(most=8.0), reference=st.none() | st.integers(0, 2))
def test_alignment_runs_from_start_to_end(case, reference):
    """Paths go from both starts to both ends and never back; a congruence of all ellipsoids changes no match."""
    data = [case.spd(n) for n in (7, 5, 6)]
    result = align(data, reference=reference)
    n = len(result.time)
    assert reference in (None, result.reference)
    for path, one in zip(result.paths, data, strict=True):
        assert_array_equal(path[[0, -1]], [[0, 0], [n - 1, len(one) - 1]])
        assert np.all(
            (np.diff(path, axis=0) >= 0).all(axis=1) & (np.diff(path, axis=0).max(axis=1) == 1)
        )
    assert_array_equal(result.ellipsoids[result.reference], data[result.reference])
    change = case.change()
    moved = [congruent(change, profile) for profile in data]
    costs, moved_costs = (
        [matched(profiles[0], other)[1] for other in profiles[1:]] for profiles in (data, moved)
    )
    assert_allclose(moved_costs, costs, atol=10.0 * case.rounding)
    inputs, ellipsoids, groups = result.stacked()
    assert len(inputs) == len(ellipsoids) == len(groups) == 3 * n
    assert_array_equal(ellipsoids[groups == 1], result.ellipsoids[1])


@fewer(0.4)
@given(case=cases(most=4.0, sizes=(2, 3, 4)))
def test_profiles_do_not_depend_on_order_and_follow_congruences(case):
    data = demonstrations(case)
    time = np.linspace(0.0, 1.0, 24)
    d = case.d
    order = case.rng.permutation(3)
    change = case.change()

    def profile(demos):
        fitted = ProfileGMM(1).fit(np.tile(time, 3), demos.reshape(72, d, d))
        return fitted.predict(time)

    wanted = profile(data)
    assert_allclose(spd.distance(profile(data[order]), wanted), 0.0, atol=1e-6)
    assert_allclose(spd.distance(profile(1e3 * data), 1e3 * wanted), 0.0, atol=1e-6)
    assert_allclose(
        spd.distance(profile(congruent(change, data)), congruent(change, wanted)), 0.0, atol=1e-6
    )


@fewer(0.7)
@given(case=cases(), damping=st.floats(1e-3, 10.0))
def test_weights_are_free_of_units_and_have_mean_one(case, damping):
    covariance = covariances(case)
    weights = tracking_weights(covariance, damping)
    m = covariance.shape[-1]
    assert_array_equal(weights, np.swapaxes(weights, -1, -2))
    assert_allclose(np.trace(weights, axis1=1, axis2=2).mean() / m, 1.0, rtol=1e-9)
    assert_allclose(tracking_weights(1e6 * covariance, damping), weights, rtol=1e-8, atol=1e-9)
    turn = np.linalg.qr(case.rng.standard_normal((m, m)))[0]
    turned = tracking_weights(congruent(turn, covariance), damping)
    assert_allclose(turned, congruent(turn, weights), atol=1e-8 * weights.max())
