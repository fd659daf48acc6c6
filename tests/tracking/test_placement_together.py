"""A place and the motion there, improved at once."""

from dataclasses import replace

import numpy as np
import pytest

from maniport.bodies import Arm, EllipsoidSpec
from maniport.tracking.objective import Objective
from maniport.tracking.placement.asked import as_workspace, given_place
from maniport.tracking.placement.journey import SCALE, TILT, Journey
from maniport.tracking.placement.sides import Sides
from maniport.tracking.placement.together import Together, improved_together
from maniport.tracking.plan.refinement import Asked, Motion, Smoothness

ARM = Arm.from_dh("four", [[0, 0.2, 0.1, 1.5], [0, 0, 0.4, 0], [0, 0, 0.3, -1.5], [0, 0.1, 0.2, 0]], -2, 2)
COUNT = 6
ASKED = Asked(Smoothness(0.02, 1e-4), np.full(COUNT, 1.0 / COUNT))
PLACE = np.array([0.1, 0.5, 0.4, 0.7, 0.4, 0.1, 0.5])


def journey_of(spec=None, **given):
    """A path with ellipsoids of the arm, of which all is free that is not given."""
    spec = EllipsoidSpec() if spec is None else spec
    profile, path = ARM.ellipsoids(ARM.sample(COUNT, 1), spec), np.random.default_rng(0).normal(size=(COUNT, 3))
    place = given_place(*(given.get(name) for name in ("scale", "yaw", "tilt", "offset")))
    objective = Objective.of(ARM, spec, 0.05, 200.0)
    return Journey(objective, 0.1 * path, profile, np.arange(COUNT) * 0.3, *place, as_workspace(None))


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_slopes_are_those_of_the_cost(kind):
    """Half the gradient in place and joints agrees with central differences, of two arms and with a base that leans."""
    journey, q, step = journey_of(EllipsoidSpec(kind), tilt="free"), ARM.sample(COUNT, 3), 1e-6
    sides = Sides((journey, replace(journey, path=journey.path[::-1])), ())
    both = Together(sides, sides, [ASKED, ASKED])
    _, slopes = both.evaluate((PLACE, (q, q)))
    h, square = sum(one.h for one in slopes), sum(one.square for one in slopes)
    for k, change in enumerate(step * np.eye(len(PLACE))):
        ends = [both.evaluate((PLACE + side * change, (q, q))) for side in (1.0, -1.0)]
        assert (ends[0][0] - ends[1][0]) / (4.0 * step) == pytest.approx(h[k], rel=1e-5, abs=1e-4)
    assert np.linalg.eigvalsh(square).min() > -1e-9 * np.trace(square)


@pytest.mark.parametrize("given", [{}, {"tilt": "free"}, {"scale": 0.9, "offset": (None, 0.1, None)}])
def test_place_and_motion_get_better_and_what_is_given_stays(given):
    """The cost falls to less than what the joints alone reach; bounds, limits and given numbers are kept."""
    journey = journey_of(**given)
    place, q = np.where(journey.free, PLACE, journey.given), ARM.sample(COUNT, 3)
    sides = Sides((journey,), ())
    moved, (found,) = improved_together(sides, sides, place, (q,), [ASKED])
    alone = Motion(ARM, journey.targets(place), journey.time, ASKED)
    there = Motion(ARM, journey.targets(moved), journey.time, ASKED)
    assert there.cost(found) < alone.cost(alone.descended(q)) < alone.cost(q)
    assert np.all((found >= ARM.lower) & (found <= ARM.upper))
    assert np.all((moved[SCALE:TILT] >= journey.least[SCALE:TILT]) & (moved[SCALE:TILT] <= journey.most[SCALE:TILT]))
    np.testing.assert_array_equal(moved[~journey.free], place[~journey.free])


def test_path_stays_in_its_workspace():
    """All points of a path that is moved are in the workspace."""
    journey = replace(journey_of(), workspace=np.array([[0.0, -0.3, 0.2], [0.6, 0.3, 0.8]]))
    place = journey.within(np.where(journey.free, PLACE, journey.given)[None])[0][0]
    sides = Sides((journey,), ())
    moved, _ = improved_together(sides, sides, place, (ARM.sample(COUNT, 3),), [ASKED])
    tips = journey.placed(moved[None])[0][0]
    assert np.all((tips >= journey.workspace[0] - 1e-6) & (tips <= journey.workspace[1] + 1e-6))
