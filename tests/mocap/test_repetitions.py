"""Times at which a motion is repeated, and parts of fits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.mocap import fit_arm
from maniport.mocap.repetitions import repetitions


@pytest.fixture(scope="module")
def fit(repeated):
    """The arm of a person who reaches out four times."""
    return fit_arm(repeated)


def test_a_motion_that_is_repeated_is_found(fit):
    """Each time that the hand goes out and back is found, with rests of unequal length between, and none overlaps."""
    found = np.array(repetitions(fit))
    assert_allclose(found.mean(axis=1), [1.0, 2.2, 4.0, 6.5], atol=0.05)
    assert np.all(found[1:, 0] >= found[:-1, 1])


def test_who_stands_still_repeats_nothing(fit):
    """Without motion, and of a moment, there is no repetition."""
    assert repetitions(fit.crop(0.0, 0.04)) == []
    assert len(repetitions(fit.crop(4.8, 5.6))) < 2
