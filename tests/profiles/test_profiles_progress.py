"""Learning from demonstrations tells how far it is."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maniport.profiles import ProfileGMM, align


@pytest.fixture(scope="module")
def demonstrations(demonstrate):
    """Four demonstrations of forty ellipsoids."""
    return demonstrate(np.random.default_rng(0), 4, np.linspace(0.0, 1.0, 40), 0.2)


@pytest.mark.parametrize("name", ["align", "align to the first", "fit", "fit one number"])
def test_progress_moves_to_its_end_and_changes_nothing(demonstrations, name):
    """One step from 0 to 1 that never runs backwards, moves on the way, ends with a fact; the result is the same."""
    points, times = demonstrations.reshape(-1, 3, 3), np.tile(np.linspace(0.0, 1.0, 40), 4)
    work = {
        "align": lambda tell: align(demonstrations, progress=tell).ellipsoids,
        "align to the first": lambda tell: align(demonstrations, reference=0, progress=tell).ellipsoids,
        "fit": lambda tell: ProfileGMM(random_state=0, max_components=4).fit(times, points, progress=tell).means_,
        "fit one number": lambda tell: ProfileGMM(2, n_init=4, random_state=0).fit(times, points, progress=tell).means_,
    }[name]
    told = []
    found = work(lambda step, fraction, fact="": told.append((step, fraction, fact)))
    fractions = [fraction for _, fraction, _ in told]
    assert len({step for step, _, _ in told}) == 1
    assert fractions[0] == 0.0
    assert fractions == sorted(fractions)
    assert sum(0.0 < fraction < 1.0 for fraction in fractions) >= 4
    assert fractions.count(1.0) == 1
    assert told[-1][2]
    assert_array_equal(found, work(None))
