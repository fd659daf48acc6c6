"""Sobol sequences against SciPy's."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import qmc

from maniport.util.sobol import sobol


@pytest.mark.parametrize("dimension", [*range(1, 18)])
@pytest.mark.parametrize("exponent", [0, 1, 7])
def test_points_and_generators_are_those_of_scipy(dimension, exponent):
    ours = np.random.default_rng(dimension)
    theirs = np.random.default_rng(dimension)
    for _ in range(2):
        points = sobol(dimension, exponent, ours)
        expected = qmc.Sobol(dimension, rng=theirs).random_base2(exponent)
        assert_array_equal(points, expected)
    assert ours.random() == theirs.random()
