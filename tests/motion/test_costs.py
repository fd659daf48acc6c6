"""Each cost by itself: its derivatives by finite differences, and as a further cost of a motion problem."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arm_problems import arm_problem
from maniport.arms import VELOCITY, EllipsoidSpec, load_arm
from maniport.arms.directional import smooth_extents
from maniport.errors import InvalidInputError
from maniport.motion import MotionLimits
from maniport.motion.configurations import Configurations
from maniport.motion.costs.capability import CapabilityCost
from maniport.motion.costs.cost import Cost, PositionErrorCost, as_costs
from maniport.motion.costs.orientation import OrientationCost
from maniport.motion.costs.position import PositionCost
from maniport.motion.costs.posture import PostureCost
from maniport.motion.costs.smoothness import SmoothnessCost
from maniport.motion.directions import DirectionTarget
from maniport.motion.problem import ArmProblem, MotionProblem

ARM = load_arm("panda")
TIME = np.array([0.0, 0.3, 0.4, 1.1, 1.5])


def ellipsoid_cost(spec):
    return arm_problem(ARM, ARM.ellipsoids(ARM.sample(1, 9), spec), spec=spec).ellipsoid


def at(q):
    return Configurations(ARM, q, TIME)


def capability_cost(kind, lines):
    vectors = np.random.default_rng(4).normal(size=(lines, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    weights = np.linspace(0.5, 0.2, lines)
    target = DirectionTarget(kind, vectors[None], weights[None], 1000.0)
    return CapabilityCost(target)


COSTS = {
    "force along lines": capability_cost("force", 3),
    "speed along a line": capability_cost("velocity", 1),
    "ellipsoid": ellipsoid_cost(VELOCITY),
    "force ellipsoid": ellipsoid_cost(EllipsoidSpec("force")),
    "position": PositionCost(np.array([[0.3, 0.2, 0.5]]), 50.0),
    "orientation": OrientationCost(
        Rotation.random(1, np.random.default_rng(1)).as_matrix(), (3.0, 0.0, 7.0)
    ),
    "posture": PostureCost(ARM.sample(1, 3)[0], 0.7),
}


@pytest.mark.parametrize("name", COSTS)
def test_jacobian_is_the_derivative_of_the_residual(name):
    (cost,) = as_costs([COSTS[name]], ARM, TIME)
    q = ARM.sample(len(TIME), 1)
    step = 1e-6
    assert isinstance(cost, Cost)
    slopes = [
        (cost.residual(at(q + e)) - cost.residual(at(q - e))) / (2 * step) for e in step * np.eye(7)
    ]
    jacobian = cost.jacobian(at(q))
    assert jacobian == pytest.approx(np.stack(slopes, axis=-1), abs=1e-6 * np.abs(jacobian).max())


def test_costs_added_to_a_problem_are_those_of_its_targets():
    limits = MotionLimits.of(ARM)
    q = ARM.sample(len(TIME), 2)
    ellipsoids = ARM.ellipsoids(ARM.sample(len(TIME), 4))
    position = COSTS["position"]
    free = arm_problem(ARM, ellipsoids)
    bound = arm_problem(ARM, ellipsoids, np.tile(position.positions, (5, 1)))
    added = MotionProblem(TIME, (free,), limits, costs=(position,)).normal_equations(q)
    expected = MotionProblem(TIME, (bound,), limits).normal_equations(q)
    for name in ("distance", "gradient", "hessian"):
        assert getattr(added, name) == pytest.approx(getattr(expected, name), rel=1e-9)


def test_smoothness_is_the_integral_of_squares():
    """Of a cubic q = t³ at even times: the jerk is 6."""
    time = np.linspace(0.0, 1.0, 6)
    q = time[:, None] ** 3
    gradient = np.zeros((6, 1))
    band = np.zeros((4, 6, 1))
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
        self.weight = weight
        self.shape = shape

    def residual(self, at):
        return self.weight * (at.poses[:, 2:3, 3] - 0.4)

    def jacobian(self, at):
        return self.weight * at.jacobians[:, 2:3]

    def with_weight(self, weight):
        return Level(weight)

    def error(self, at):
        return np.abs(at.poses[:, 2, 3] - 0.4).reshape(self.shape)


def test_own_cost_of_a_tolerance_is_weighed_and_its_error_counts():
    q = ARM.sample(len(TIME), 2)
    free = arm_problem(ARM, ARM.ellipsoids(ARM.sample(len(TIME), 4)))
    problem = MotionProblem(
        TIME, (free,), MotionLimits.of(ARM), costs=as_costs([Level()], ARM, TIME)
    )
    assert isinstance(problem.costs[0], PositionErrorCost)
    assert problem.position_errors(q)[:, 0] == pytest.approx(np.abs(ARM.forward(q)[:, 2, 3] - 0.4))
    assert problem.with_position_weight(70.0).costs[0].weight == 70.0
    with pytest.raises(InvalidInputError, match=r"costs\[0\].error.*\(2,\)"):
        as_costs([Level(shape=(-1, 1))], ARM, TIME)


def test_an_extent_that_is_half_of_the_reference_costs_as_a_halved_semi_axis():
    """Above the reference nothing costs."""
    q = ARM.sample(len(TIME), 1)
    lines = np.tile([0.0, 0.0, 1.0], (5, 1, 1))
    extents = np.exp(smooth_extents(ARM, q, lines, "force").logs)
    for share, expected in ((2.0, 2.0 * np.log(2.0)), (0.5, 0.0)):
        target = DirectionTarget("force", lines, np.ones((5, 1)), share * extents[2, 0])
        residual = CapabilityCost(target).residual(at(q))
        assert residual[2, 0] == pytest.approx(expected)


def test_capability_adds_to_a_problem_and_may_stand_for_the_ellipsoids():
    q = ARM.sample(len(TIME), 2)
    cost = COSTS["force along lines"]
    target = arm_problem(ARM, ARM.ellipsoids(ARM.sample(len(TIME), 4))).target
    both = ArmProblem.of(ARM, replace(target, directions=(cost.target,)))
    alone = ArmProblem.of(ARM, replace(both.target, with_ellipsoids=False))
    square = np.sum(cost.residual(at(q)) ** 2, axis=1)
    assert alone.cost(q) == pytest.approx(square)
    assert both.cost(q) == pytest.approx(square + both.distance(q) ** 2)
    assert both.normal_equations(q).distance ** 2 == pytest.approx(both.cost(q))
    assert alone.normal_equations(q).distance ** 2 == pytest.approx(square)
    assert both.with_ellipsoids_only().cost(q) == pytest.approx(both.distance(q) ** 2)
