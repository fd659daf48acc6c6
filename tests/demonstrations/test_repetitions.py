"""Times at which a motion is repeated, and parts of fits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport.demonstrations import Recording, fit_arm
from maniport.demonstrations.repetitions import repetitions
from maniport.errors import InvalidInputError


@pytest.fixture(scope="module")
def fit(repeated):
    """The arm of a person who reaches out four times."""
    return fit_arm(repeated)


def test_a_motion_that_is_repeated_is_found(fit):
    """Each time that the hand goes out and back is found, with rests of unequal length between, and none overlaps."""
    found = np.array(repetitions(fit))
    assert_allclose(found.mean(axis=1), [1.0, 2.2, 4.0, 6.5], atol=0.05)
    assert np.all(found[1:, 0] >= found[:-1, 1])


def test_time_that_runs_later_moves_what_is_found(repeated, fit):
    """The clock of a recording does not matter: what is found moves with it."""
    later = Recording(repeated.names, repeated.positions, repeated.time + 100.0)
    assert_allclose(repetitions(fit_arm(later)), np.array(repetitions(fit)) + 100.0, atol=1e-6)


def test_who_stands_still_repeats_nothing(fit):
    """Without motion, and of a moment, there is no repetition."""
    assert repetitions(fit.crop(0.0, 0.04)) == []
    assert len(repetitions(fit.crop(4.8, 5.6))) < 2


def test_a_part_of_a_fit_is_what_was_fitted_then(fit):
    """Every row of a cropped fit is that of the same frame in the whole."""
    part = fit.crop(2.0, 3.0)
    assert 2.0 <= part.time[0] < part.time[-1] <= 3.0
    rows = np.searchsorted(fit.frames, part.frames)
    for name in ("joint_angles", "time", "residual", "beyond_limit"):
        assert_array_equal(getattr(part, name), getattr(fit, name)[rows])
    with pytest.raises(InvalidInputError, match="no frame lies between 9 and 10 s"):
        fit.crop(9.0, 10.0)
