"""Collisions of a pair: each arm with itself, both with one another, what they share once."""

import coal
import numpy as np
import pytest

import maniport as mp
from maniport.errors import InvalidInputError


@pytest.fixture(scope="module", params=["crane", "pandas"])
def pair(request, crane):
    """One robot with a trunk, or two robots; and what they collide with."""
    arms = crane
    if request.param == "pandas":
        arms = mp.load_arms("panda", ("panda_link8", "panda_link8"), bases=((0, 0.25, 0), (0.1, -0.25, 0, 0.4)))
    return arms, mp.Collisions.of(arms)


def test_a_pair_has_the_pairs_of_its_arms_and_those_between(pair):
    """Each arm's distances are those of the arm alone; less lies between the arms; shared links come once."""
    arms, collisions = pair
    q = arms.sample(256, 3)
    alone = [mp.Collisions.of(arm).clearance(part) for arm, part in zip(arms.arms, arms.split(q), strict=True)]
    nearest = collisions.nearest(q)
    assert np.all(nearest.distance <= np.minimum(*alone) + 1e-9)
    between = nearest.distance < np.minimum(*alone) - 1e-9
    sides = np.char.startswith(nearest.first, "left") != np.char.startswith(nearest.second, "left")
    assert 0.01 < between.mean() < 0.9
    assert np.all(sides[between])
    assert len(set(collisions.pairs)) == len(collisions.pairs)
    assert ("trunk", "right_link3") in collisions.pairs or arms.shared == ()


def test_distances_between_arms_are_those_of_their_hulls(pair):
    """Coal's distance of the hulls where the links of the single arms are, for every pair that is checked."""
    arms, collisions = pair
    q = arms.sample(8, 1)
    left, right = (arm.link_poses(part) for arm, part in zip(arms.arms, arms.split(q), strict=True))
    hulls, trunk, ours = collisions._solids.hulls, arms.common[0, 1], len(arms.arms[0].chain.joints)

    def placed(hull, row):
        own = hull.joint > ours
        at = right[row, hull.joint - ours + trunk] if own else left[row, hull.joint]
        return hull.solid, coal.Transform3s(at[:3, :3], at[:3, 3])

    for row in range(len(q)):
        least = min(
            coal.distance(*placed(hulls[a], row), *placed(hulls[b], row), coal.DistanceRequest(), coal.DistanceResult())
            - hulls[a].skin - hulls[b].skin
            for a, b in collisions._pairs.tolist()
        )  # fmt: skip
        np.testing.assert_allclose(collisions.clearance(q[row]), least, atol=1e-9)


def test_slopes_over_the_joints_of_the_pair_are_derivatives(pair):
    """Central differences of the smallest distance, in the joints of both arms and the shared ones."""
    arms, collisions = pair
    q = arms.sample(128, 2)
    rows, distance, slope = collisions.gradient(q, 0.2)
    steps, checked = 1e-6 * np.eye(arms.dof), 0
    for row in np.unique(rows):
        own = np.flatnonzero(rows == row)
        own = own[np.argsort(distance[own])]
        if distance[own[0]] < 0.005 or (len(own) > 1 and distance[own[1]] < distance[own[0]] + 1e-4):
            continue
        change = (collisions.clearance(q[row] + steps) - collisions.clearance(q[row] - steps)) / 2e-6
        np.testing.assert_allclose(slope[own[0]], change, atol=1e-4)
        checked += 1
    assert checked > 10


def test_bases_that_stand_in_one_another_are_refused():
    """Two robots cannot stand in one place; the message says how deep they are in one another."""
    arms = mp.load_arms("panda", bases=((0, 0.05, 0), (0, -0.05, 0)))
    with pytest.raises(InvalidInputError, match=r"bases: 'left_panda_link0' is 0\.\d+ m deep in 'right_panda_link0'"):
        mp.Collisions.of(arms)
