"""Correspondences: partners against exhaustive searches, weights, and the exact rigid map that the search finds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.transfer import EllipsoidCorrespondence, GeodesicCorrespondence
from maniport.transfer.icp.correspondence import CORRESPONDENCES

# how the search ends is tested here, not the use of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")


@pytest.mark.parametrize("kind", CORRESPONDENCES)
@pytest.mark.parametrize("d", [2, 3, 6])
def test_the_smaller_cloud_seeks(kind, d, random_spd, random_rotation):
    rng = np.random.default_rng(d)
    teacher = random_spd(rng, 30, d)
    student = random_spd(rng, 23, d)
    rotation = random_rotation(rng, d)
    matches = CORRESPONDENCES[kind]().between(teacher, student)(rotation)
    other = CORRESPONDENCES[kind]().between(student, teacher)(rotation.T)
    assert matches.student.tolist() == other.teacher.tolist() == [*range(23)]
    assert matches.teacher.tolist() == other.student.tolist()
    assert_allclose(matches.weight, other.weight, rtol=1e-9)
    assert min(matches.weight) > 0
    assert sum(matches.weight) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [10.0, 1e5])
def test_geodesic_partner_is_the_nearest(d, condition, random_spd, random_rotation):
    rng = np.random.default_rng(d)
    teacher = random_spd(rng, 25, d, condition)
    student = random_spd(rng, 60, d, condition)
    rotation = random_rotation(rng, d)
    matches = GeodesicCorrespondence().between(teacher, student)(rotation)
    every = spd.distance((rotation @ teacher @ rotation.T)[:, None], student)
    assert_allclose(every[matches.teacher, matches.student], every.min(axis=1), rtol=1e-6)
    assert_allclose(matches.weight, 1.0 / 25)


def test_geodesic_search_never_raises_its_cost(random_spd):
    rng = np.random.default_rng(0)
    teacher = random_spd(rng, 60, 3)
    student = random_spd(rng, 80, 3)
    options = {"correspondence": "geodesic", "n_starts": 0, "require_improvement": False}
    adapter = mp.RiemannianICP(**options, criterion="correspondence").fit(teacher, student)
    assert np.all(np.diff(adapter.history_) <= 1e-9)
    assert adapter.converged_
    assert adapter.n_iter_ > 1


def scores(teacher, student):
    """All scores, shape (n, m), from eigenvalues and -vectors."""
    (values_t, axes_t), (values_s, axes_s) = (
        np.linalg.eigh(points) for points in (teacher, student)
    )
    directions = sum(np.abs(axes_t[:, :, k] @ axes_s[:, :, k].T) for k in (0, -1))
    shapes = [
        np.array([values[:, -1] / values[:, 0], spd.volume(points)])
        for values, points in ((values_t, teacher), (values_s, student))
    ]
    return directions + np.exp(-np.abs(shapes[0][:, :, None] - shapes[1][:, None, :])).sum(axis=0)


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [1.5, 30.0, 1e4])
@pytest.mark.parametrize("exponent", [0.0, 3.0])
def test_partner_has_the_largest_score(d, condition, exponent, random_spd, random_rotation):
    rng = np.random.default_rng(d)
    teacher = random_spd(rng, 40, d, condition)
    student = random_spd(rng, 300, d, condition)
    turn = random_rotation(rng, d)
    every = scores(turn @ teacher @ turn.T, student)
    matches = EllipsoidCorrespondence(exponent).between(teacher, student)(turn)
    best = every.max(axis=1)
    assert_allclose(every[np.arange(40), matches.student], best, rtol=1e-6)
    assert_allclose(matches.weight, best**exponent / np.sum(best**exponent), rtol=1e-5)
