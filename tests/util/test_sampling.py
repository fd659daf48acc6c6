import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import qmc, spearmanr

from maniport.util.sampling import rank_correlation, sobol


@pytest.mark.parametrize(("dimension", "exponent"), [(1, 0), (7, 12), (32, 8), (40, 3)])
def test_sobol_points_are_those_of_scipy(dimension, exponent):
    ours, theirs = np.random.default_rng(5), np.random.default_rng(5)
    for _ in range(2):
        expected = qmc.Sobol(dimension, rng=theirs).random_base2(exponent)
        assert_array_equal(sobol(dimension, exponent, ours), expected)


def test_rank_correlation_averages_ties():
    a, b = np.random.default_rng(0).integers(9, size=(2, 200))
    assert rank_correlation(a, b) == pytest.approx(spearmanr(a, b).statistic, abs=1e-12)
