"""What every correspondence keeps: its contract, direction, trimming, scouts, and the exact rigid map that it finds."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.transfer import Correspondence, GeodesicCorrespondence, Search
from maniport.transfer.icp.correspondence import CORRESPONDENCES, contract
from maniport.transfer.icp.correspondence.contract import DIRECTIONS, Matches, Seeking
from maniport.transfer.rotation_group import rotation_from_vector

# how the search ends is tested here, not what becomes of its result
pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")

kinds = pytest.mark.parametrize("kind", CORRESPONDENCES)
one_way = pytest.mark.parametrize("kind", ["ellipsoid", "log-ellipsoid", "geodesic"])


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
    found = chosen(kind, direction).between(teacher, student)(random_rotation(rng, d))
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
    assert_array_equal(chosen(kind).between(teacher, student)(rotation).teacher, np.arange(30))
    assert_array_equal(chosen(kind, "student").between(teacher, student)(rotation).student, np.arange(23))


@kinds
def test_student_s_direction_is_the_teacher_s_with_roles_exchanged(kind, clouds):
    """Students that seek find what teachers would find under the inverse rotation with the clouds exchanged."""
    teacher, student, rotation = clouds
    found = chosen(kind, "student", trim=0.2, exponent=2.0).between(teacher, student)(rotation)
    other = chosen(kind, trim=0.2, exponent=2.0).between(student, teacher)(rotation.T)
    assert_array_equal([row[:2] for row in as_rows(found)], [row[:2] for row in as_rows(other.exchanged())])
    assert_allclose([row[2] for row in as_rows(found)], [row[2] for row in as_rows(other.exchanged())], rtol=1e-9)


@one_way
def test_both_directions_have_half_of_the_weight(kind, clouds):
    """Both directions together are the matches of each, with half of the weight."""
    teacher, student, rotation = clouds
    both, first, second = (
        chosen(kind, direction, trim=0.1).between(teacher, student)(rotation)
        for direction in ("both", "teacher", "student")
    )
    assert_array_equal(both.teacher, [*first.teacher, *second.teacher])
    assert_array_equal(both.student, [*first.student, *second.student])
    assert_allclose(both.weight, 0.5 * np.concatenate([first.weight, second.weight]))


@kinds
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_scouts_refer_to_the_whole_clouds(kind, direction, clouds):
    """Fewer ellipsoids seek; those that do in one direction find the partners that they had."""
    teacher, student, rotation = clouds
    seek = chosen(kind, direction, exponent=0.0).between(teacher, student)
    part, every = seek(rotation, 7), seek(rotation)
    assert len(part.weight) < len(every.weight)
    assert {0, 29} <= set(part.teacher) or {0, 22} <= set(part.student)
    if kind not in ("one-to-one", "transport"):
        pairs = set(zip(every.teacher, every.student, strict=True))
        assert set(zip(part.teacher, part.student, strict=True)) <= pairs
    assert as_rows(seek(rotation, 1000)) == as_rows(every)


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
    found = chosen(kind, direction, trim=0.2).between(teacher, student)(truth)
    assert_array_equal(found.teacher, found.student)
    assert not set(found.student) & set(strange)
    untrimmed = chosen(kind, direction).between(teacher, student)(truth)
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
    options = {"scale": False, "search": Search(n_starts=0, compete=False), "n_resamples": 0}
    trimmed = mp.RiemannianICP(**options, correspondence=chosen(kind, trim=0.15)).fit(teacher, student)
    assert_allclose(trimmed.rotation_, turn, atol=1e-6)
    assert len(trimmed.correspondence_) == len(trimmed.matched_teacher_) < 66
    plain = mp.RiemannianICP(**options, correspondence=kind).fit(teacher, student)
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
    adapter = mp.RiemannianICP(random_state=0, correspondence=chosen(kind, direction))
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert np.all(spd.distance(adapter.transform(new), truth.apply(new)) < 1e-6)
    assert adapter.converged_


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (lambda: {"correspondence": "nearest"}, "unknown correspondence 'nearest'; there are, nearest first: 'geodes"),
        (lambda: {"correspondence": None}, "correspondence must be one of 'ellipsoid', .* or a Correspondence; found"),
        (lambda: {"correspondence": GeodesicCorrespondence}, "or a Correspondence; found <class"),
        (lambda: {"correspondence": GeodesicCorrespondence(direction="forth")}, "unknown direction 'forth'"),
        (lambda: {"correspondence": GeodesicCorrespondence(trim=1.0)}, r"trim must be a number in \[0, 1\); found 1"),
        (lambda: {"correspondence": chosen("transport", trim=-0.1)}, r"trim must be .* in \[0, 1\); found -0\.1"),
        (lambda: {"search": Search(prior_weight=-1.0)}, "prior_weight must be a number of at least 0; found -1"),
        (lambda: {"search": {"n_starts": 0}}, r"search must be a Search, such as Search\(n_starts=0\); found {"),
    ],
)
def test_bad_options(options, message, clouds):
    """Names, fractions and weights are checked, and what is allowed is said."""
    with pytest.raises(InvalidInputError, match=message):
        mp.RiemannianICP(**options()).fit(*clouds[:2])


@kinds
def test_options_are_saved_with_the_adapter(kind, clouds, tmp_path):
    """A loaded adapter has the correspondence, direction, trimming and prior that it was fitted with."""
    search = Search(n_starts=0, max_iter=2, prior_weight=0.2)
    adapter = mp.RiemannianICP(correspondence=chosen(kind, "both", trim=0.1), search=search).fit(*clouds[:2])
    adapter.save(tmp_path / "adapter.npz")
    loaded = mp.load_adapter(tmp_path / "adapter.npz")
    assert (loaded.correspondence, loaded.search) == (adapter.correspondence, search)
    assert repr(clone(loaded)) == repr(clone(adapter))
    assert_array_equal(loaded.correspondence_, adapter.correspondence_)
    assert_array_equal(loaded.matched_teacher_, adapter.matched_teacher_)
    assert_array_equal(loaded.transform(clouds[0]), adapter.transform(clouds[0]))


@dataclass(frozen=True)
class ByVolume(Correspondence):
    """A correspondence from outside: every teacher ellipsoid with the student's of the nearest log-volume."""

    power: float = 0.0

    def between(self, teacher, student):
        """Matching without any look at the rotation."""
        volumes = [np.linalg.slogdet(points)[1] for points in (teacher, student)]
        partner = np.abs(volumes[0][:, None] - volumes[1]).argmin(axis=1)

        def match(rotation, limit=None):
            seeking = np.arange(len(teacher))[:limit]
            weight = np.exp(self.power * volumes[0][seeking])
            return Matches(seeking, partner[seeking], weight / weight.sum())

        return match


class NoOptions(ByVolume):
    """Another one whose class a file does not know."""


def test_a_correspondence_of_one_s_own(clouds, tmp_path):
    """An object from outside is taken, cloned, fitted and followed in copies of clouds to their rotation."""
    teacher, _, turn = clouds
    adapter = mp.RiemannianICP(correspondence=ByVolume(power=0.5), n_resamples=2, random_state=0)
    adapter = clone(adapter).fit(teacher, turn @ teacher @ turn.T)
    assert_allclose(spd.distance(adapter.transform(teacher), turn @ teacher @ turn.T), 0.0, atol=1e-6)
    adapter.save(tmp_path / "adapter.npz")
    loaded = mp.load_adapter(tmp_path / "adapter.npz")  # whose class is known here
    assert loaded.correspondence == ByVolume(power=0.5)


def test_a_file_names_the_correspondence_that_it_does_not_hold(clouds, tmp_path, monkeypatch):
    """A file read where a correspondence's class is unknown maps as before, and says what a new fit needs."""
    teacher, student, _ = clouds
    adapter = mp.RiemannianICP(correspondence=NoOptions(), search=Search(n_starts=0)).fit(teacher, student)
    adapter.save(tmp_path / "adapter.npz")
    monkeypatch.delitem(contract.OPTIONS, NoOptions.key())
    loaded = mp.load_adapter(tmp_path / "adapter.npz")
    assert_array_equal(loaded.transform(teacher), adapter.transform(teacher))
    loaded.save(tmp_path / "again.npz")
    for one in (loaded, mp.load_adapter(tmp_path / "again.npz")):
        with pytest.raises(
            InvalidInputError, match=r"names the correspondence .*NoOptions and does not hold it.*set_par"
        ):
            one.fit(teacher, student)
    loaded.set_params(correspondence=NoOptions()).fit(teacher, student)


@pytest.mark.parametrize("kind", [kind for kind, one in CORRESPONDENCES.items() if issubclass(one, Seeking)])
def test_the_smaller_cloud_seeks(kind, random_spd):
    """By default every ellipsoid of the smaller cloud has one match, the teacher's where both are of one size."""
    rng = np.random.default_rng(3)
    for n, m in ((9, 4), (4, 9), (6, 6)):
        teacher, student = random_spd(rng, n, 3, 9.0), random_spd(rng, m, 3, 9.0)
        matches = CORRESPONDENCES[kind]().between(teacher, student)(np.eye(3))
        seekers = matches.teacher if n <= m else matches.student
        assert sorted(seekers) == list(range(min(n, m)))
