"""What is done to singular ellipsoids, and what is refused whatever is done."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.regularization import Regularization

FLAT = np.diag([4.0, 2.0, 0.0])
REMEDIES = {
    "none": Regularization(),
    "damping": Regularization(damping=0.1).fitted([FLAT, FLAT]),
    "absolute": Regularization.absolute(0.2),
    "eigenvalue_floor": Regularization(eigenvalue_floor=0.2),
}
remedies = pytest.mark.parametrize("remedy", REMEDIES.values(), ids=REMEDIES)


@pytest.mark.parametrize("shape", [(), (5,), (2, 5)])
@pytest.mark.parametrize(
    ("remedy", "values"),
    [("damping", [4.2, 2.2, 0.2]), ("absolute", [4.2, 2.2, 0.2]), ("eigenvalue_floor", [4.0, 2.0, 0.2])],
)
def test_a_flat_ellipsoid_gets_volume(remedy, values, shape):
    """ρ times the mean eigenvalue, or ε, is added to every eigenvalue; a floor lifts the lowest. In every batch."""
    given = np.broadcast_to(FLAT, (*shape, 3, 3))
    assert_allclose(REMEDIES[remedy].apply(given), np.broadcast_to(np.diag(values), given.shape), rtol=1e-14)
    assert_allclose(given, np.broadcast_to(FLAT, given.shape), atol=0.0)


def test_without_a_remedy_it_is_refused_with_advice():
    """The default name is that of the argument."""
    with pytest.raises(NotSPDError, match=r"^points is singular.*give damping=0\.01 .*eigenvalue_floor=1e-4"):
        Regularization().apply(FLAT)


@remedies
def test_other_matrices_are_refused_by_name(remedy):
    """Whatever is done to ellipsoids, they must have the stated size and no negative eigenvalue."""
    with pytest.raises(InvalidInputError, match=r"^path must hold 3×3 matrices; found 2×2"):
        remedy.apply(np.eye(2), "path", 3)
    with pytest.raises(NotSPDError, match=r"^path\[1\] is indefinite"):
        remedy.apply([np.eye(3), np.diag([1.0, 1.0, -9.0])], "path", 3)


def test_damping_lost_in_rounding_is_refused_by_name():
    """Where ε is less than what rounding leaves of the largest eigenvalue, the ellipsoid still is singular."""
    with pytest.raises(NotSPDError, match=r"^path is singular"):
        Regularization.absolute(1e-14).apply(1e6 * FLAT, "path")


@pytest.mark.parametrize("epsilon", [0.0, -1.0, np.nan])
def test_damping_is_above_zero(epsilon):
    """ε is a number above zero."""
    with pytest.raises(InvalidInputError, match=rf"^epsilon must be a number above 0; found {epsilon}"):
        Regularization.absolute(epsilon)


@pytest.mark.parametrize("remedy", ["damping", "eigenvalue_floor"])
def test_remedies_are_numbers_above_zero(remedy):
    """The remedy is named; what is a number is kept as one."""
    with pytest.raises(InvalidInputError, match=rf"^{remedy} must be a number above 0; found -0\.5"):
        Regularization(**{remedy: -0.5})
    kept = getattr(Regularization(**{remedy: np.float32(0.5)}), remedy)
    assert type(kept) is float
    assert kept == 0.5


def test_damping_and_a_floor_exclude_one_another():
    """Both are named."""
    with pytest.raises(InvalidInputError, match="exclude each other"):
        Regularization(damping=0.1, eigenvalue_floor=0.2)
