"""Laws of the affine-invariant metric and its accuracy on graded matrices."""

import numpy as np
import pytest

from maniport import spd
from maniport.errors import NotSPDError


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
