"""Joint descent in a placement and the trajectory there."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.arms import Arm, EllipsoidSpec
from maniport.motion.objective import Objective
from maniport.motion.placement.arguments import as_workspace, fixed_place
from maniport.motion.placement.joint_descent import JointProblem, descend_jointly
from maniport.motion.placement.problem import SCALE, TILT, ArmPath, PlacementProblem
from maniport.motion.plan.optimizer import TrajectoryCost, TrajectoryTerms, descend

ARM = Arm.from_dh("four", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5], [0, 0.1, 0.2, 0]], -2, 2)
COUNT = 6
TERMS = TrajectoryTerms(0.02, 1e-4, np.full(COUNT, 1.0 / COUNT))
PLACE = np.array([0.1, 0.5, 0.4, 0.7, 0.4, 0.1, 0.5])


def problem_of(spec=None, **given):
    """A path with ellipsoids of the arm, of which all is free that is not given."""
    spec = EllipsoidSpec() if spec is None else spec
    profile, path = ARM.ellipsoids(ARM.sample(COUNT, 1), spec), np.random.default_rng(0).normal(size=(COUNT, 3))
    place = fixed_place(*(given.get(name) for name in ("scale", "yaw", "tilt", "offset")))
    arm = ArmPath(Objective.of(ARM, spec, 0.05, 200.0), 0.1 * path, profile, None)
    return PlacementProblem((arm,), (arm,), np.arange(COUNT) * 0.3, *place, as_workspace(None))


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_slopes_are_those_of_the_cost(kind):
    """Half the gradient in place and joints agrees with central differences, of two arms and with a base that leans."""
    problem, q, step = problem_of(EllipsoidSpec(kind), tilt="free"), ARM.sample(COUNT, 3), 1e-6
    (arm,) = problem.arms
    both = JointProblem(replace(problem, arms=(arm, replace(arm, path=arm.path[::-1]))), [TERMS, TERMS])
    _, slopes = both.evaluate((PLACE, (q, q)))
    h, square = sum(one.h for one in slopes), sum(one.square for one in slopes)
    for k, change in enumerate(step * np.eye(len(PLACE))):
        ends = [both.evaluate((PLACE + side * change, (q, q))) for side in (1.0, -1.0)]
        assert (ends[0][0] - ends[1][0]) / (4.0 * step) == pytest.approx(h[k], rel=1e-5, abs=1e-4)
    assert np.linalg.eigvalsh(square).min() > -1e-9 * np.trace(square)


@pytest.mark.parametrize("given", [{}, {"tilt": "free"}, {"scale": 0.9, "offset": (None, 0.1, None)}])
def test_place_and_motion_get_better_and_what_is_given_stays(given):
    """The cost falls to less than what the joints alone reach; bounds, limits and given numbers are kept."""
    problem = problem_of(**given)
    place, q, (arm,) = np.where(problem.free, PLACE, problem.fixed), ARM.sample(COUNT, 3), problem.arms
    moved, (found,) = descend_jointly(problem, place, (q,), [TERMS])
    alone = TrajectoryCost(ARM, arm.targets(place), problem.time, TERMS)
    there = TrajectoryCost(ARM, arm.targets(moved), problem.time, TERMS)
    without = descend(alone, q, TERMS.rel_tol)
    assert there.evaluate(found)[0] < alone.evaluate(without)[0] < alone.evaluate(q)[0]
    assert np.all((found >= ARM.lower) & (found <= ARM.upper))
    assert np.all((moved[SCALE:TILT] >= problem.lower[SCALE:TILT]) & (moved[SCALE:TILT] <= problem.upper[SCALE:TILT]))
    np.testing.assert_array_equal(moved[~problem.free], place[~problem.free])
