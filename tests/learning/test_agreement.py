"""How alike demonstrations are, and what leaving one out tells."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.learning import ProfileGMM, align
from maniport.learning.agreement import agreement, axis_deviations
from maniport.spd.ellipsoid import lengths

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
