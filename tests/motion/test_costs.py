"""Each cost by itself: its derivatives by finite differences, and as a further cost of a motion problem."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maniport.arms import VELOCITY, EllipsoidSpec, load_arm
from maniport.errors import InvalidInputError
from maniport.motion import MotionLimits
from maniport.motion.costs.cost import Cost, ToleranceCost, as_costs
from maniport.motion.costs.orientation import OrientationCost
from maniport.motion.costs.position import PositionCost
from maniport.motion.costs.posture import PostureCost
from maniport.motion.costs.smoothness import SmoothnessCost
from maniport.motion.objective import Objective
from maniport.motion.problem import MotionProblem

ARM = load_arm("panda")
TIME = np.array([0.0, 0.3, 0.4, 1.1, 1.5])


def ellipsoid_cost(spec):
    return Objective.of(ARM, spec).targets(ARM.ellipsoids(ARM.sample(1, 9), spec)).ellipsoid


COSTS = {
    "ellipsoid": ellipsoid_cost(VELOCITY),
    "force ellipsoid": ellipsoid_cost(EllipsoidSpec("force")),
    "position": PositionCost(ARM, np.array([[0.3, 0.2, 0.5]]), 50.0),
    "orientation": OrientationCost(
        ARM, Rotation.random(1, np.random.default_rng(1)).as_matrix(), (3.0, 0.0, 7.0)
    ),
    "posture": PostureCost(ARM.sample(1, 3)[0], 0.7),
}


@pytest.mark.parametrize("name", COSTS)
def test_jacobian_is_the_derivative_of_the_residual(name):
    (cost,), q, step = as_costs([COSTS[name]], ARM, TIME), ARM.sample(len(TIME), 1), 1e-6
    assert isinstance(cost, Cost)
    slopes = [
        (cost.residual(q + e, TIME) - cost.residual(q - e, TIME)) / (2 * step)
        for e in step * np.eye(7)
    ]
    jacobian = cost.jacobian(q, TIME)
    assert jacobian == pytest.approx(np.stack(slopes, axis=-1), abs=1e-6 * np.abs(jacobian).max())


def test_costs_added_to_a_problem_are_those_of_its_targets():
    objective, limits, q = Objective.of(ARM), MotionLimits.of(ARM), ARM.sample(len(TIME), 2)
    ellipsoids, position = ARM.ellipsoids(ARM.sample(len(TIME), 4)), COSTS["position"]
    free, bound = (
        objective.targets(ellipsoids),
        objective.targets(ellipsoids, np.tile(position.positions, (5, 1))),
    )
    added = MotionProblem(TIME, (free,), limits, costs=(position,)).evaluate(q)
    for part, expected in zip(
        added, MotionProblem(TIME, (bound,), limits).evaluate(q), strict=True
    ):
        assert part == pytest.approx(expected, rel=1e-9)


def test_smoothness_is_the_integral_of_squares():
    """Of a cubic q = t³ at even times: the jerk is 6."""
    time = np.linspace(0.0, 1.0, 6)
    q = time[:, None] ** 3
    gradient, band = np.zeros((6, 1)), np.zeros((4, 6, 1))
    cost = SmoothnessCost(time, (0.0, 2.0), (np.inf, np.inf)).add(q, 1.0, gradient, band)
    assert cost == pytest.approx(1.0 + 2.0 * 36.0 * 0.2 * 3)
    assert np.sum(gradient * q) == pytest.approx(cost - 1.0)
    velocity = np.diff(time**3) / 0.2
    excess = np.maximum(velocity / 0.5 - 1.0, 0.0)
    limited = SmoothnessCost(time, (3.0, 0.0), (0.5, np.inf)).add(q, 0.0, gradient, band)
    assert limited == pytest.approx(0.2 * np.sum(3.0 * velocity**2 + 30.0 * excess**2))


class Level:
    """A height that the planner reaches within the tolerance; `shape` is that of its errors."""

    def __init__(self, weight=50.0, shape=(-1,)):
        self.weight, self.shape = weight, shape

    def residual(self, q, time):
        return self.weight * (ARM.forward(q)[:, 2:3, 3] - 0.4)

    def jacobian(self, q, time):
        return self.weight * ARM.jacobian(q)[:, 2:3]

    def weighing(self, position_weight):
        return Level(position_weight)

    def error(self, q, time):
        return np.abs(ARM.forward(q)[:, 2, 3] - 0.4).reshape(self.shape)


def test_own_cost_of_a_tolerance_is_weighed_and_its_error_counts():
    q, free = (
        ARM.sample(len(TIME), 2),
        Objective.of(ARM).targets(ARM.ellipsoids(ARM.sample(len(TIME), 4))),
    )
    problem = MotionProblem(
        TIME, (free,), MotionLimits.of(ARM), costs=as_costs([Level()], ARM, TIME)
    )
    assert isinstance(problem.costs[0], ToleranceCost)
    assert problem.position_error(q)[:, 0] == pytest.approx(np.abs(ARM.forward(q)[:, 2, 3] - 0.4))
    assert problem.weighing(70.0).costs[0].weight == 70.0
    with pytest.raises(InvalidInputError, match=r"costs\[0\].error must have shape \(2,\)"):
        as_costs([Level(shape=(-1, 1))], ARM, TIME)
