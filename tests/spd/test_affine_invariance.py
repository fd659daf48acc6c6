"""Laws of the affine-invariant metric and its accuracy on graded matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import NotSPDError

sizes = pytest.mark.parametrize(("d", "shape"), [(2, ()), (3, (5,)), (6, (2, 3)), (12, (5,))])
seeds = given(seed=st.integers(0, 2**32 - 1))


def test_distance_is_exact_for_graded_matrices():
    """A change of unit along one axis, however large, does not cost the distance its digits."""
    a = np.array([[2.0, 0.5, 0.1], [0.5, 1.0, 0.2], [0.1, 0.2, 3.0]])
    b = np.array([[1.0, 0.0, 0.3], [0.0, 2.0, 0.1], [0.3, 0.1, 1.0]])
    units = np.array([1e-3, 1.0, 1e3])
    scaled = a * np.outer(units, units), b * np.outer(units, units)
    assert_allclose(spd.distance(*scaled), spd.distance(a, b), rtol=1e-9)


def test_points_too_ill_conditioned_for_each_other_are_refused(random_spd):
    """Where rounding moves a result too far, an error says how far; the distance, which it moves less, is computed."""
    rng = np.random.default_rng(0)
    a, b = random_spd(rng, (2, 500), 6, condition=5e12)
    assert np.all(np.abs(spd.distance(a, b) - spd.distance(b, a)) < 0.01)
    for operation in (
        spd.log,
        spd.whiten,
        spd.unwhiten,
        lambda x, y: spd.exp(x, x),
        lambda x, y: spd.geodesic(x, y, 0.5),
        lambda x, y: spd.transport(x, x, y),
    ):
        with pytest.raises(NotSPDError, match=r"too ill-conditioned together: rounding may move .*; allowed .* 0\.01"):
            operation(a, b)


@pytest.mark.filterwarnings("error")
def test_results_out_of_range_are_refused():
    """An exponential or a geodesic that would overflow or vanish names the argument, without inf, zero or a warning."""
    eye = np.eye(3)
    for factor in (-1000.0, 1000.0):
        with pytest.raises(ValueError, match="tangent takes the result out of range"):
            spd.exp(eye, factor * eye)
        with pytest.raises(ValueError, match="t takes the result out of range"):
            spd.geodesic(eye, 2 * eye, factor)
