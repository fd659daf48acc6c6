"""What every correspondence keeps: its contract, direction, trimming, scouts, and the exact rigid map that it finds."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.transfer.icp.correspondence import CORRESPONDENCES, DIRECTIONS, correspondence_of
from maniport.transfer.icp.correspondence.contract import Matches
from maniport.transfer.icp.rotation import rotation_from_vector

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")

kinds = pytest.mark.parametrize("kind", CORRESPONDENCES)
one_way = pytest.mark.parametrize("kind", ["ellipsoid", "log-ellipsoid", "geodesic"])
assignments = pytest.mark.parametrize("kind", ["one-to-one", "transport"])


@pytest.fixture
def clouds(random_spd, random_rotation):
    """Two clouds of different size, and a rotation."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 30, 3), random_spd(rng, 23, 3), random_rotation(rng, 3)


def as_rows(matches):
    """List matches in a fixed order."""
    return sorted(zip(matches.teacher, matches.student, matches.weight, strict=True))


def test_names():
    """These names may be given, and nothing else."""
    assert set(CORRESPONDENCES) == {"ellipsoid", "log-ellipsoid", "geodesic", "one-to-one", "transport"}


@kinds
@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("d", [2, 3, 6])
def test_matches_are_indices_with_weights_that_sum_to_one(kind, direction, d, random_spd, random_rotation):
    """Every match names an ellipsoid of each cloud; weights are positive and sum to one."""
    rng = np.random.default_rng(d)
    teacher, student = random_spd(rng, 12, d), random_spd(rng, 9, d)
    found = correspondence_of(CORRESPONDENCES[kind], teacher, student, direction).match(random_rotation(rng, d))
    assert found.teacher.shape == found.student.shape == found.weight.shape
    assert found.teacher.dtype == found.student.dtype == np.intp
    assert set(found.teacher) <= set(range(12))
    assert set(found.student) <= set(range(9))
    assert np.all(found.weight > 0)
    assert found.weight.sum() == pytest.approx(1.0, rel=1e-12)


@one_way
def test_every_seeking_ellipsoid_has_one_partner(kind, clouds):
    """In one direction each ellipsoid of the seeking side occurs once, in its order."""
    teacher, student, rotation = clouds
    seek = correspondence_of(CORRESPONDENCES[kind], teacher, student)
    assert_array_equal(seek.match(rotation).teacher, np.arange(30))
    seek = correspondence_of(CORRESPONDENCES[kind], teacher, student, "student")
    assert_array_equal(seek.match(rotation).student, np.arange(23))


@kinds
def test_student_s_direction_is_the_teacher_s_with_roles_exchanged(kind, clouds):
    """Students that seek find what teachers would find under the inverse rotation with the clouds exchanged."""
    teacher, student, rotation = clouds
    found = correspondence_of(CORRESPONDENCES[kind], teacher, student, "student", 0.2, 2.0).match(rotation)
    other = correspondence_of(CORRESPONDENCES[kind], student, teacher, "teacher", 0.2, 2.0).match(rotation.T)
    assert_array_equal([row[:2] for row in as_rows(found)], [row[:2] for row in as_rows(other.exchanged())])
    assert_allclose([row[2] for row in as_rows(found)], [row[2] for row in as_rows(other.exchanged())], rtol=1e-9)


@one_way
def test_both_directions_have_half_of_the_weight(kind, clouds):
    """Both directions together are the matches of each, with half of the weight."""
    teacher, student, rotation = clouds
    both, first, second = (
        correspondence_of(CORRESPONDENCES[kind], teacher, student, direction, 0.1).match(rotation)
        for direction in ("both", "teacher", "student")
    )
    assert_array_equal(both.teacher, [*first.teacher, *second.teacher])
    assert_array_equal(both.student, [*first.student, *second.student])
    assert_allclose(both.weight, 0.5 * np.concatenate([first.weight, second.weight]))


@assignments
def test_direction_makes_no_difference_to_assignments(kind, clouds):
    """Methods that match clouds as a whole find the same in every direction."""
    teacher, student, rotation = clouds
    rows = [as_rows(correspondence_of(CORRESPONDENCES[kind], teacher, student, d).match(rotation)) for d in DIRECTIONS]
    assert rows[0] == rows[1] == rows[2]


@kinds
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_scouts_refer_to_the_whole_clouds(kind, direction, clouds):
    """Fewer ellipsoids seek; those that do in one direction find the partners that they had."""
    teacher, student, rotation = clouds
    whole = correspondence_of(CORRESPONDENCES[kind], teacher, student, direction, exponent=0.0)
    part, every = whole.scouts(7).match(rotation), whole.match(rotation)
    assert len(part.weight) < len(every.weight)
    assert {0, 29} <= set(part.teacher) or {0, 22} <= set(part.student)
    if kind not in ("one-to-one", "transport"):
        pairs = set(zip(every.teacher, every.student, strict=True))
        assert set(zip(part.teacher, part.student, strict=True)) <= pairs
    assert_array_equal(whole.match(rotation).teacher, every.teacher)
    assert as_rows(whole.scouts(1000).match(rotation)) == as_rows(every)


def test_trimming_leaves_out_the_largest_losses():
    """Of ten matches three tenths less are seven, the best ones in their order, with weights that sum to one."""
    loss = np.array([0.5, 3.0, 0.1, 2.0, 0.2, 0.3, 9.0, 0.4, 1.0, 1.0])
    index, weight = np.arange(10), np.arange(1.0, 11.0)
    found = Matches.best(index, index[::-1], weight, loss, 0.3)
    assert_array_equal(found.teacher, [0, 2, 4, 5, 7, 8, 9])
    assert_array_equal(found.student, [9, 7, 5, 4, 2, 1, 0])
    assert_allclose(found.weight, weight[found.teacher] / weight[found.teacher].sum())
    assert len(Matches.best(index, index, weight, loss, 0.29).weight) == 8
    assert_array_equal(Matches.best(index, index, weight, loss, 0.999999).teacher, [2])


@pytest.mark.parametrize("kind", ["log-ellipsoid", "geodesic", "one-to-one", "transport"])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_trimming_leaves_out_planted_outliers(kind, direction, random_spd, random_rotation):
    """A fifth of the student's ellipsoids is replaced by elongated ones: trimmed, the matches are the true pairs."""
    rng = np.random.default_rng(1)
    teacher, truth = random_spd(rng, 50, 3, 20.0), random_rotation(rng, 3)
    student = truth @ teacher @ truth.T
    strange = rng.choice(50, 10, replace=False)
    student[strange] = 30.0 * random_spd(rng, 10, 3, 1e6)
    seek = correspondence_of(CORRESPONDENCES[kind], teacher, student, direction, trim=0.2)
    found = seek.match(truth)
    assert_array_equal(found.teacher, found.student)
    assert not set(found.student) & set(strange)
    untrimmed = correspondence_of(CORRESPONDENCES[kind], teacher, student, direction).match(truth)
    assert {*untrimmed.teacher, *untrimmed.student} & set(strange)


@pytest.mark.parametrize("kind", CORRESPONDENCES)
def test_trimming_recovers_the_exact_rotation(kind, random_spd):
    """With a tenth of the student's ellipsoids replaced by outliers the trimmed search still ends at the truth.

    The outliers come in pairs about the mean, which so stays where it was.
    """
    rng = np.random.default_rng(2)
    teacher, strange = random_spd(rng, 60, 3, 20.0), random_spd(rng, 3, 3, 1e6)
    round_ = np.eye(3) * np.array([1.5, 1.5, 1.5, 1 / 1.5, 1 / 1.5, 1 / 1.5])[:, None, None]
    teacher = np.concatenate([spd.whiten(teacher, spd.mean(teacher)), round_])
    turn = rotation_from_vector(np.array([0.1, -0.2, 0.1]))
    student = turn @ teacher @ turn.T
    student[60:] = np.concatenate([strange, np.linalg.inv(strange)])
    options = {"scale": False, "correspondence": kind, "n_starts": 0, "compete": False}
    trimmed = mp.RiemannianICP(trim=0.15, **options).fit(teacher, student)
    assert_allclose(trimmed.rotation_, turn, atol=1e-6)
    assert len(trimmed.correspondence_) == len(trimmed.matched_teacher_) < 66
    plain = mp.RiemannianICP(**options).fit(teacher, student)
    assert plain.cost_ > trimmed.cost_ + 0.05


@kinds
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_exact_map_is_recovered(kind, direction, random_map):
    """The paper's toy: Panda ellipsoids under a random rotation, dispersion and mean, shuffled; new ones are exact."""
    panda = mp.load_arm("panda")
    rng = np.random.default_rng(3)
    ellipsoids = panda.manipulability(panda.sample(70, rng, sequence="uniform"))
    teacher, new = ellipsoids[:60], ellipsoids[60:]
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(correspondence=kind, direction=direction, random_state=0)
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert np.all(spd.distance(adapter.transform(new), truth.apply(new)) < 1e-6)
    assert adapter.converged_


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"correspondence": "nearest"}, "unknown correspondence 'nearest'; there are, nearest first: 'geodesic'"),
        ({"correspondence": None}, "unknown correspondence"),
        ({"direction": "forth"}, "unknown direction 'forth'"),
        ({"trim": 1.0}, r"trim must be a number in \[0, 1\); found 1"),
        ({"trim": -0.1}, r"trim must be a number in \[0, 1\); found -0\.1"),
        ({"prior_weight": -1.0}, "prior_weight must be a number of at least 0; found -1"),
        ({"prior_weight": np.inf}, "prior_weight must be a number of at least 0; found inf"),
    ],
)
def test_bad_options(options, message, clouds):
    """Names, fractions and weights are checked, and what is allowed is said."""
    with pytest.raises(InvalidInputError, match=message):
        mp.RiemannianICP(**options).fit(*clouds[:2])


@kinds
def test_options_are_saved_with_the_adapter(kind, clouds, tmp_path):
    """A loaded adapter has the correspondence, direction, trimming and prior that it was fitted with."""
    options = {"correspondence": kind, "direction": "both", "trim": 0.1, "prior_weight": 0.2}
    adapter = mp.RiemannianICP(n_starts=0, max_iter=2, **options).fit(*clouds[:2])
    adapter.save(tmp_path / "adapter.npz")
    loaded = mp.load_adapter(tmp_path / "adapter.npz")
    assert options.items() <= loaded.get_params().items()
    assert_array_equal(loaded.correspondence_, adapter.correspondence_)
    assert_array_equal(loaded.matched_teacher_, adapter.matched_teacher_)
    assert_array_equal(loaded.transform(clouds[0]), adapter.transform(clouds[0]))
