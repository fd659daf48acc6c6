"""The feasibility gap of a profile: against the search for each ellipsoid, and cases with a known answer."""

import numpy as np
import pytest

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.regularization import Regularization
from maniport.tracking import feasibility_gap, nearest_feasible


@pytest.fixture(scope="module")
def own(panda):
    """A path of the Panda's own ellipsoids."""
    start, end = np.array([0, -0.5, 0, -2, 0, 1.8, 0]), np.array([0.5, 0.2, 0.3, -1.2, 0.4, 2.4, 0])
    return panda.manipulability(np.linspace(start, end, 41))


def test_own_ellipsoids_have_no_gap(panda, own):
    """What the arm makes itself it can make."""
    assert feasibility_gap(panda, own).max() < 0.01


def test_gap_is_the_distance_of_the_nearest(panda, own):
    """With as many points as ellipsoids it is what `nearest_feasible` finds."""
    wanted = 3.0 * own[:9]
    found = nearest_feasible(panda, wanted, damping=Regularization.absolute(0.002))
    np.testing.assert_array_equal(
        feasibility_gap(panda, wanted, damping=Regularization.absolute(0.002)), found.distance
    )
    assert found.distance.min() > 0.05


def test_wrong_profiles_are_refused(panda, own):
    """One matrix, none, and matrices that are no ellipsoids are named errors."""
    with pytest.raises(
        InvalidInputError, match=r"profile must have shape \(n, d, d\) with n ≥ 1; found shape \(3, 3\)"
    ):
        feasibility_gap(panda, own[0])
    with pytest.raises(InvalidInputError, match=r"found shape \(0, 3, 3\)"):
        feasibility_gap(panda, own[:0])
    with pytest.raises(NotSPDError, match="profile"):
        feasibility_gap(panda, -own)
    with pytest.raises(InvalidInputError, match="n_points"):
        feasibility_gap(panda, own, n_points=0)
