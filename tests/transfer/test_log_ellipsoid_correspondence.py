"""The score with shapes compared by ratio, against trying every pair."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.transfer.icp.correspondence import CORRESPONDENCES


def every_score(teacher, student):
    """Work out |v₁·v₁'| + |v_n·v_n'| + min(p/p', p'/p) + min(vol/vol', vol'/vol) for all pairs, literally."""
    shapes = []
    for points in (teacher, student):
        values, vectors = np.linalg.eigh(points)
        shapes.append((vectors[..., 0], vectors[..., -1], values[:, -1] / values[:, 0], np.sqrt(values.prod(axis=1))))
    (low_t, high_t, p_t, v_t), (low_s, high_s, p_s, v_s) = shapes
    score = np.abs(low_t @ low_s.T) + np.abs(high_t @ high_s.T)
    for one, other in ((p_t, p_s), (v_t, v_s)):
        ratio = one[:, None] / other
        score += np.minimum(ratio, 1.0 / ratio)
    return score


@pytest.mark.parametrize("condition", [5.0, 1e3, 1e8])
@pytest.mark.parametrize("m", [1, 40, 900])
def test_score_is_the_largest_of_all(condition, m, random_spd, random_rotation):
    """No other student ellipsoid has a larger score, and weights are its powers."""
    rng = np.random.default_rng(m)
    teacher, rotation = random_spd(rng, 20, 3, condition), random_rotation(rng, 3)
    student = random_spd(rng, m, 3, condition)
    found = CORRESPONDENCES["log-ellipsoid"](direction="teacher", exponent=2.0).between(teacher, student)(rotation)
    every = every_score(rotation @ teacher @ rotation.T, student)
    best = every.max(axis=1)
    assert_allclose(every[found.teacher, found.student], best, rtol=1e-6)
    assert_allclose(found.weight, best**2 / np.sum(best**2), rtol=1e-6)


def test_elongated_ellipsoids_keep_a_shape(random_spd):
    """Where directions are equal, the partner of similar condition is found at 10⁴ too, by the logarithms only."""
    student = np.stack([np.diag([1.0, 2.0, p]) for p in (8000.0, 30000.0)])
    student /= np.cbrt(np.linalg.det(student))[:, None, None]
    teacher = np.diag([1.0, 2.0, 20000.0])[None] / np.cbrt(40000.0)
    turned = np.diag([1.0, 1.0, 1.0])
    found = CORRESPONDENCES["log-ellipsoid"]().between(teacher, student)(turned)
    assert_array_equal(found.student, [1])
    assert_array_equal(CORRESPONDENCES["ellipsoid"]().between(teacher, student[::-1])(turned).student, [0])
    assert_array_equal(CORRESPONDENCES["log-ellipsoid"]().between(teacher, student[::-1])(turned).student, [0])
