import numpy as np
import pytest
from scipy.stats import spearmanr

from maniport.util.sampling import rank_correlation


def test_rank_correlation_averages_ties():
    a, b = np.random.default_rng(0).integers(9, size=(2, 200))
    assert rank_correlation(a, b) == pytest.approx(spearmanr(a, b).statistic, abs=1e-12)
