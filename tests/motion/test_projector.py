"""The nearest feasible ellipsoids of many, asked for again and again."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maniport import spd
from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError, NotSPDError
from maniport.motion import FeasibleProjector, SeedBank, nearest_feasible


@pytest.fixture(scope="module")
def projector(panda, bank):
    """A projector of the Panda."""
    return FeasibleProjector(panda, bank=bank)


@pytest.fixture(scope="module")
def points(panda, projector):
    """Ellipsoids of the Panda that are a little too long, with the damping."""
    return projector.objective.damped(1.2 * panda.ellipsoids(panda.sample(40, 7)))


def test_what_it_finds_is_feasible_and_about_as_near_as_a_thorough_search(panda, bank, projector, points):
    """The arm makes what is returned at the postures that are told, and the distances are those of a long search."""
    search = projector.search(projector.objective.damping.epsilon)
    found, _ = search.nearest(points)
    q = search.joint_positions
    assert np.all(panda.within_limits(q))
    assert_allclose(found, projector.objective.damped(panda.ellipsoids(q)), rtol=1e-12)
    thorough = nearest_feasible(
        panda, projector.objective.undamped(points), damping=projector.objective.damping, bank=bank
    )
    away = spd.distance(points, found)
    assert away.mean() < 1.05 * thorough.distance.mean()
    assert_array_equal(projector(points), found)


def test_asking_again_comes_no_less_near(projector, points):
    """Each further round starts where the last one ended, and where its neighbors did."""
    search = projector.search(projector.objective.damping.epsilon)
    first = spd.distance(points, search.nearest(points)[0])
    beside = np.stack([np.roll(np.arange(len(points)), k) for k in (1, 2, 3)], axis=1)
    again = spd.distance(points, search.nearest(points, beside)[0])
    assert np.all(again <= first + 1e-9)
    moved = spd.distance(1.01 * points, search.nearest(1.01 * points)[0])
    assert moved.mean() < first.mean() + 0.02


@pytest.mark.parametrize("kind", ["velocity", "force"])
def test_ways_are_derivatives_of_the_logarithm(panda, kind):
    """Each way is the change of log(A^-½ M A^-½) along a joint, by central differences; zero at a limit."""
    spec = EllipsoidSpec(kind)
    projector = FeasibleProjector(panda, spec, bank=SeedBank.build(panda, 512, spec=spec))
    objective = projector.objective
    points = objective.damped(1.1 * panda.ellipsoids(panda.sample(6, 1), spec))
    search = projector.search(objective.damping.epsilon)
    _, ways = search.nearest(points)
    q, targets = search.joint_positions, objective.targets(objective.undamped(points))
    held = (q <= panda.lower) | (q >= panda.upper)
    assert np.all(ways[held] == 0.0)
    for k in range(panda.dof):
        step = 1e-5 * np.eye(panda.dof)[k]
        wanted = (targets.logarithms(q + step) - targets.logarithms(q - step)) / 2e-5
        free = ~held[:, k]
        assert_allclose(ways[free, k], wanted[free], atol=1e-5 * max(1.0, np.abs(wanted).max()))


def test_bad_input_is_refused(panda, bank, projector, points):
    """Wrong shapes, what is not SPD, other numbers of points and no damping are refused by name."""
    with pytest.raises(InvalidInputError, match=r"points must hold 3×3"):
        projector(np.array([np.eye(2)]))
    with pytest.raises(NotSPDError, match=r"points\[1\] is indefinite"):
        projector(np.array([np.eye(3), -np.eye(3)]))
    search = projector.search(0.01)
    search.nearest(points[:3])
    with pytest.raises(InvalidInputError, match=r"points must have shape \(3, 3, 3\), as in the first call"):
        search.nearest(points[:2])
    with pytest.raises(InvalidInputError, match="damping must be a number above 0"):
        projector.search(0.0)
    with pytest.raises(InvalidInputError, match="damping must be above 0"):
        FeasibleProjector(panda, damping=None, bank=bank)
    with pytest.raises(InvalidInputError, match="start bank was built for"):
        FeasibleProjector(panda, EllipsoidSpec(part="rotation"), bank=bank)
