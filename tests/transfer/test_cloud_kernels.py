"""Loops over all pairs of vectors say what NumPy and SciPy say, whether a block is filled or not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.distance import cdist

from maniport.transfer.cloud_kernels import beside, count_above, nearest_distances, sum_distances

COUNTS = [(1, 1), (5, 16), (40, 37)]


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_distances_are_added_up_over_rows_and_columns(n, m):
    """Nothing that fills up a block counts."""
    one, other = (np.random.default_rng(seed).normal(size=(count, 6)) for seed, count in enumerate((n, m)))
    others, sums = beside(other), np.empty(n)
    columns = np.empty(others.shape[1:])
    sum_distances(one, others, beside(np.ones((m, 1)))[0], sums, columns)
    assert_allclose(sums, cdist(one, other).sum(axis=1), rtol=1e-13)
    assert_allclose(columns.ravel()[:m], cdist(one, other).sum(axis=0), rtol=1e-13)


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_the_nearest_is_found(n, m):
    """The distance to the nearest is the least of all, and that of a copy is zero."""
    one, other = (np.random.default_rng(seed).normal(size=(count, 6)) for seed, count in enumerate((n, m)))
    other[0], found = one[0], np.empty(n)
    nearest_distances(one, beside(other, fill=np.inf), found)
    assert found[0] == 0.0
    assert_allclose(found, cdist(one, other).min(axis=1), rtol=1e-13)


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_scalar_products_above_a_limit_are_counted(n, m):
    """For each of the others, over all vectors."""
    one, other = (np.random.default_rng(seed).normal(size=(count, 9)) for seed, count in enumerate((n, m)))
    others = beside(other)
    found = np.empty(others.shape[1:])
    count_above(one, others, 1.0, found)
    assert_array_equal(found.ravel()[:m], np.sum(one @ other.T > 1.0, axis=0))
