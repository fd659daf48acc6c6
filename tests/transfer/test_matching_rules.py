"""Matching rules against exhaustive searches: largest score, nearest, one to one, and optimal transport."""

from itertools import permutations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.transfer import EllipsoidCorrespondence, GeodesicCorrespondence, Search
from maniport.transfer.icp.correspondence import CORRESPONDENCES
from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")

assignments = pytest.mark.parametrize("kind", ["one-to-one", "transport"])


def squared(teacher, student, rotation):
    """All squared distances under a rotation of the teacher."""
    return spd.distance((rotation @ teacher @ rotation.T)[:, None], student) ** 2


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [10.0, 1e5])
def test_geodesic_partner_is_the_nearest(d, condition, random_spd, random_rotation):
    """No other student ellipsoid is nearer, and all matches weigh the same."""
    rng = np.random.default_rng(d)
    teacher, student = random_spd(rng, 25, d, condition), random_spd(rng, 60, d, condition)
    seek = CORRESPONDENCES["geodesic"]().between(teacher, student)
    for _ in range(3):
        rotation = random_rotation(rng, d)
        found, every = seek(rotation), squared(teacher, student, rotation)
        assert_allclose(every[found.teacher, found.student], every.min(axis=1), rtol=1e-6)
        assert_allclose(found.weight, 1.0 / 25)


def test_geodesic_search_never_raises_its_cost(random_spd):
    """Nearest matches and rotations have one objective: it falls in every iteration, trimmed or not."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 60, 3), random_spd(rng, 80, 3)
    for trim in (0.0, 0.2):
        adapter = mp.RiemannianICP(
            correspondence=GeodesicCorrespondence(trim=trim), search=Search(n_starts=0, require_improvement=False)
        ).fit(teacher, student)
        assert np.all(np.diff(adapter.history_) <= 1e-9)
        assert adapter.converged_
        assert adapter.n_iter_ > 1


@assignments
def test_sum_of_squared_distances_is_the_least(kind, random_spd, random_rotation):
    """Of all permutations of six ellipsoids none has a smaller sum."""
    rng = np.random.default_rng(1)
    teacher, student, rotation = random_spd(rng, 6, 3), random_spd(rng, 6, 3), random_rotation(rng, 3)
    every = squared(teacher, student, rotation)
    found = CORRESPONDENCES[kind]().between(teacher, student)(rotation)
    least = min(every[np.arange(6), list(order)].sum() for order in permutations(range(6)))
    assert every[found.teacher, found.student].sum() == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize(("n", "m"), [(12, 7), (15, 15)])
def test_trimmed_plan_is_partial_transport(n, m, random_spd):
    """A trimmed plan costs what POT's partial transport of the rest of the mass costs, and nobody gives too much."""
    from ot.partial import partial_wasserstein2

    rng = np.random.default_rng(4)
    teacher, student = random_spd(rng, n, 3), random_spd(rng, m, 3)
    cost = squared(teacher, student, np.eye(3))
    found = CORRESPONDENCES["transport"](trim=0.3).between(teacher, student)(np.eye(3))
    least = partial_wasserstein2(np.full(n, 1 / n), np.full(m, 1 / m), cost, m=0.7)
    assert 0.7 * found.weight @ cost[found.teacher, found.student] == pytest.approx(least, rel=1e-9)
    assert 0.7 * np.bincount(found.teacher, found.weight, n).max() <= 1.0 / n + 1e-12
    assert 0.7 * np.bincount(found.student, found.weight, m).max() <= 1.0 / m + 1e-12


@assignments
def test_too_large_domains_are_refused(kind, random_spd, monkeypatch):
    """Beyond the limit the sizes and the remedies are named."""
    monkeypatch.setattr("maniport.transfer.icp.correspondence.LIMIT", 20)
    rng = np.random.default_rng(6)
    small, large = random_spd(rng, 20, 3), random_spd(rng, 21, 3)
    with pytest.raises(InvalidInputError, match=f"'{kind}' matches at most 20 .* found 21 and 20.*most_singular=20"):
        mp.RiemannianICP(correspondence=kind).fit(large, small)
    mp.RiemannianICP(correspondence=kind, search=Search(most_singular=20, max_iter=1, n_starts=0)).fit(large, small)


def scores(teacher, student, ratios=False):
    """All scores, shape (n, m), from eigenvalues and -vectors."""
    (values_t, axes_t), (values_s, axes_s) = (np.linalg.eigh(points) for points in (teacher, student))
    directions = sum(np.abs(axes_t[:, :, k] @ axes_s[:, :, k].T) for k in (0, -1))
    shapes = [
        [values[:, -1] / values[:, 0], np.sqrt(np.linalg.det(points))]
        for values, points in ((values_t, teacher), (values_s, student))
    ]
    shapes = [np.log(shape) if ratios else np.array(shape) for shape in shapes]
    return directions + np.exp(-np.abs(shapes[0][:, :, None] - shapes[1][:, None, :])).sum(axis=0)


@pytest.mark.parametrize("ratios", [False, True])
@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [1.5, 30.0, 1e4])
def test_partner_has_the_largest_score(ratios, d, condition, random_spd, random_rotation):
    """Under any rotation, no other ellipsoid has a larger score."""
    rng = np.random.default_rng(d)
    teacher, student, turn = (
        random_spd(rng, 40, d, condition),
        random_spd(rng, 300, d, condition),
        random_rotation(rng, d),
    )
    every = scores(turn @ teacher @ turn.T, student, ratios)
    features = (EllipsoidFeatures.of(points, ratios) for points in (teacher, student))
    index, score = ScoreMatcher(*features).query(turn)
    assert_allclose(score, every.max(axis=1), rtol=1e-6)
    assert_allclose(every[np.arange(40), index], every.max(axis=1), rtol=1e-6)


def test_weights_are_powers_of_the_score(random_spd):
    """Matches weigh w^k; an exponent of zero gives equal weights."""
    rng = np.random.default_rng(1)
    teacher, student = random_spd(rng, 20, 3), random_spd(rng, 30, 3)
    best = scores(teacher, student).max(axis=1)
    for exponent in (0.0, 3.0):
        found = EllipsoidCorrespondence(exponent=exponent).between(teacher, student)(np.eye(3))
        assert_allclose(found.weight, best**exponent / np.sum(best**exponent), rtol=1e-6)
