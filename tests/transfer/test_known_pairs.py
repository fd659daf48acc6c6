"""Known correspondences: what they fix, how they weigh, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.pipeline import Pipeline

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError, NotFittedError, NotSPDError
from maniport.transfer import EllipsoidCorrespondence, Search
from maniport.transfer.icp.initialization import rotations_of_pairs
from maniport.transfer.rotation_group import rotation_angle, rotation_from_vector

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")


DEFAULTS = Search()


def icp(search=DEFAULTS, **options):
    """Make an adapter that keeps what its search finds."""
    return mp.RiemannianICP(search=replace(search, require_improvement=False), **options)


def about_z(angle):
    """Rotation about the third axis."""
    return rotation_from_vector(np.array([0.0, 0.0, angle]))


def wheel(points, spokes=12):
    """Each ellipsoid at equal turns about the third axis: the whole is symmetric under these turns."""
    turns = [about_z(2.0 * np.pi * i / spokes) for i in range(spokes)]
    return np.concatenate([turn @ points @ turn.T for turn in turns])


@pytest.fixture
def symmetric(random_spd):
    """A domain that is symmetric under turns by 30° about the third axis, and five ellipsoids beside."""
    rng = np.random.default_rng(0)
    return wheel(random_spd(rng, 8, 3)), random_spd(rng, 5, 3)


@pytest.fixture
def unequal(random_spd):
    """Two domains that are no images of each other, and pairs."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 40, 3), random_spd(rng, 55, 3), (random_spd(rng, 4, 3), random_spd(rng, 4, 3))


@pytest.mark.parametrize("degrees", [60.0, -120.0])
@pytest.mark.parametrize("count", [1, 5])
def test_pairs_fix_what_a_symmetric_domain_leaves_open(degrees, count, symmetric):
    """From the clouds alone the turn about the axis is unknown; with a pair or more it is exact."""
    domain, beside = symmetric
    turn = about_z(np.deg2rad(degrees))
    student, paired = 2.0 * turn @ domain @ turn.T, beside[:count]
    blind = icp(random_state=0).fit(domain, student)
    assert_allclose(blind.rotation_, np.eye(3), atol=1e-9)
    assert blind.cost_ < 1e-9
    informed = icp(random_state=0).fit(domain, student, pairs=(paired, 2.0 * turn @ paired @ turn.T))
    assert_allclose(informed.rotation_, turn, atol=1e-9)
    assert_allclose(informed.start_rotation_, turn, atol=1e-4)
    assert np.all(spd.distance(informed.transform(beside), 2.0 * turn @ beside @ turn.T) < 1e-6)


def test_one_pair_leaves_half_turns(random_spd, random_rotation):
    """One pair has four equally good rotations, half turns about its axes apart; the nearest comes first."""
    rng = np.random.default_rng(0)
    teacher, truth = random_spd(rng, 1, 3), random_rotation(rng, 3)
    near = rotation_from_vector(np.array([0.2, -0.3, 0.1])) @ truth
    rotations = rotations_of_pairs(teacher, truth @ teacher @ truth.T, near, rng)
    assert len(rotations) == 4
    assert_allclose(rotations[0], truth, atol=1e-5)
    for other in rotations[1:]:
        assert rotation_angle(rotations[0], other) == pytest.approx(np.pi, abs=1e-4)
        assert_allclose(other @ teacher @ other.T, truth @ teacher @ truth.T, atol=1e-3)


def test_pairs_have_half_of_the_weight(unequal):
    """The cost is the root of half the matches' and half the pairs' mean squared distance, however many they are."""
    teacher, student, (paired, targets) = unequal
    for count in (1, 4):
        pairs = (paired[:count], targets[:count])
        adapter = icp(scale=False, correspondence=EllipsoidCorrespondence(exponent=0.0)).fit(
            teacher, student, pairs=pairs
        )
        matched = adapter.errors(teacher[adapter.matched_teacher_], student[adapter.correspondence_])
        informed = adapter.errors(*pairs)
        expected = np.sqrt(0.5 * np.mean(matched**2) + 0.5 * np.mean(informed**2))
        assert adapter.cost_ == pytest.approx(expected, rel=1e-6)
        assert adapter.cost_ == adapter.history_.min()


@pytest.mark.parametrize(("remedy", "size"), [({"damping": 0.01}, 3.0), ({"eigenvalue_floor": 1e-3}, 1.0)], ids=str)
def test_pairs_get_the_regularization_of_their_domains(remedy, size, random_singular):
    """Singular ellipsoids may be shown, and are damped as much as their domains."""
    rng = np.random.default_rng(0)
    domain, turn = random_singular(rng, 40, 3), about_z(0.6)
    student = size * turn @ domain @ turn.T
    adapter = icp(**remedy).fit(domain, student, pairs=(domain[:3], student[:3]))
    assert np.all(adapter.errors(domain, student) < 1e-5)
    paired = domain[:3]
    with pytest.raises(NotSPDError, match=r"pairs\[0\]\[0\] is singular.*damping=0\.01"):
        icp().fit(domain + np.eye(3), domain + np.eye(3), (paired, paired + np.eye(3)))


def test_a_pipeline_hands_pairs_on(unequal):
    """To the fit of its last step."""
    teacher, student, pairs = unequal
    adapter = icp(random_state=0).fit(teacher, student, pairs=pairs)
    pipeline = Pipeline([("icp", icp(random_state=0))]).fit(teacher, student, icp__pairs=pairs)
    assert_array_equal(pipeline.transform(teacher), adapter.transform(teacher))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, s: t, r"pairs must be two sets of ellipsoids, \(teacher, student\).*found ndarray of 4"),
        (lambda t, s: 3, "pairs must be two sets of ellipsoids.*found int"),
        (lambda t, s: (t, s, s), "pairs must be two sets.*found tuple of 3"),
        (lambda t, s: (t[:3], s), "pairs must hold equally many ellipsoids.*found 3 and 4"),
        (lambda t, s: (t[:0], s[:0]), r"pairs\[0\] must hold at least 1 matrices; found 0"),
        (lambda t, s: (t[0], s[0]), r"pairs\[0\] must be a set of matrices, shape \(n, d, d\); found shape \(3, 3\)"),
        (lambda t, s: (t, s[:, :2, :2]), r"pairs\[1\] must hold 3×3 matrices; found 2×2"),
        (lambda t, s: (t, -s), r"pairs\[1\]\[0\] is indefinite"),
        (lambda t, s: (t * np.nan, s), r"pairs\[0\] must be finite"),
    ],
)
def test_bad_pairs(change, message, unequal):
    """Pairs that cannot be used are named, and the adapter stays what it was."""
    teacher, student, pairs = unequal
    fresh, fitted = icp(), icp(search=Search(n_starts=0)).fit(teacher, student)
    before = fitted.transform(teacher)
    for adapter in (fresh, fitted):
        with pytest.raises(InvalidInputError, match=message):
            adapter.fit(teacher, 2.0 * student[:30], pairs=change(*pairs))
    assert_array_equal(fitted.transform(teacher), before)
    with pytest.raises(NotFittedError):
        fresh.transform(teacher)
