"""Laws of diffusion maps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import InvalidInputError, NotFittedError, NotSPDError
from maniport.telling.series import MAX_POINTS, DiffusionMap


def diffusion_map(points, n_components=2, bandwidth=1.0):
    """Coordinates of the points that a map is fitted to."""
    return DiffusionMap(n_components, bandwidth).fit(points).coordinates_


def cloud(count, d=3, seed=0, spread=0.7):
    """Make points scattered about the identity."""
    tangents = spread * np.random.default_rng(seed).standard_normal((count, d, d))
    return spd.expm(0.5 * (tangents + np.swapaxes(tangents, 1, 2)))


@pytest.mark.parametrize("d", [2, 3, 6])
def test_congruence_of_all_points_changes_nothing(d):
    """The map sees only affine-invariant distances: another basis or unit gives the same coordinates."""
    points = cloud(60, d)
    basis = np.random.default_rng(1).standard_normal((d, d)) + 3 * np.eye(d)
    assert_allclose(diffusion_map(basis @ points @ basis.T), diffusion_map(points), atol=1e-8)
    assert_allclose(diffusion_map(np.linalg.inv(points)), diffusion_map(points), atol=1e-8)


@pytest.mark.parametrize("bandwidth", [0.1, 1.0])
def test_points_of_a_geodesic_stay_in_order(bandwidth):
    """Along one geodesic the first coordinate rises or falls throughout, however unevenly it is sampled."""
    a, b = cloud(2)
    times = np.sort(np.random.default_rng(0).uniform(0, 1, 80)) ** 2
    steps = np.diff(diffusion_map(spd.geodesic(a, b, times), bandwidth=bandwidth)[:, 0])
    assert np.all(steps > 0) or np.all(steps < 0)


def test_transform_gives_fitted_points_their_coordinates():
    """The Nyström extension of a point of `fit` is its coordinate, alone as in a batch."""
    points = cloud(50)
    chart = DiffusionMap(n_components=3).fit(points)
    assert chart.coordinates_.shape == (50, 3)
    assert_allclose(chart.transform(points), chart.coordinates_, atol=1e-10)
    assert_allclose(chart.transform(points[7:8]), chart.coordinates_[7:8], atol=1e-10)


def test_far_clusters_come_apart():
    """Two clusters that are far from each other have first coordinates of opposite sign."""
    points = np.concatenate([cloud(30, spread=0.2), 50.0 * cloud(40, seed=1, spread=0.2)])
    first = diffusion_map(points)[:, 0]
    assert np.ptp(np.sign(first[:30])) == np.ptp(np.sign(first[30:])) == 0
    assert first[0] * first[-1] < 0
    assert np.abs(first).min() > 3 * max(first[:30].std(), first[30:].std())


def test_density_of_the_samples_does_not_matter():
    """With a narrow kernel, sampling half of a geodesic five times as densely hardly moves the coordinates (α = 1)."""
    a, b = cloud(2)
    even = np.linspace(0, 1, 201)
    dense = np.sort(np.r_[even[even > 0.5], np.linspace(0, 0.5, 501)])
    probe = spd.geodesic(a, b, np.linspace(0, 1, 11))
    charts = [
        DiffusionMap(bandwidth=0.01).fit(spd.geodesic(a, b, times)).transform(probe)[:, 0] for times in (even, dense)
    ]
    charts = [x * np.sign(x[-1]) / np.ptp(x) for x in charts]
    assert_allclose(charts[0], charts[1], atol=0.03)


@pytest.mark.parametrize(
    ("fit", "message"),
    [
        (lambda: diffusion_map(cloud(3)), "points must hold at least 4 matrices; found 3"),
        (lambda: diffusion_map(np.stack([np.eye(3)] * 9)), "points must not be equal"),
        (
            lambda: diffusion_map(np.broadcast_to(np.eye(2), (MAX_POINTS + 1, 2, 2))),
            "at most 3000 matrices; found 3001",
        ),
        (lambda: diffusion_map(cloud(9), n_components=0), "n_components must be a whole number of at least 1; found 0"),
        (lambda: diffusion_map(cloud(9), bandwidth=0.0), "bandwidth must be a number above 0"),
        (lambda: diffusion_map(np.repeat(cloud(2), 4, axis=0), n_components=2), "points span 1 diffusion coordinates"),
        (lambda: DiffusionMap().fit(cloud(9)).transform(cloud(3, d=2)), "points must hold 3×3 matrices; found 2×2"),
    ],
)
def test_what_has_no_map_is_refused(fit, message):
    """Too few, too many, equal or ill-fitting points are refused with what was found and is allowed."""
    with pytest.raises(InvalidInputError, match=message):
        fit()


def test_unfitted_and_singular():
    """An unfitted map says so, and singular points are named."""
    with pytest.raises(NotFittedError, match="call fit first"):
        DiffusionMap().transform(cloud(3))
    with pytest.raises(NotSPDError, match=r"points\[0\] is singular"):
        diffusion_map(np.stack([np.diag([1.0, 1.0, 0.0])] * 9))


def test_outliers_do_not_take_a_coordinate_for_themselves():
    """With two far points among 400, the others still fill a visible part of the map, and not one place."""
    noise = np.random.default_rng(0).normal(size=(398, 3, 3))
    near = spd.exp(np.eye(3), 0.25 * (noise + np.swapaxes(noise, 1, 2)))
    coordinates = diffusion_map(np.concatenate([near, [np.diag([1e3, 1.0, 1.0]), np.diag([1.0, 1e-3, 1.0])]]))
    spread = np.ptp(coordinates[:398], axis=0) / np.ptp(coordinates, axis=0)
    assert spread.min() > 0.05
