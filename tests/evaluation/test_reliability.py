"""Tests of the identity test and of stability."""

import numpy as np
import pytest

from maniport import NearestNeighbor, ParallelTransport, RawCopy, Recentring, RiemannianICP, spd
from maniport.errors import InvalidInputError
from maniport.evaluation import identity_test, stability
from maniport.evaluation.reliability import _angles_from_mean


def test_identity_test_of_equal_draws_is_passed_exactly(make_cloud, rng):
    """Where both draws are the same cloud, the closed form changes nothing."""
    points = make_cloud(rng, 40)
    assert identity_test(ParallelTransport(damping=0.01), points, points) < 1e-9


def test_identity_test_of_recentring_is_the_distance_of_the_means(make_cloud, rng):
    """A second draw that is exp(δ) times the first moves everything by √3 δ."""
    points, delta = make_cloud(rng, 40), 0.2
    assert identity_test(Recentring(), points, np.exp(delta) * points) == pytest.approx(np.sqrt(3.0) * delta)


def test_identity_test_replaces_the_mounting_and_leaves_the_adapter_alone(make_cloud, rng, turn_about):
    """Between a domain and itself nothing is mounted otherwise: the rotation between the frames is the identity."""
    points, adapter = make_cloud(rng, 40), ParallelTransport(mounting=turn_about(90.0))
    assert identity_test(adapter, points, points) < 1e-9
    assert not hasattr(adapter, "rotation_")
    np.testing.assert_array_equal(adapter.mounting, turn_about(90.0))


def test_raw_copy_passes_any_identity_test(make_cloud, rng):
    """Who changes nothing changes nothing here."""
    assert identity_test(RawCopy(), make_cloud(rng, 30), make_cloud(rng, 30)) < 1e-9


def test_stability_of_equal_draws_is_perfect(make_cloud, rng):
    """The same domains give the same map."""
    teacher, student = make_cloud(rng, 40), 2.0 * make_cloud(rng, 50)
    found = stability(RiemannianICP(random_state=0), [teacher] * 3, [student] * 3, teacher[:4])
    assert found.n_draws == 3
    assert max(found.rotation_largest, found.rotation_rms, found.map_spread) < 1e-6


def test_map_spread_of_recentring_is_that_of_the_means(make_cloud, rng):
    """Students that are exp(±δ) times a cloud spread every image by √3 δ, and turn nothing."""
    teacher, student, delta = make_cloud(rng, 40), make_cloud(rng, 50), 0.3
    draws = [np.exp(sign * delta) * student for sign in (-1.0, 1.0)]
    found = stability(Recentring(), [teacher, teacher], draws, teacher[:5])
    assert found.map_spread == pytest.approx(np.sqrt(3.0) * delta)
    assert found.rotation_largest == pytest.approx(0.0, abs=1e-9)


def test_rotation_spread_is_the_angle_from_the_mean(turn_about):
    """Turns by −10°, 0° and 10° have the middle one as mean; without a sign of their own, their order is free."""
    angles = np.degrees(_angles_from_mean([turn_about(angle) for angle in (-10.0, 0.0, 10.0)]))
    np.testing.assert_allclose(angles, [10.0, 0.0, 10.0], atol=1e-6)


def test_a_lookup_spreads_by_its_samples(make_cloud, rng):
    """Independent tables give different samples for the same ellipsoid."""
    draws = [[make_cloud(rng, 60) for _ in range(3)] for _ in range(2)]
    assert stability(NearestNeighbor(), *draws, make_cloud(rng, 5)).map_spread > 0.05


def test_probes_carry_the_regularisation(rng):
    """Singular domains and probes are no obstacle to an adapter with damping."""
    factor = rng.standard_normal((2, 30, 3, 2))
    draws = [[points @ np.swapaxes(points, -1, -2)] * 2 for points in factor]
    found = stability(ParallelTransport(damping=0.01), *draws, draws[0][0][:3])
    assert found.map_spread < 1e-6
    assert np.all(spd.lengths(draws[0][0])[:, 0] < 1e-6)


def test_bad_input_is_told(make_cloud, rng):
    """Draws come in pairs, two at least, and probes in sets."""
    points = make_cloud(rng, 30)
    with pytest.raises(InvalidInputError, match="equally many, at least 2; found 1 and 1"):
        stability(RawCopy(), [points], [points], points)
    with pytest.raises(InvalidInputError, match="equally many, at least 2; found 2 and 3"):
        stability(RawCopy(), [points] * 2, [points] * 3, points)
    with pytest.raises(InvalidInputError, match=r"probe must have shape \(k, d, d\)"):
        stability(RawCopy(), [points] * 2, [points] * 2, points[0])
