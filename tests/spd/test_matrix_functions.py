"""Matrix functions against their laws and SciPy, and Mandel vectors."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.errors import NotSPDError
from maniport.spd.matrix_functions import logarithm

sizes = pytest.mark.parametrize(("d", "shape"), [(2, ()), (3, (5,)), (6, (2, 3)), (12, (5,))])


@sizes
def test_results_are_exactly_symmetric(d, shape, random_spd, random_symmetric):
    """Rounding never leaves a result asymmetric."""
    rng = np.random.default_rng(2)
    x, tangent = random_spd(rng, shape, d), random_symmetric(rng, shape, d)
    for result in (spd.logm(x), spd.expm(tangent), spd.sqrtm(x), spd.invsqrtm(x), spd.powm(x, 0.3)):
        assert_array_equal(result, np.swapaxes(result, -1, -2))


@pytest.mark.parametrize("d", [2, 3, 6, 12])
def test_matrix_functions_agree_with_scipy(d, random_spd, random_symmetric):
    """SciPy's general algorithms for logm, expm, sqrtm and fractional powers give the same matrices."""
    rng = np.random.default_rng(4)
    x, tangent = random_spd(rng, (), d), random_symmetric(rng, (), d)
    assert_allclose(spd.logm(x), scipy.linalg.logm(x), atol=1e-10)
    assert_allclose(spd.expm(tangent), scipy.linalg.expm(tangent), rtol=1e-11, atol=1e-11)
    assert_allclose(spd.sqrtm(x), scipy.linalg.sqrtm(x), atol=1e-10)
    assert_allclose(spd.invsqrtm(x), scipy.linalg.inv(scipy.linalg.sqrtm(x)), atol=1e-10)
    assert_allclose(spd.powm(x, 0.37), scipy.linalg.fractional_matrix_power(x, 0.37), atol=1e-10)


def test_exponent_out_of_range_is_refused():
    """A power or exponential beyond the floating-point numbers is an error, not inf or zero."""
    for exponent in (5000.0, -5000.0):
        with pytest.raises(ValueError, match="exponent takes the result out of range"):
            spd.powm(2 * np.eye(3), exponent)
        with pytest.raises(ValueError, match="symmetric takes the result out of range"):
            spd.expm(exponent * np.eye(3))


def test_mandel_vectors_have_the_stated_order():
    """Diagonal first, then the rows of the upper triangle times √2."""
    matrix = np.array([[1.0, 4.0, 5.0], [4.0, 2.0, 6.0], [5.0, 6.0, 3.0]])
    assert_allclose(spd.to_vector(matrix), [1, 2, 3, 4 * 2**0.5, 5 * 2**0.5, 6 * 2**0.5], rtol=1e-15)


@pytest.mark.parametrize("length", [0, 1, 2, 4, 5, 91])
def test_vectors_of_impossible_length_are_refused(length):
    """A vector whose length belongs to no matrix from 2×2 to 12×12 is refused with its shape."""
    with pytest.raises(ValueError, match=rf"vector must have d \(d \+ 1\) / 2 entries.*found shape \({length},\)"):
        spd.from_vector(np.zeros(length))
    with pytest.raises(ValueError, match=r"vector .*found shape \(\)"):
        spd.from_vector(1.0)


@pytest.mark.parametrize("lowest", [0.0, -1e-9])
def test_products_that_rounding_made_singular_are_refused(lowest):
    """A logarithm of zero is none: it is refused as one of a negative eigenvalue is."""
    with pytest.raises(NotSPDError, match="too ill-conditioned"):
        logarithm(np.array([np.eye(3), np.diag([1.0, 1.0, lowest])]))
