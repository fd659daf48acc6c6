"""Matrix functions against SciPy, and Mandel vectors."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd


@pytest.mark.parametrize("d", [2, 3, 6, 12])
def test_matrix_functions_agree_with_scipy(d, random_spd, random_symmetric):
    """SciPy's general algorithms for logm, expm, sqrtm and powers give the same matrices; results are symmetric."""
    rng = np.random.default_rng(4)
    x, tangent = random_spd(rng, (), d), random_symmetric(rng, (), d)
    for result, expected in (
        (spd.logm(x), scipy.linalg.logm(x)),
        (spd.expm(tangent), scipy.linalg.expm(tangent)),
        (spd.sqrtm(x), scipy.linalg.sqrtm(x)),
        (spd.invsqrtm(x), scipy.linalg.inv(scipy.linalg.sqrtm(x))),
        (spd.powm(x, 0.37), scipy.linalg.fractional_matrix_power(x, 0.37)),
    ):
        assert_allclose(result, expected, rtol=1e-11, atol=1e-10)
        assert_array_equal(result, result.T)


def test_mandel_vectors_have_the_stated_order():
    """Diagonal first, then the rows of the upper triangle times √2."""
    matrix = np.array([[1.0, 4.0, 5.0], [4.0, 2.0, 6.0], [5.0, 6.0, 3.0]])
    assert_allclose(spd.to_vector(matrix), [1, 2, 3, 4 * 2**0.5, 5 * 2**0.5, 6 * 2**0.5], rtol=1e-15)
