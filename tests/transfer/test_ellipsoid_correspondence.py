"""The paper's score, by ratios too: the largest of all, its invariances, and ties."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.transfer import EllipsoidCorrespondence
from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher


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


def test_equal_eigenvalues_do_not_decide():
    """The direction of a round ellipsoid's axis is undefined and adds nothing."""
    disc, needle = np.diag([1.0, 1.0, 4.0]), np.diag([1.0, 2.0, 4.0])
    features = EllipsoidFeatures.of(np.stack([disc, needle, np.eye(3)]))
    assert_allclose(np.linalg.norm(features.directions, axis=2), [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]])


def test_weights_are_powers_of_the_score(random_spd):
    """Matches weigh w^k; an exponent of zero gives equal weights."""
    rng = np.random.default_rng(1)
    teacher, student = random_spd(rng, 20, 3), random_spd(rng, 30, 3)
    best = scores(teacher, student).max(axis=1)
    for exponent in (0.0, 3.0):
        found = EllipsoidCorrespondence(exponent=exponent).between(teacher, student)(np.eye(3))
        assert_allclose(found.weight, best**exponent / np.sum(best**exponent), rtol=1e-6)
