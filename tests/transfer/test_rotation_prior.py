"""The penalty that holds a rotation near its start: derivatives, scale, and what it does to a search."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.transfer import EllipsoidCorrespondence, Search
from maniport.transfer.icp.rotation import RotationPrior, RotationProblem
from maniport.transfer.rotation_group import rotation_angle, rotation_from_vector

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")


DEFAULTS = Search()


def icp(search=DEFAULTS, **options):
    """Make an adapter that keeps what its search finds."""
    return mp.RiemannianICP(search=replace(search, compete=False), n_resamples=0, **options)


DISCS = np.stack([np.diag([1.0, 1.0, 3.0]), np.diag([2.0, 2.0, 0.5])])


@pytest.mark.parametrize("d", [2, 3, 4, 6])
@given(seed=st.integers(0, 2**32 - 1))
def test_derivatives(d, seed, random_rotation):
    """Gradient and Hessian agree with finite differences, anywhere on the group."""
    rng = np.random.default_rng(seed)
    prior, rotation = RotationPrior(random_rotation(rng, d), 0.7), random_rotation(rng, d)
    cost, gradient, hessian = prior.derivatives(rotation)
    assert cost == pytest.approx(0.7 * (d - np.trace(rotation @ prior.rotation.T)), abs=1e-12)
    h, axes = 1e-5, np.eye(len(gradient))
    for a, axis in enumerate(axes):
        there, back = rotation_from_vector(h * axis) @ rotation, rotation_from_vector(-h * axis) @ rotation
        assert gradient[a] == pytest.approx((prior.cost(there) - prior.cost(back)) / (2 * h), abs=1e-8)
    push = rng.standard_normal(len(gradient))
    there, back = (rotation_from_vector(sign * 1e-4 * push) @ rotation for sign in (1.0, -1.0))
    second = (prior.cost(there) - 2.0 * cost + prior.cost(back)) / 1e-8
    assert push @ hessian @ push == pytest.approx(second, abs=1e-5 * max(1.0, push @ push))
    assert_allclose(hessian, hessian.T, atol=1e-14)


@pytest.mark.parametrize("d", [2, 3, 5])
def test_scale(d, random_rotation):
    """A turn by θ in one plane costs 2 w (1 − cos θ), which is w θ² for small θ; the start costs nothing."""
    rng = np.random.default_rng(d)
    prior, vector = RotationPrior(random_rotation(rng, d), 3.0), np.zeros(d * (d - 1) // 2)
    assert prior.cost(prior.rotation) == 0.0
    for angle in (1e-6, 0.1, 2.0, np.pi):
        vector[0] = angle
        turned = rotation_from_vector(vector) @ prior.rotation
        assert prior.cost(turned) == pytest.approx(6.0 * (1.0 - np.cos(angle)), rel=1e-8, abs=1e-15)
    vector[0] = 1e-6
    assert prior.cost(rotation_from_vector(vector) @ prior.rotation) == pytest.approx(3e-12, rel=1e-6)


@pytest.mark.parametrize("d", [2, 3, 4])
def test_problem_adds_the_prior(d, random_spd, random_rotation):
    """Cost and derivatives of a rotation problem are the pairs' and the prior's."""
    rng = np.random.default_rng(d)
    student, teacher, weights = random_spd(rng, 8, d), random_spd(rng, 8, d), np.full(8, 1 / 8)
    prior, rotation = RotationPrior(random_rotation(rng, d), 5.0), random_rotation(rng, d)
    plain, whole = RotationProblem(student, teacher, weights), RotationProblem(student, teacher, weights, prior)
    expected = [
        one + other for one, other in zip(plain.derivatives(rotation), prior.derivatives(rotation), strict=True)
    ]
    end = whole.minimize(rotation)
    for one, other in zip(whole.derivatives(rotation), expected, strict=True):
        assert_allclose(one, other, rtol=1e-9, atol=1e-9)
    assert whole.cost(rotation) == pytest.approx(expected[0])
    assert end.converged
    assert end.cost <= end.start_cost == pytest.approx(expected[0])


def test_flat_direction_is_held_and_the_others_are_free():
    """Ellipsoids round about one axis: the turn about it stays the prior's, the tilt is that of the ellipsoids."""
    tilt = rotation_from_vector(np.array([0.4, 0.0, 0.0]))
    about = rotation_from_vector(np.array([0.0, 0.0, 0.9]))
    problem = RotationProblem(tilt @ DISCS @ tilt.T, DISCS, np.full(2, 0.5), RotationPrior(about, 1e-3))
    for start in (np.eye(3), tilt, rotation_from_vector(np.array([0.1, 0.2, -0.3]))):
        end = problem.minimize(start)
        assert_allclose(end.rotation @ DISCS @ end.rotation.T, tilt @ DISCS @ tilt.T, atol=2e-3)
        nearest = min(
            rotation_angle(tilt @ rotation_from_vector(np.array([0, 0, z])), about) for z in np.arange(-3, 3, 0.01)
        )
        assert rotation_angle(end.rotation, about) == pytest.approx(nearest, abs=2e-3)


def test_minimum_between_clouds_and_prior_is_where_their_slopes_meet(random_spd, random_rotation):
    """The heavier the prior the nearer to its rotation the descent ends, from the pairs' optimum to the prior's own."""
    rng = np.random.default_rng(0)
    teacher, truth = random_spd(rng, 50, 3), rotation_from_vector(np.array([0.2, 0.1, -0.2]))
    angles = []
    for weight in (1e-6, 1e-2, 1.0, 1e2, 1e4, 1e7):
        problem = RotationProblem(
            truth @ teacher @ truth.T, teacher, np.full(50, 0.02), RotationPrior(np.eye(3), weight)
        )
        end = problem.minimize(np.eye(3))
        assert end.gradient_norm < 1e-9 * max(1.0, weight)
        angles.append(rotation_angle(end.rotation, np.eye(3)))
    assert angles[0] == pytest.approx(0.3, abs=1e-6)
    assert np.all(np.diff(angles) < 0)
    assert angles[-1] < 1e-5


def draw(rng, n, random_spd):
    """Make a sample of a domain that is symmetric about the third axis."""
    points = random_spd(rng, n, 3, 30.0)
    turns = np.stack([rotation_from_vector(np.array([0.0, 0.0, angle])) for angle in rng.uniform(0.0, 2 * np.pi, n)])
    return turns @ points @ np.swapaxes(turns, 1, 2)


@pytest.mark.parametrize("kind", ["ellipsoid", "geodesic"])
def test_search_between_independent_samples_stays_near_its_start(kind, random_spd):
    """Noise turns a search between two draws of a symmetric domain away from the truth; the prior holds it."""
    turns = {weight: [] for weight in (0.0, 3.0, 30.0)}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        teacher, student = draw(rng, 80, random_spd), draw(rng, 80, random_spd)
        for weight, found in turns.items():
            adapter = icp(correspondence=kind, search=Search(n_starts=0, prior_weight=weight)).fit(teacher, student)
            found.append(rotation_angle(adapter.rotation_, adapter.start_rotation_))
    free, held, tight = (np.mean(found) for found in turns.values())
    assert free > held > tight
    assert tight < 0.2 * free


@pytest.mark.parametrize("kind", ["ellipsoid", "geodesic"])
def test_search_is_hardly_moved_where_the_clouds_determine(kind, random_spd):
    """Of a turn by 0.3 rad between exact copies a light prior takes back less than a hundredth."""
    rng = np.random.default_rng(0)
    points = random_spd(rng, 100, 3, 30.0)
    teacher, turn = spd.whiten(points, spd.mean(points)), rotation_from_vector(np.array([0.2, 0.1, -0.2]))
    student = turn @ teacher @ turn.T
    adapter = icp(correspondence=kind, search=Search(n_starts=0, prior_weight=0.03)).fit(teacher, student)
    assert 0 < rotation_angle(adapter.rotation_, turn) < 0.003
    assert_allclose(
        icp(correspondence=kind, search=Search(n_starts=0)).fit(teacher, student).rotation_, turn, atol=1e-8
    )


def test_cost_includes_the_prior(random_spd):
    """The cost that is reported is what the search minimises."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 40, 3), random_spd(rng, 50, 3)
    adapter = icp(
        scale=False, correspondence=EllipsoidCorrespondence(exponent=0.0), search=Search(n_starts=0, prior_weight=0.5)
    ).fit(teacher, student)
    matched = adapter.errors(teacher[adapter.matched_teacher_], student[adapter.correspondence_])
    penalty = RotationPrior(adapter.start_rotation_, 0.5).cost(adapter.rotation_)
    assert adapter.cost_**2 == pytest.approx(np.mean(matched**2) + penalty, rel=1e-9)
    assert adapter.cost_ == adapter.history_.min()
