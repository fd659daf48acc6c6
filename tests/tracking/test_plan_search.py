"""The best way through nodes, and all points of a motion refined at once."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import solve

from maniport.bodies import Arm
from maniport.tracking.objective import Objective
from maniport.tracking.plan.differences import Differences
from maniport.tracking.plan.giving_way import TIGHT, given_way
from maniport.tracking.plan.nodes import Nodes
from maniport.tracking.plan.refinement import Asked, Motion, Smoothness, durations_of, motion_cost, refine
from maniport.tracking.plan.shortest_path import LEAP, TRAVEL, shortest_path
from maniport.tracking.search.node_floor import floor_between

ARM = Arm.from_dh("four", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5], [0, 0.1, 0.2, 0]], -2, 2)
THREE = Arm.from_dh("three", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5]], -2, 2)
UNEVEN = np.array([0.0, 0.3, 0.5, 0.9, 1.0, 1.6, 1.7, 2.2])


class Wall:
    """Stands in for solids: what has joint 1 beyond 0.3 is too near, by a distance of that."""

    known, within = True, 0.0

    def watch(self, within):
        """What tells of that again and again."""
        self.within = within
        return self

    def gradient(self, q):
        """Rows, distances and their slopes of what is nearer than `within`."""
        distance = 0.3 - q[:, 0]
        rows = np.flatnonzero(distance < self.within)
        return rows, distance[rows], np.tile(-np.eye(q.shape[1])[0], (len(rows), 1))


@pytest.fixture(scope="module")
def asked():
    """Smoothness that matters, limits that are exceeded, shares and a wall with more and less room before it."""
    generator = np.random.default_rng(1)
    shares, clear = generator.uniform(0.1, 1.0, (2, len(UNEVEN)))
    return Asked(Smoothness(0.2, 1e-3), shares, np.full(4, 0.5), np.full(4, 2.0), Wall(), clear=0.05 * clear)


@pytest.fixture(scope="module")
def targets():
    """What the arm makes somewhere, with the tip elsewhere, for eight points."""
    q, other = ARM.sample(len(UNEVEN), 3), ARM.sample(len(UNEVEN), 4)
    return Objective.of(ARM, position_weight=5.0).targets(ARM.manipulability(q), ARM.forward(other)[:, :3, 3])


@pytest.mark.parametrize("seed", range(6))
def test_shortest_path_is_the_best_of_all_ways(seed):
    """Of all ways through few nodes, counted one by one, none costs less, leaps included."""
    generator = np.random.default_rng(seed)
    counts = generator.integers(1, 5, 6)
    first = np.concatenate([[0], np.cumsum(counts)])
    q, cost = generator.uniform(-1, 1, (first[-1], 3)), generator.uniform(0, 0.5, first[-1])
    time, largest = np.cumsum(generator.uniform(0.2, 1, 6)), np.full((6, 3), 0.8)
    gaps, durations = np.diff(time), durations_of(time)

    def total(way):
        change = np.abs(np.diff(q[way], axis=0))
        over = np.maximum((change / largest[1:]) ** 2 - 1.0, 0.0).sum()
        return cost[way] @ durations + TRAVEL * np.sum(change**2 / gaps[:, None]) + LEAP * over

    found = shortest_path(Nodes(q, cost, first), time, largest)
    assert ((found >= first[:-1]) & (found < first[1:])).all()
    ways = product(*(range(a, b) for a, b in pairwise(first)))
    assert_allclose(total(found), min(total(np.array(way)) for way in ways))


def test_known_ways_join_the_nodes():
    """Of nodes that a way has joined the shortest path is that way where nothing costs less."""
    q, cost, first = np.arange(10.0)[:, None], np.ones(10), np.array([0, 3, 5, 10])
    way = np.array([[20.0], [20.5], [21.0]])
    nodes = Nodes(q, cost, first).joined(way, np.zeros(3))
    found = shortest_path(nodes, np.arange(3.0), np.full((3, 1), np.inf))
    assert_allclose(nodes.q[found], way)
    assert_allclose(np.diff(nodes.first), np.diff(first) + 1)


def test_durations_fill_the_time():
    """The points stand for all of the time, each for that half way to its neighbors."""
    assert_allclose(durations_of(np.array([1.0, 2.0, 4.0])), [0.5, 1.5, 1.0])
    assert_allclose(durations_of(UNEVEN).sum(), UNEVEN[-1])


@pytest.mark.parametrize("order", [1, 2, 3])
def test_differences_are_derivatives_of_polynomials(order):
    """At uneven times the k-th difference of tᵏ is k!, and of lower powers nothing; Dᵀ and DᵀWD are those of D."""
    one = Differences.of(UNEVEN, order)
    powers = UNEVEN[:, None] ** np.arange(order + 1)
    expected = np.zeros(order + 1)
    expected[-1] = np.prod(np.arange(1, order + 1))
    assert_allclose(one(powers), np.tile(expected, (len(one.rows), 1)), atol=1e-9)
    matrix, weights = one(np.eye(len(UNEVEN))), np.random.default_rng(0).uniform(size=(len(one.rows), 2))
    assert_allclose(one.back(weights), matrix.T @ weights, atol=1e-9)
    for joint in range(2):
        dense = matrix.T @ np.diag(weights[:, joint]) @ matrix
        band = one.normal(weights)[..., joint]
        for below in range(order + 1):
            assert_allclose(band[below, : len(UNEVEN) - below], np.diag(dense, -below), atol=1e-6)


def test_gradient_is_that_of_the_cost(targets, asked):
    """Half the gradient agrees with central differences, all that is asked of a motion included."""
    motion, q, step = Motion(ARM, targets, UNEVEN, asked), ARM.sample(len(UNEVEN), 5), 1e-6
    cost, (gradient, _, _) = motion.evaluate(q)
    assert cost == pytest.approx(motion.cost(q)) == pytest.approx(motion_cost(targets, UNEVEN, q, asked))
    for i, j in np.ndindex(q.shape):
        change = np.zeros_like(q)
        change[i, j] = step
        slope = (motion.cost(q + change) - motion.cost(q - change)) / (2 * step)
        assert slope == pytest.approx(2.0 * gradient[i, j], rel=1e-4, abs=1e-4 * np.abs(gradient).max())


@pytest.mark.parametrize("n", [2, 3, 8])
def test_step_solves_the_dense_equations(targets, asked, n):
    """The banded solution is that of the whole matrix, with joints that are stuck left out."""
    asked = replace(asked, shares=asked.shares[:n], clear=asked.clear[:n])
    motion, q = Motion(ARM, targets[:n], UNEVEN[:n], asked), ARM.sample(n, 6)
    _, (gradient, hessian, band) = motion.evaluate(q)
    stuck = np.random.default_rng(2).uniform(size=q.shape) < 0.2
    damped = 0.1 * (np.einsum("nii->ni", hessian) + band[0])
    whole = np.zeros((n, 4, n, 4))
    for i in range(n):
        whole[i, :, i] += hessian[i] + np.diag(damped[i])
        for below in range(min(len(band), n - i)):
            one = np.diag(band[below, i])
            whole[i + below, :, i] += one
            if below:
                whole[i, :, i + below] += one
    free = np.flatnonzero(~stuck.ravel())
    expected = np.zeros(4 * n)
    expected[free] = solve(whole.reshape(4 * n, 4 * n)[np.ix_(free, free)], -gradient.ravel()[free])
    found = motion.solved(-gradient[..., None], hessian, band, stuck, damped)
    assert_allclose(found, expected.reshape(n, 4, 1), atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_refinement_never_makes_it_worse_and_keeps_limits(targets, asked, seed):
    """From any start, the cost by the last weight does not grow, and joints stay within their limits."""
    q = ARM.sample(len(UNEVEN), seed)
    for one in (asked, Asked(Smoothness(0.0, 0.0))):
        found = refine(targets, UNEVEN, q, one, (30.0,))
        heavy = replace(targets, objective=replace(targets.objective, position_weight=30.0))
        assert motion_cost(heavy, UNEVEN, found, one) <= motion_cost(heavy, UNEVEN, q, one)
        assert ARM.within_limits(found).all()


def test_motions_of_the_arm_itself_stay():
    """Where ellipsoids and path are the arm's own and smoothness costs nothing, nothing moves."""
    q = ARM.lower + (ARM.upper - ARM.lower) * (0.5 + 0.2 * np.sin(np.outer(UNEVEN, [1, 0.7, 1.3, 0.4])))
    own = Objective.of(ARM).targets(ARM.manipulability(q), ARM.forward(q)[:, :3, 3])
    assert_allclose(refine(own, UNEVEN, q, Asked(Smoothness(0.0, 0.0)), (100.0,)), q, atol=1e-9)


def near_the_wall(room):
    """A motion of the arm that comes so near to the wall once, and what it makes with its tip there."""
    q = 0.4 + 0.2 * np.sin(np.outer(UNEVEN, [1, 0.7, 1.3]))
    q[:, 0] = 0.3 - room - 0.2 * np.abs(UNEVEN - UNEVEN[4])
    return q, Objective.of(THREE).targets(THREE.manipulability(q), THREE.forward(q)[:, :3, 3])


@pytest.mark.parametrize("room", [0.005, 0.001])
def test_room_gives_way_to_the_path_as_long_as_nothing_touches(room):
    """The tip is brought to where there is less room than is kept elsewhere, but not to where there is next to none."""
    q, own = near_the_wall(room)
    asked = Asked(Smoothness(1e-6, 1e-9), np.full(len(UNEVEN), 0.2), collisions=Wall())
    kept = refine(own, UNEVEN, q, asked, (1000.0,))
    given = given_way(own, UNEVEN, kept, asked, 1000.0, 1e-4)
    before, after = own.tip_error(kept), own.tip_error(given)
    assert before.max() > 1e-3
    assert after.max() < (0.5 if room > TIGHT else 1.01) * before.max()
    assert (0.3 - given[:, 0]).min() > 0.5 * TIGHT


def test_time_gives_way_to_the_path():
    """Where the joints would have to be quicker than they may, the tip is brought nearer as if there were more time."""
    q, own = near_the_wall(0.1)
    speed = np.abs(np.diff(q, axis=0) / np.diff(UNEVEN)[:, None]).max(axis=0)
    asked = Asked(Smoothness(1e-6, 1e-9), np.full(len(UNEVEN), 0.2), velocity=0.8 * speed)
    slow = refine(own, UNEVEN, q, asked, (30.0,))
    given = given_way(own, UNEVEN, slow, asked, 30.0, 1e-4)
    assert own.tip_error(given).max() < 0.5 * own.tip_error(slow).max()


def test_nothing_gives_way_where_the_tip_is_near():
    """The motion stays as it is, number for number."""
    q, own = near_the_wall(0.1)
    assert given_way(own, UNEVEN, q, Asked(Smoothness(1e-6, 1e-9), collisions=Wall()), 1000.0, 1e-3) is q


def test_a_floor_between_points_keeps_its_mean_square():
    """What is searched at some points is kept there; steep ups and downs between them are not flattened."""
    rows, found = np.arange(0, 101, 10), np.arange(11) % 2.0
    floor = floor_between(rows, found, 101)
    assert_allclose(floor[rows], found, atol=1e-12)
    assert_allclose(np.mean(floor[:-1] ** 2), 0.5, rtol=0.02)
