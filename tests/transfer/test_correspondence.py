"""What every correspondence keeps: its contract, direction, trimming, and the exact rigid map that it finds."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maniport as mp
from maniport import spd
from maniport.errors import InvalidInputError
from maniport.transfer import Correspondence, GeodesicCorrespondence, Search
from maniport.transfer.icp.correspondence import CORRESPONDENCES, DIRECTIONS, Matches
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


def exchanged(matches):
    """The same matches with teacher and student exchanged."""
    return Matches(matches.student, matches.teacher, matches.weight)


def as_rows(matches):
    """List matches in a fixed order."""
    return sorted(zip(matches.teacher, matches.student, matches.weight, strict=True))


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


@kinds
def test_student_s_direction_is_the_teacher_s_with_roles_exchanged(kind, clouds):
    """Students that seek find what teachers would find under the inverse rotation with the clouds exchanged."""
    teacher, student, rotation = clouds
    found = chosen(kind, "student", trim=0.2, exponent=2.0).between(teacher, student)(rotation)
    other = chosen(kind, trim=0.2, exponent=2.0).between(student, teacher)(rotation.T)
    assert_array_equal([row[:2] for row in as_rows(found)], [row[:2] for row in as_rows(exchanged(other))])
    assert_allclose([row[2] for row in as_rows(found)], [row[2] for row in as_rows(exchanged(other))], rtol=1e-9)


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
