import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport import spd
from maniport.errors import NotSPDError
from maniport.spd.affine_invariant import nearest


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [10.0, 1e4, 1e6])
@pytest.mark.parametrize(("n", "m"), [(30, 1), (30, 5), (20, 200), (0, 5)])
def test_nearest_equals_brute_force(d, condition, n, m, random_spd):
    rng = np.random.default_rng(d)
    tilt = np.diag(np.geomspace(1.0, condition**0.25, d))
    queries, points = random_spd(rng, (n,), d, condition), tilt @ random_spd(rng, (m,), d, condition) @ tilt
    every = spd.distance(queries[:, None], points[None])
    index, distance = nearest(queries, points)
    assert_allclose(distance, every.min(axis=1), rtol=1e-10 * condition)
    assert_allclose(every[np.arange(n), index], every.min(axis=1), rtol=1e-10 * condition)


def test_points_too_ill_conditioned_for_a_search_are_refused(random_spd):
    rng = np.random.default_rng(0)
    queries, points = random_spd(rng, (500,), 3, 5e12), random_spd(rng, (1,), 3, 5e12)
    with warnings.catch_warnings(action="error"), pytest.raises(NotSPDError, match="too ill-conditioned together"):
        nearest(queries, points)
