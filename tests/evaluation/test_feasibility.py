"""Tests of the gaps."""

import numpy as np
import pytest

from maniport import load_arm, spd
from maniport.bodies import Arm
from maniport.spd.neighbors import nearest
from maniport.spd.regularization import Regularization
from maniport.tracking import nearest_feasible


@pytest.fixture(scope="module")
def gantry():
    """Three slides at right angles, whose ellipsoid is a ball of radius one everywhere."""
    quarter = np.pi / 2
    rows = [[0.0, 0.0, 0.0, quarter], [quarter, 0.0, 0.0, quarter], [0.0, 0.0, 0.0, 0.0]]
    return Arm.from_dh("gantry", rows, [-1.0] * 3, [1.0] * 3, kinds=["prismatic"] * 3)


def test_feasibility_gap_of_an_arm_that_makes_one_ellipsoid_only(gantry, make_cloud, rng):
    """A gantry makes M = I in every position, so that the gap of A is d(A, I)."""
    points = make_cloud(rng, 6)
    np.testing.assert_allclose(gantry.manipulability(gantry.sample(3, 0)), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(
        nearest_feasible(gantry, points, damping=None).distance, spd.distance(np.eye(3), points), rtol=1e-9
    )


def test_feasibility_gap_adds_the_damping_on_both_sides(gantry, make_cloud, rng):
    """With a damping ε the gap is d(A + ε I, M + ε I)."""
    points = make_cloud(rng, 6)
    expected = spd.distance(1.5 * np.eye(3), points + 0.5 * np.eye(3))
    np.testing.assert_allclose(
        nearest_feasible(gantry, points, damping=Regularization.absolute(0.5)).distance, expected, rtol=1e-9
    )


def test_feasibility_gap_of_what_the_arm_can_make_is_none_where_the_sample_gap_is_large():
    """Held-out ellipsoids of the Panda are feasible, though the nearest of 512 samples is far away."""
    panda = load_arm("panda")
    held_out = panda.manipulability(panda.sample(24, 5))
    epsilon = 0.003
    lifted = [points + epsilon * np.eye(3) for points in (held_out, panda.manipulability(panda.sample(512, 6)))]
    assert np.median(nearest(*lifted)[1]) > 0.3
    damping = Regularization.absolute(epsilon)
    assert np.quantile(nearest_feasible(panda, held_out, damping=damping).distance, 0.95) < 0.01
