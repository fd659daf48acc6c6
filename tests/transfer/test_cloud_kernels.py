"""Loops over all pairs of vectors compute what NumPy and SciPy do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.distance import cdist

from maniport.transfer.cloud_kernels import count_above, nearest_distances, sum_distances

COUNTS = [(1, 1), (5, 16), (40, 37)]


def clouds(n, m, k):
    """Vectors (n, k) and (m, k)."""
    return (np.random.default_rng(seed).normal(size=(count, k)) for seed, count in enumerate((n, m)))


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_distances_are_added_up_over_rows_and_columns(n, m):
    """Both sums of all distances."""
    one, other = clouds(n, m, 6)
    rows, columns = np.empty(n), np.empty(m)
    sum_distances(one, np.ascontiguousarray(other.T), rows, columns)
    assert_allclose(rows, cdist(one, other).sum(axis=1), rtol=1e-13)
    assert_allclose(columns, cdist(one, other).sum(axis=0), rtol=1e-13)


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_the_nearest_is_found(n, m):
    """The distance to the nearest is the least of all, and that of a copy is zero."""
    one, other = clouds(n, m, 6)
    other[0], found = one[0], np.empty(n)
    nearest_distances(one, np.ascontiguousarray(other.T), found)
    assert found[0] == 0.0
    assert_allclose(found, cdist(one, other).min(axis=1), rtol=1e-13)


@pytest.mark.parametrize(("n", "m"), COUNTS)
def test_scalar_products_above_a_limit_are_counted(n, m):
    """For each of the others, over all vectors."""
    one, other = clouds(n, m, 9)
    found = np.empty(m)
    count_above(one, np.ascontiguousarray(other.T), 1.0, found)
    assert_array_equal(found, np.sum(one @ other.T > 1.0, axis=0))
