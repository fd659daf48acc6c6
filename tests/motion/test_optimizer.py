from itertools import pairwise, product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from arm_problems import arm_problem
from maniport.arms import Arm
from maniport.motion.plan.optimizer import TrajectoryCost, TrajectoryTerms, optimize, time_weights
from maniport.motion.plan.roadmap import JOINT_MOTION_WEIGHT, Roadmap, shortest_path
from maniport.motion.problem import CostWeights

ARM = Arm.from_dh(
    "four", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5], [0, 0.1, 0.2, 0]], -2, 2
)
UNEVEN = np.array([0.0, 0.3, 0.5, 0.9, 1.0, 1.6, 1.7, 2.2])


class Wall:
    """A collision model in which the first joint reaches a wall at 0.3 rad; the distance is the angle to it."""

    def gradient(self, q, threshold, scaled):
        distance = 0.3 - q[:, 0]
        rows = np.flatnonzero(distance < threshold)
        return rows, distance[rows], np.tile(-np.eye(q.shape[1])[0], (len(rows), 1))


@pytest.fixture(scope="module")
def terms():
    """Smoothness that matters, limits that are exceeded, weights, and a wall."""
    weights = np.random.default_rng(1).uniform(0.1, 1.0, len(UNEVEN))
    return TrajectoryTerms(0.2, 1e-3, weights, np.full(4, 0.5), np.full(4, 2.0), Wall())


@pytest.fixture(scope="module")
def targets():
    """Ellipsoids of the arm at eight waypoints, with positions that do not fit them."""
    q = ARM.sample(len(UNEVEN), 3)
    other = ARM.sample(len(UNEVEN), 4)
    positions = ARM.forward(other)[:, :3, 3]
    return arm_problem(ARM, ARM.manipulability(q), positions, weights=CostWeights(5.0))


@pytest.mark.parametrize("seed", range(2))
def test_shortest_path_is_the_best_of_all_paths(seed):
    generator = np.random.default_rng(seed)
    first = np.concatenate([[0], np.cumsum(generator.integers(1, 5, 6))])
    q = generator.uniform(-1, 1, (first[-1], 3))
    cost = generator.uniform(0, 0.5, first[-1])
    time = np.cumsum(generator.uniform(0.2, 1, 6))
    largest = np.full((6, 3), 0.8)
    gaps = np.diff(time)
    weights = time_weights(time)

    def total(path):
        change = np.abs(np.diff(q[path], axis=0))
        jumps = 1000.0 * np.maximum((change / largest[1:]) ** 2 - 1.0, 0.0).sum()
        return (
            cost[path] @ weights + JOINT_MOTION_WEIGHT * np.sum(change**2 / gaps[:, None]) + jumps
        )

    solution = shortest_path(Roadmap(q, cost, first), time, largest)
    assert ((solution >= first[:-1]) & (solution < first[1:])).all()
    paths = product(*(range(a, b) for a, b in pairwise(first)))
    assert_allclose(total(solution), min(total(np.array(path)) for path in paths))


def test_gradient_is_that_of_the_cost(targets, terms):
    cost = TrajectoryCost(ARM, targets, UNEVEN, terms)
    q = ARM.sample(len(UNEVEN), 5)
    step = 1e-6
    gradient = cost.evaluate(q)[1][0]
    for i, j in np.ndindex(q.shape):
        change = np.zeros_like(q)
        change[i, j] = step
        slope = (cost.evaluate(q + change)[0] - cost.evaluate(q - change)[0]) / (2 * step)
        assert slope == pytest.approx(
            2.0 * gradient[i, j], rel=1e-4, abs=1e-4 * np.abs(gradient).max()
        )


def test_optimizer_never_raises_the_cost_and_keeps_limits(targets, terms):
    q = ARM.sample(len(UNEVEN), 0)
    for one in (terms, TrajectoryTerms(0.0, 0.0)):
        solution = optimize(targets, UNEVEN, q, one, 30.0)
        cost = TrajectoryCost(ARM, targets.with_position_weight(30.0), UNEVEN, one)
        assert cost.evaluate(solution)[0] <= cost.evaluate(q)[0]
        assert ARM.within_limits(solution).all()
