"""The eigen-decomposition kernel, against LAPACK."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport.spd.kernels import eigh

sizes = pytest.mark.parametrize("d", [2, 3, 6, 11, 12])


@sizes
@given(seed=st.integers(0, 2**32 - 1), exponent=st.floats(-60, 60))
def test_decomposition_rebuilds_symmetric_matrices(d, seed, exponent, random_symmetric):
    """V diag(λ) Vᵀ is the matrix, V is orthonormal and λ ascending and LAPACK's, at any scale."""
    a = 10.0**exponent * random_symmetric(np.random.default_rng(seed), (2, 5), d)
    values, vectors = eigh(a)
    size = np.abs(a).max()
    assert np.all(np.diff(values, axis=-1) >= 0)
    assert_allclose(values / size, np.linalg.eigvalsh(a) / size, atol=1e-13)
    assert_allclose((vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2) / size, a / size, atol=1e-13)
    assert_allclose(np.swapaxes(vectors, -1, -2) @ vectors, np.broadcast_to(np.eye(d), a.shape), atol=1e-13)


@pytest.mark.parametrize("d", [2, 3, 6])
def test_small_eigenvalues_of_graded_matrices_keep_their_digits(d, random_spd):
    """D A D with a diagonal D from 1e-6 to 1 has all eigenvalues to 1e-12, where an absolute error would lose them."""
    a = random_spd(np.random.default_rng(4), (20,), d, condition=5.0)
    grading = np.logspace(-6, 0, d)
    graded = a * np.outer(grading, grading)
    # the inverse is graded the other way round, and its largest eigenvalue is accurate for any backward stable method
    inverse = np.linalg.inv(a) / np.outer(grading, grading)
    expected = 1.0 / np.linalg.eigvalsh(0.5 * (inverse + np.swapaxes(inverse, -1, -2)))[:, -1]
    assert_allclose(eigh(graded)[0][:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("rank", [0, 1, 2])
def test_rank_deficient_products_are_decomposed(d, rank, random_spd):
    """J Jᵀ of a rank-deficient J has as many eigenvalues of rounding size as it lacks ranks, none of them nan."""
    jacobian = np.random.default_rng(6).standard_normal((30, d, rank))
    products = jacobian @ np.swapaxes(jacobian, 1, 2)
    values, vectors = eigh(products)
    missing = max(d - rank, 0)
    assert np.all(np.abs(values[:, :missing]) <= 1e-14 * np.trace(products, axis1=1, axis2=2)[:, None])
    assert_allclose(np.swapaxes(vectors, -1, -2) @ vectors, np.broadcast_to(np.eye(d), products.shape), atol=1e-13)
