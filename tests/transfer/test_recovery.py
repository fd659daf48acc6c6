"""Copies among strangers: the rotation between two clouds that share ellipsoids is found, taken, and called determined.

The clouds' distribution looks alike from all sides, so that nothing but the copies tells the rotation.
"""

import numpy as np
import pytest

import maniport as mp
from maniport.errors import IdentifiabilityWarning
from maniport.transfer.rotation_group import rotation_angle


def copies(seed, n, m, shared, noise, random_rotation):
    """Covariances A Aᵀ of a teacher and a student, of which the first `shared` are the same, turned; the rotation."""
    random = np.random.default_rng([seed, n])
    factor = random.standard_normal((n + m - shared, 3, 3))
    points = factor @ np.swapaxes(factor, 1, 2)
    turn = random_rotation(random, 3)
    student = np.concatenate([points[:shared], points[n:]])
    factor = mp.spd.expm(mp.spd.from_vector(noise * random.standard_normal((m, 6))))
    root = mp.spd.powm(student, 0.5)
    return points[:n], turn @ root @ factor @ root @ turn.T, turn


@pytest.mark.parametrize(
    ("n", "m", "shared", "noise", "seeds"),
    [
        (60, 60, 42, 0.01, 3),
        (100, 100, 50, 0.03, 2),
        (100, 300, 70, 0.01, 2),
        (1000, 1000, 700, 0.01, 1),
    ],
)
def test_copies_are_found_and_taken(n, m, shared, noise, seeds, random_rotation):
    """With half or more of the smaller cloud shared, the fit ends at the rotation of the copies, whoever starts it."""
    for seed in range(seeds):
        teacher, student, turn = copies(seed, n, m, shared, noise, random_rotation)
        adapter = mp.RiemannianICP(damping=0.01).fit(teacher, student)
        assert not adapter.start_kept_
        assert (
            np.rad2deg(rotation_angle(adapter.rotation_, turn)) < 8.0
        )  # the means differ, each having its strangers


def test_independent_draws_of_such_clouds_are_called_open(random_rotation):
    for seed in range(4):
        teacher, student, _ = copies(seed, 300, 300, 0, 0.0, random_rotation)
        with pytest.warns(IdentifiabilityWarning, match="any axis"):
            adapter = mp.RiemannianICP(damping=0.01).fit(teacher, student)
        assert adapter.start_kept_
