from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.learning import ProfileGMM, align
from maniport.learning.alignment import agreement, axis_deviations, cheapest_path
from maniport.spd.ellipsoid import lengths


def cheapest_of_all(costs):
    @cache
    def follow(i, j):
        if (i, j) == (0, 0):
            return [costs[0, 0]]
        before = [(a, b) for a, b in ((i - 1, j), (i, j - 1), (i - 1, j - 1)) if a >= 0 and b >= 0]
        return [total + costs[i, j] for entry in before for total in follow(*entry)]

    return min(follow(costs.shape[0] - 1, costs.shape[1] - 1))


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 1), (3, 4), (5, 5), (6, 4)])
def test_path_is_the_cheapest_of_all(shape):
    rng = np.random.default_rng(sum(shape))
    for _ in range(5):
        costs = rng.random(shape)
        path, cost = cheapest_path(costs)
        assert cost == pytest.approx(cheapest_of_all(costs), rel=1e-12)
        assert costs[tuple(path.T)].sum() == pytest.approx(cost, rel=1e-12)
        assert_array_equal(path[[0, -1]], [[0, 0], [shape[0] - 1, shape[1] - 1]])
        steps = np.diff(path, axis=0)
        assert np.all((steps >= 0) & (steps <= 1))
        assert np.all(steps.sum(axis=1) >= 1)


def test_known_warp_is_recovered(truth):
    time = np.linspace(0.0, 1.0, 60)
    slow = np.linspace(0.0, 1.0, 150)
    pace = slow**1.6
    result = align([truth(time), truth(pace)], [2 * time, slow], reference=0)
    assert_array_equal(result.time, 2 * time)
    assert spd.distance(result.ellipsoids[1], truth(time)).max() < 0.06
    assert spd.distance(truth(np.interp(time, slow, slow)), truth(time**1.6)).max() > 0.5
    warped = result.warp([time, pace])
    assert np.abs(warped[1] - time).max() < 0.02
    assert_array_equal(warped[0], time)


def test_medoid_is_the_reference(truth, demonstrate):
    time = np.linspace(0.0, 1.0, 20)
    rng = np.random.default_rng(1)
    demos = demonstrate(rng, 4, time, 0.1)
    demos = np.concatenate([demos[:2], truth(time)[None], 2.0 * demos[2:]])
    assert align(demos).reference == 2


TIME = np.linspace(0.0, 1.0, 16)


def judged(profiles, components=2):
    alignment = align(profiles)
    model = ProfileGMM(components).fit(*alignment.stacked())
    return agreement(list(profiles), alignment, model)


def test_equal_demonstrations_agree_wholly(truth):
    found = judged([truth(TIME), truth(TIME), np.repeat(truth(TIME), 2, axis=0)])
    assert found.after == pytest.approx(0.0, abs=1e-6)
    assert found.share == pytest.approx(0.0, abs=1e-6)
    assert_allclose(found.held_out.mean, 0.0, atol=1e-6)
    assert_allclose(found.held_out.nearest, 0.0, atol=1e-6)
    assert found.outlier is None


def test_the_odd_one_is_found(truth):
    profile = truth(TIME)
    four = judged([profile, profile, profile, spd.powm(profile, -1.0)])
    assert four.outlier == 3
    assert np.argmax(four.held_out.nearest) == 3
    assert_allclose(four.apart, four.apart.T)
    assert_allclose(four.apart[:3, :3], 0.0, atol=1e-6)


def test_deviations_of_axes_are_those_of_samples(truth, scatter):
    rng = np.random.default_rng(2)
    profile = truth(np.array([0.3, 0.8]))
    root = 0.02 * rng.standard_normal((2, 6, 6))
    drawn = scatter(profile, np.einsum("nab,snb->sna", root, rng.standard_normal((20000, 2, 6))))
    found = axis_deviations(profile, root @ np.swapaxes(root, 1, 2))
    assert_allclose(found, np.log(lengths(drawn)).std(axis=0), rtol=0.06)
