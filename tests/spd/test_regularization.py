import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.regularization import Regularization

FLAT = np.diag([4.0, 2.0, 0.0])
REMEDIES = {
    "none": Regularization(),
    "damping": Regularization(damping=0.1).fitted([FLAT, FLAT]),
    "absolute": Regularization(epsilon=0.2),
}


@pytest.mark.parametrize("shape", [(), (5,), (2, 5)])
@pytest.mark.parametrize("remedy", ["damping", "absolute"])
def test_a_flat_ellipsoid_gets_volume(remedy, shape):
    flat = np.broadcast_to(FLAT, (*shape, 3, 3))
    expected = np.broadcast_to(np.diag([4.2, 2.2, 0.2]), flat.shape)
    assert_allclose(REMEDIES[remedy].apply(flat), expected, rtol=1e-14)


@pytest.mark.parametrize("remedy", REMEDIES.values(), ids=REMEDIES)
def test_other_matrices_are_refused_by_name(remedy):
    with pytest.raises(InvalidInputError, match=r"^path.*3×3.*2×2"):
        remedy.apply(np.eye(2), "path", 3)
    with pytest.raises(NotSPDError, match=r"^path\[1\].*indefinite"):
        remedy.apply([np.eye(3), np.diag([1.0, 1.0, -9.0])], "path", 3)


def test_without_damping_it_is_refused_with_advice_and_by_name_where_damping_is_lost_in_rounding():
    with pytest.raises(NotSPDError, match=r"^points.*damping=0\.01"):
        Regularization().apply(FLAT)
    with pytest.raises(NotSPDError, match=r"^path.*singular"):
        Regularization(epsilon=1e-14).apply(1e6 * FLAT, "path")
