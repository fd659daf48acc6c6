"""Tests of the metrics of mapped ellipsoids."""

import numpy as np
import pytest

from maniport import IdentityMap, MeanTransport, NearestNeighbor, ParallelTransport, RiemannianICP, spd
from maniport.errors import InvalidInputError, NotSPDError
from maniport.evaluation import distance_preservation, identity_test, rmse, smoothness, stability


def diagonals(logarithms):
    """Diagonal SPD matrices with these logarithms of their entries, shape (n, d)."""
    return np.exp(np.asarray(logarithms))[:, :, None] * np.eye(np.shape(logarithms)[1])


def line(values):
    """Diagonal SPD matrices along one geodesic, at distances that are differences of the values."""
    return diagonals(np.asarray(values, dtype=float)[:, None] * np.array([[1.0, 0.0, 0.0]]))


def test_rmse_of_balls_in_three_forms():
    """Balls that are all exp(δ) too large are √3 δ off; dispersions are √3 times those of the logarithms."""
    t, delta = np.array([-1.0, 0.0, 0.5, 0.5]), 0.3
    truth, mapped = (np.exp(values)[:, None, None] * np.eye(3) for values in (t, t + delta))
    found = rmse(truth, mapped)
    assert found.undivided == pytest.approx(np.sqrt(3.0) * delta)
    assert found.per_dispersion == pytest.approx(delta / np.mean(np.abs(t)))
    assert found.per_squared_dispersion == pytest.approx(delta / (np.sqrt(3.0) * np.mean(t**2)))
    truth[0] *= np.exp(0.8 / np.sqrt(3.0))
    assert rmse(truth, np.exp(t)[:, None, None] * np.eye(3)).undivided == pytest.approx(0.4)  # one of four


def test_steps_of_a_dilated_profile_are_dilated():
    """M → M^s about the identity multiplies every step by s when the ellipsoids have common axes."""
    path = np.cumsum(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]), axis=0)
    found = smoothness(diagonals(0.5 * path), diagonals(path))
    assert (found.original_median, found.original_largest) == pytest.approx((2.0, 3.0))
    assert (found.median, found.largest) == pytest.approx((1.0, 1.5))
    assert (found.median_ratio, found.largest_ratio) == pytest.approx((0.5, 0.5))


@pytest.mark.parametrize(("angle", "turn"), [(25.0, 25.0), (170.0, 10.0)])
def test_a_rotation_keeps_distances_and_turns_axes(rng, turn_about, angle, turn):
    """M → R M Rᵀ is an isometry; axes have no sign, so that a rotation by 170° is one by 10°."""
    shapes = diagonals(np.array([[2.0, 0.5, -1.0]]) + 0.1 * rng.standard_normal((20, 3)))
    rotation = turn_about(angle)
    found = distance_preservation(rotation @ shapes @ rotation.T, shapes)
    assert found.rank_correlation == pytest.approx(1.0)
    assert found.distortion < 1e-9
    assert (found.major_axis_angle, found.minor_axis_angle) == pytest.approx((turn, 0.0), abs=1e-6)
    assert (found.major_undefined, found.minor_undefined) == (0, 0)


def test_axes_that_are_not_distinct_are_left_out_and_counted():
    """A disc has a shortest axis but no longest one; a ball has neither."""
    discs = diagonals([[1.0, 1.0, 0.0], [1.5, 1.5, 0.0], [2.0, 1.0, 0.0]])
    found = distance_preservation(discs, discs)
    assert (found.major_undefined, found.minor_undefined) == (2, 0)
    balls = diagonals([[0.0] * 3, [1.0] * 3, [3.0] * 3])
    found = distance_preservation(balls, balls)
    assert (found.major_axis_angle, found.minor_axis_angle, found.major_undefined) == (None, None, 3)


def test_distortion_and_rank_correlation_on_a_line():
    """Points 0, 1, 3 mapped to 0, 2, 3 have the ratios 2, 1/2 and 1: median ratio 1, median distortion log 2."""
    found = distance_preservation(line([0, 2, 3]), line([0, 1, 3]))
    assert found.distortion == pytest.approx(np.log(2.0))
    assert found.rank_correlation == pytest.approx(0.5)  # ranks of 1, 3, 2 against those of 2, 3, 1


@pytest.mark.parametrize("adapter", [ParallelTransport(damping=0.01), IdentityMap()], ids=repr)
def test_identity_test_of_equal_samples_is_passed_exactly(make_cloud, rng, turn_about, adapter):
    """Where both sets are the same cloud nothing changes, whatever the base_rotation; the adapter stays as it is."""
    points, base_rotation = make_cloud(rng, 40), turn_about(90.0)
    adapter = adapter.silent().set_params(base_rotation=base_rotation)
    assert identity_test(adapter, points, points) < 1e-9
    assert not hasattr(adapter, "rotation_")
    np.testing.assert_array_equal(adapter.base_rotation, base_rotation)


def test_mean_transport_moves_by_the_distance_of_the_means(make_cloud, rng):
    """Students that differ by exp(δ) move everything by √3 δ: in the identity test and in the stability."""
    points, delta = make_cloud(rng, 40), 0.2
    assert identity_test(MeanTransport(), points, np.exp(delta) * points) == pytest.approx(np.sqrt(3.0) * delta)
    draws = [np.exp(sign * delta) * points for sign in (-1.0, 1.0)]
    found = stability(MeanTransport(), [points, points], draws, points[:5])
    assert found.map_spread == pytest.approx(np.sqrt(3.0) * delta)
    assert found.rotation_largest == pytest.approx(0.0, abs=1e-9)


def test_stability_of_equal_samples_is_perfect_and_that_of_a_lookup_is_not(make_cloud, rng):
    """The same domains give the same map; independent tables give different samples for the same ellipsoid."""
    teacher, student = make_cloud(rng, 40), 2.0 * make_cloud(rng, 50)
    found = stability(RiemannianICP(random_state=0), [teacher] * 3, [student] * 3, teacher[:4])
    assert found.n_draws == 3
    assert max(found.rotation_largest, found.rotation_rms, found.map_spread) < 1e-6
    draws = [[make_cloud(rng, 60) for _ in range(3)] for _ in range(2)]
    assert stability(NearestNeighbor(), *draws, make_cloud(rng, 5)).map_spread > 0.05


def test_rotation_dispersion_is_the_angle_from_the_mean(make_cloud, rng, turn_about):
    """Known mountings are no rotation; rigid images by −10°, 0° and 10° have the middle one as mean."""
    teacher = make_cloud(rng, 60)
    whitened = spd.whiten(teacher, spd.mean(teacher))
    students = [turn_about(angle) @ whitened @ turn_about(angle).T for angle in (-10.0, 0.0, 10.0)]
    found = stability(RiemannianICP(random_state=0), [whitened] * 3, students, whitened[:3])
    assert found.rotation_largest == pytest.approx(10.0, abs=1e-3)
    assert found.rotation_rms == pytest.approx(10.0 * np.sqrt(2.0 / 3.0), abs=1e-3)


POINTS = diagonals(np.random.default_rng(0).standard_normal((5, 3)))
STILL = np.tile(np.eye(3), (5, 1, 1))


@pytest.mark.parametrize(
    ("call", "error", "word"),
    [
        (lambda: rmse(POINTS, POINTS[:4]), InvalidInputError, "5 and 4"),
        (lambda: rmse(POINTS, np.tile(np.diag([1.0, 1.0, 0.0]), (5, 1, 1))), NotSPDError, r"mapped\[0\]"),
        (lambda: rmse(POINTS, STILL), InvalidInputError, "dispersion"),
        (lambda: smoothness(POINTS, STILL), InvalidInputError, "original"),
        (lambda: distance_preservation(POINTS, STILL), InvalidInputError, "original"),
        (lambda: distance_preservation(POINTS, POINTS, most_points=2), InvalidInputError, "most_points"),
        (lambda: stability(IdentityMap(), [POINTS], [POINTS], POINTS), InvalidInputError, "1 and 1"),
        (lambda: stability(IdentityMap(), [POINTS] * 2, [POINTS] * 3, POINTS), InvalidInputError, "2 and 3"),
        (lambda: stability(IdentityMap(), [POINTS] * 2, [POINTS] * 2, POINTS[0]), InvalidInputError, "probe"),
    ],
)
def test_bad_input_is_refused(call, error, word):
    """Other counts, singular ellipsoids and profiles that do not move are errors that name the argument."""
    with pytest.raises(error, match=word):
        call()
