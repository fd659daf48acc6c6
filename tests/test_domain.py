"""Domains and profiles."""

import numpy as np
import pytest

from maniport import load_arm, sample_domain
from maniport.arms import EllipsoidSpec
from maniport.arms.collisions import Collisions


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
