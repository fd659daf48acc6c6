"""Domains and profiles."""

import numpy as np
import pytest

from maniport import load_arm, sample_domain
from maniport.bodies import EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.domain import sample_profile


@pytest.fixture(scope="module")
def panda():
    """The embedded Panda."""
    return load_arm("panda")


@pytest.mark.parametrize("sequence", ["sobol", "uniform"])
def test_same_seed_gives_the_same_domain(panda, sequence):
    """Two draws with one seed are equal bit for bit, with another seed they are not."""
    one = sample_domain(panda, 100, 5, sequence)
    assert np.array_equal(one, sample_domain(panda, 100, 5, sequence))
    assert not np.array_equal(one, sample_domain(panda, 100, 6, sequence))


@pytest.mark.parametrize(("part", "d"), [("translation", 3), ("rotation", 3), ("full", 6)])
def test_domain_is_made_of_the_arms_ellipsoids(panda, part, d):
    """A domain holds the ellipsoids at the arm's own joint samples."""
    domain = sample_domain(panda, 64, 0, spec=EllipsoidSpec(part=part))
    assert domain.shape == (64, d, d)
    assert np.array_equal(domain, panda.manipulability(panda.sample(64, 0), part=part))


def test_a_domain_without_collisions_has_as_many_ellipsoids(panda):
    """Postures that collide are replaced by the next free ones of the sequence; True is the arm with itself."""
    collisions = Collisions.of(panda)
    q = panda.sample(256, 0)
    free = q[~collisions.collides(q)]
    domain = sample_domain(panda, 224, 0, collisions=collisions)
    assert 224 < len(free) < 256
    assert np.array_equal(domain, panda.manipulability(free[:224]))
    assert np.array_equal(domain, sample_domain(panda, 224, 0, collisions=True))


def test_profile_follows_the_waypoints(panda):
    """A profile starts and ends with the ellipsoids of the first and the last waypoint and keeps those between."""
    waypoints = panda.sample(3, 1)
    profile = sample_profile(panda, waypoints, 11)
    assert profile.shape == (11, 3, 3)
    np.testing.assert_allclose(profile[[0, 5, 10]], panda.manipulability(waypoints), atol=1e-12)
    np.testing.assert_array_equal(sample_profile(panda, waypoints), panda.manipulability(waypoints))
