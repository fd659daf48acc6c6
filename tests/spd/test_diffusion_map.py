"""Laws of diffusion maps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import InvalidInputError
from maniport.spd.diffusion_map import DiffusionMap, map_of


def cloud(count, d=3, seed=0, spread=0.7):
    """Make points scattered about the identity."""
    tangents = spread * np.random.default_rng(seed).standard_normal((count, d, d))
    return spd.expm(0.5 * (tangents + np.swapaxes(tangents, 1, 2)))


@pytest.mark.parametrize("d", [2, 3, 6])
def test_congruence_of_all_points_changes_nothing(d):
    """The map uses only affine-invariant distances: another basis or unit gives the same coordinates."""
    points, expected = cloud(60, d), DiffusionMap(cloud(60, d)).coordinates
    basis = np.random.default_rng(1).standard_normal((d, d)) + 3 * np.eye(d)
    assert_allclose(DiffusionMap(basis @ points @ basis.T).coordinates, expected, atol=1e-8)
    assert_allclose(DiffusionMap(np.linalg.inv(points)).coordinates, expected, atol=1e-8)


def test_points_of_a_geodesic_stay_in_order():
    """Along one geodesic the first coordinate is monotonic, however unevenly it is sampled."""
    times = np.sort(np.random.default_rng(0).uniform(0, 1, 80)) ** 2
    steps = np.diff(DiffusionMap(spd.geodesic(*cloud(2), times)).coordinates[:, 0])
    assert np.all(steps > 0) or np.all(steps < 0)


def test_transform_gives_fitted_points_their_coordinates():
    """The Nyström extension of a fitted point is its coordinate, alone as in a batch."""
    points = cloud(50)
    chart = DiffusionMap(points)
    assert_allclose(chart.transform(points), chart.coordinates, atol=1e-10)
    assert_allclose(chart.transform(points[7:8]), chart.coordinates[7:8], atol=1e-10)


def test_outliers_do_not_take_a_coordinate_for_themselves():
    """With two far points among 400, the others still fill a visible part of the map."""
    noise = np.random.default_rng(0).normal(size=(398, 3, 3))
    near = spd.exp(np.eye(3), 0.25 * (noise + np.swapaxes(noise, 1, 2)))
    far = [np.diag([1e3, 1.0, 1.0]), np.diag([1.0, 1e-3, 1.0])]
    coordinates = DiffusionMap(np.concatenate([near, far])).coordinates
    assert (np.ptp(coordinates[:398], axis=0) / np.ptp(coordinates, axis=0)).min() > 0.05


@pytest.mark.parametrize("points", [cloud(3), np.stack([np.eye(3)] * 9), np.repeat(cloud(2), 4, axis=0)])
def test_points_without_a_map_are_refused(points):
    """Too few points, equal points, and points on one curve."""
    with pytest.raises(InvalidInputError):
        map_of([points])
