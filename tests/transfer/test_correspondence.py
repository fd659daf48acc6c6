"""What every correspondence keeps: its contract, direction, trimming, and the exact rigid map that it finds."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.transfer import Correspondence, EllipsoidCorrespondence, GeodesicCorrespondence, Search
from maniport.transfer.icp.correspondence import CORRESPONDENCES, DIRECTIONS, Matches
from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher
from maniport.util.files import load_arrays, save_arrays

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")

kinds = pytest.mark.parametrize("kind", CORRESPONDENCES)


def chosen(kind, direction="teacher", **options):
    """Make a correspondence; those that match clouds as a whole have no direction and no exponent."""
    if kind in ("one-to-one", "transport"):
        return CORRESPONDENCES[kind](**{key: value for key, value in options.items() if key == "trim"})
    if kind == "geodesic":
        options.pop("exponent", None)
    return CORRESPONDENCES[kind](direction=direction, **options)


@pytest.fixture
def clouds(random_spd, random_rotation):
    """Two clouds of different size, and a rotation."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 30, 3), random_spd(rng, 23, 3), random_rotation(rng, 3)


def as_rows(*columns):
    """List matches in a fixed order, as pairs and weights."""
    rows = sorted(zip(*columns, strict=True))
    return [row[:2] for row in rows], [row[2] for row in rows]


@kinds
@pytest.mark.parametrize("d", [2, 3, 6])
def test_student_s_direction_is_the_teacher_s_with_roles_exchanged(kind, d, random_spd, random_rotation):
    """Students that seek find what teachers would under the inverse rotation; weights are positive and sum to one."""
    rng = np.random.default_rng(d)
    teacher, student, rotation = random_spd(rng, 30, d), random_spd(rng, 23, d), random_rotation(rng, d)
    matches = chosen(kind, "student", trim=0.2, exponent=2.0).between(teacher, student)(rotation)
    other = chosen(kind, trim=0.2, exponent=2.0).between(student, teacher)(rotation.T)
    pairs, weights = as_rows(matches.teacher, matches.student, matches.weight)
    other_pairs, other_weights = as_rows(other.student, other.teacher, other.weight)
    assert pairs == other_pairs
    assert_allclose(weights, other_weights, rtol=1e-9)
    assert min(weights) > 0
    assert sum(weights) == pytest.approx(1.0, rel=1e-12)
    assert {*matches.teacher} <= {*range(30)}
    assert {*matches.student} <= {*range(23)}


@pytest.mark.parametrize("kind", ["log-ellipsoid", "geodesic", "one-to-one", "transport"])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_trimming_leaves_out_planted_outliers(kind, direction, random_spd, random_rotation):
    """A fifth of the student's ellipsoids is replaced by elongated ones: trimmed, the matches are the true pairs."""
    rng = np.random.default_rng(1)
    teacher, truth = random_spd(rng, 50, 3, 20.0), random_rotation(rng, 3)
    student = truth @ teacher @ truth.T
    strange = rng.choice(50, 10, replace=False)
    student[strange] = 30.0 * random_spd(rng, 10, 3, 1e6)
    matches = chosen(kind, direction, trim=0.2).between(teacher, student)(truth)
    assert_array_equal(matches.teacher, matches.student)
    assert not set(matches.student) & set(strange)
    untrimmed = chosen(kind, direction).between(teacher, student)(truth)
    assert {*untrimmed.teacher, *untrimmed.student} & set(strange)


@kinds
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_exact_map_is_recovered(kind, direction, random_map):
    """The paper's toy: Panda ellipsoids under a random rotation, dispersion and mean, shuffled; new ones are exact."""
    panda = mp.load_arm("panda")
    rng = np.random.default_rng(3)
    ellipsoids = panda.manipulability(panda.sample(70, rng, sequence="uniform"))
    teacher, new = ellipsoids[:60], ellipsoids[60:]
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(random_state=0, correspondence=chosen(kind, direction))
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert np.all(spd.distance(adapter.transform(new), truth.apply(new)) < 1e-6)
    assert adapter.converged_


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (lambda: {"correspondence": "nearest"}, "unknown correspondence 'nearest'; available, nearest first: 'geodes"),
        (lambda: {"correspondence": None}, "correspondence must be one of 'ellipsoid', .* or a Correspondence; found"),
        (lambda: {"correspondence": GeodesicCorrespondence}, "or a Correspondence; found <class"),
        (lambda: {"correspondence": GeodesicCorrespondence(direction="forth")}, "unknown direction 'forth'"),
        (lambda: {"correspondence": GeodesicCorrespondence(trim=1.0)}, r"trim must be a number in \[0, 1\); found 1"),
        (lambda: {"correspondence": chosen("transport", trim=-0.1)}, r"trim must be .* in \[0, 1\); found -0\.1"),
        (lambda: {"search": {"n_starts": 0}}, r"search must be a Search, such as Search\(n_starts=0\); found {"),
    ],
)
def test_bad_options(options, message, clouds):
    """Names, fractions and weights are checked, and what is allowed is said."""
    with pytest.raises(InvalidInputError, match=message):
        mp.RiemannianICP(**options()).fit(*clouds[:2])


@dataclass(frozen=True)
class ByVolume(Correspondence):
    """A correspondence from outside: every teacher ellipsoid with the student's of the nearest log-volume."""

    power: float = 0.0

    def between(self, teacher, student):
        """Matching without any look at the rotation."""
        volumes = [np.linalg.slogdet(points)[1] for points in (teacher, student)]
        partner = np.abs(volumes[0][:, None] - volumes[1]).argmin(axis=1)

        def match(rotation):
            seeking = np.arange(len(teacher))
            weight = np.exp(self.power * volumes[0][seeking])
            return Matches(seeking, partner[seeking], weight / weight.sum())

        return match


def test_a_file_names_the_correspondence_that_it_does_not_hold(clouds, tmp_path):
    """A file read where a correspondence's class is unknown maps as before, and a new fit names the class."""
    teacher, student, _ = clouds
    adapter = mp.RiemannianICP(correspondence=ByVolume(), search=Search(n_starts=0)).fit(teacher, student)
    adapter.save(tmp_path / "adapter.npz")
    arrays = load_arrays(tmp_path / "adapter.npz", "adapter file")
    unknown = str(arrays["adapter"]).replace("ByVolume", "Unknown")
    save_arrays(tmp_path / "adapter.npz", {**arrays, "adapter": np.array(unknown)})
    loaded = mp.load_adapter(tmp_path / "adapter.npz")
    assert_array_equal(loaded.transform(teacher), adapter.transform(teacher))
    with pytest.raises(InvalidInputError, match=r"correspondence .*Unknown"):
        loaded.fit(teacher, student)
    loaded.set_params(correspondence=ByVolume()).fit(teacher, student)


# ---- matching rules against exhaustive searches -------------------------------------------------------------------

assignments = pytest.mark.parametrize("kind", ["one-to-one", "transport"])


def squared(teacher, student, rotation):
    """All squared distances under a rotation of the teacher."""
    return spd.distance((rotation @ teacher @ rotation.T)[:, None], student) ** 2


@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [10.0, 1e5])
def test_geodesic_partner_is_the_nearest(d, condition, random_spd, random_rotation):
    """No other student ellipsoid is nearer, and all matches weigh the same."""
    rng = np.random.default_rng(d)
    teacher, student = random_spd(rng, 25, d, condition), random_spd(rng, 60, d, condition)
    seek = CORRESPONDENCES["geodesic"]().between(teacher, student)
    for _ in range(3):
        rotation = random_rotation(rng, d)
        matches, every = seek(rotation), squared(teacher, student, rotation)
        assert_allclose(every[matches.teacher, matches.student], every.min(axis=1), rtol=1e-6)
        assert_allclose(matches.weight, 1.0 / 25)


def test_geodesic_search_never_raises_its_cost(random_spd):
    """Nearest matches and rotations have one objective: it falls in every iteration, trimmed or not."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 60, 3), random_spd(rng, 80, 3)
    for trim in (0.0, 0.2):
        adapter = mp.RiemannianICP(
            correspondence=GeodesicCorrespondence(trim=trim), search=Search(n_starts=0, require_improvement=False)
        ).fit(teacher, student)
        assert np.all(np.diff(adapter.history_) <= 1e-9)
        assert adapter.converged_
        assert adapter.n_iter_ > 1


@assignments
def test_sum_of_squared_distances_is_the_least(kind, random_spd, random_rotation):
    """Of all permutations of six ellipsoids none has a smaller sum."""
    rng = np.random.default_rng(1)
    teacher, student, rotation = random_spd(rng, 6, 3), random_spd(rng, 6, 3), random_rotation(rng, 3)
    every = squared(teacher, student, rotation)
    matches = CORRESPONDENCES[kind]().between(teacher, student)(rotation)
    least = min(every[np.arange(6), list(order)].sum() for order in permutations(range(6)))
    assert every[matches.teacher, matches.student].sum() == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize(("n", "m"), [(12, 7), (15, 15)])
def test_trimmed_plan_is_partial_transport(n, m, random_spd):
    """A trimmed plan costs what POT's partial transport of the rest of the mass costs, and nobody gives too much."""
    from ot.partial import partial_wasserstein2

    rng = np.random.default_rng(4)
    teacher, student = random_spd(rng, n, 3), random_spd(rng, m, 3)
    cost = squared(teacher, student, np.eye(3))
    matches = CORRESPONDENCES["transport"](trim=0.3).between(teacher, student)(np.eye(3))
    least = partial_wasserstein2(np.full(n, 1 / n), np.full(m, 1 / m), cost, m=0.7)
    assert 0.7 * matches.weight @ cost[matches.teacher, matches.student] == pytest.approx(least, rel=1e-9)
    assert 0.7 * np.bincount(matches.teacher, matches.weight, n).max() <= 1.0 / n + 1e-12
    assert 0.7 * np.bincount(matches.student, matches.weight, m).max() <= 1.0 / m + 1e-12


@assignments
def test_too_large_domains_are_refused(kind, random_spd, monkeypatch):
    """Beyond the limit the sizes and the remedies are named."""
    monkeypatch.setattr("maniport.transfer.icp.correspondence.LIMIT", 20)
    rng = np.random.default_rng(6)
    small, large = random_spd(rng, 20, 3), random_spd(rng, 21, 3)
    with pytest.raises(InvalidInputError, match=f"'{kind}' matches at most 20 .* found 21 and 20.*most_singular=20"):
        mp.RiemannianICP(correspondence=kind).fit(large, small)
    mp.RiemannianICP(correspondence=kind, search=Search(most_singular=20, max_iter=1, n_starts=0)).fit(large, small)


def scores(teacher, student, ratios=False):
    """All scores, shape (n, m), from eigenvalues and -vectors."""
    (values_t, axes_t), (values_s, axes_s) = (np.linalg.eigh(points) for points in (teacher, student))
    directions = sum(np.abs(axes_t[:, :, k] @ axes_s[:, :, k].T) for k in (0, -1))
    shapes = [
        [values[:, -1] / values[:, 0], np.sqrt(np.linalg.det(points))]
        for values, points in ((values_t, teacher), (values_s, student))
    ]
    shapes = [np.log(shape) if ratios else np.array(shape) for shape in shapes]
    return directions + np.exp(-np.abs(shapes[0][:, :, None] - shapes[1][:, None, :])).sum(axis=0)


@pytest.mark.parametrize("ratios", [False, True])
@pytest.mark.parametrize("d", [2, 3, 6])
@pytest.mark.parametrize("condition", [1.5, 30.0, 1e4])
def test_partner_has_the_largest_score(ratios, d, condition, random_spd, random_rotation):
    """Under any rotation, no other ellipsoid has a larger score."""
    rng = np.random.default_rng(d)
    teacher, student, turn = (
        random_spd(rng, 40, d, condition),
        random_spd(rng, 300, d, condition),
        random_rotation(rng, d),
    )
    every = scores(turn @ teacher @ turn.T, student, ratios)
    features = (EllipsoidFeatures.of(points, ratios) for points in (teacher, student))
    index, score = ScoreMatcher(*features).query(turn)
    assert_allclose(score, every.max(axis=1), rtol=1e-6)
    assert_allclose(every[np.arange(40), index], every.max(axis=1), rtol=1e-6)


def test_weights_are_powers_of_the_score(random_spd):
    """Matches weigh w^k; an exponent of zero gives equal weights."""
    rng = np.random.default_rng(1)
    teacher, student = random_spd(rng, 20, 3), random_spd(rng, 30, 3)
    best = scores(teacher, student).max(axis=1)
    for exponent in (0.0, 3.0):
        matches = EllipsoidCorrespondence(exponent=exponent).between(teacher, student)(np.eye(3))
        assert_allclose(matches.weight, best**exponent / np.sum(best**exponent), rtol=1e-6)
