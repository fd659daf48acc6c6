"""Laws of the lengths field: axes, where it fades, symmetries, inverse, derivative, and the axis of the student."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.arms import EllipsoidSpec
from maniport.errors import InvalidInputError, NotInvertibleError, NotSPDError
from maniport.transfer.length_field.field import MAX_NEAR_SINGULAR, least_singular
from maniport.transfer.length_field.fit import Samples, reported

sizes = pytest.mark.parametrize("d", [2, 3, 6])


def bounded(points):
    """The nearest ellipsoids whose eigenvalues lie from 0.4 to 3: what a made-up student can make, in closed form."""
    values, vectors = np.linalg.eigh(points)
    return (vectors * np.clip(values, 0.4, 3.0)[:, None]) @ np.swapaxes(vectors, -1, -2)


def commutator(images, points):
    return (
        np.abs(images @ points - points @ images).max()
        / np.abs(images).max()
        / np.abs(points).max()
    )


@pytest.fixture(scope="module")
def domains(random_spd):
    """A teacher's and a student's domain by their size; the student's lengths are bounded."""
    pairs = {}
    for d in (2, 3, 6):
        rng = np.random.default_rng(d)
        pairs[d] = (
            random_spd(rng, 150, d, 30.0) * rng.uniform(0.6, 1.6, (150, 1, 1)),
            bounded(random_spd(rng, 80, d)),
        )
    return pairs


@pytest.fixture(scope="module")
def fitted(domains):
    return {
        d: mp.LengthField(projector=bounded, n_centers=40).fit(*pair) for d, pair in domains.items()
    }


def singular_values(adapter, points):
    field = adapter._field()
    return least_singular(field.slopes(*field.base(adapter.teacher_side(points))))


@sizes
def test_images_come_nearer_to_what_the_student_can_make(d, domains, fitted, random_spd):
    adapter = fitted[d]
    new = random_spd(np.random.default_rng(7), 50, d, 30.0)
    away = spd.distance(adapter.transform(new), bounded(adapter.transform(new)))
    plain = mp.LengthField(projector=lambda points: points * 1.0).fit(*domains[d]).transform(new)
    assert away.mean() < 0.5 * spd.distance(plain, bounded(plain)).mean()
    assert adapter.report_.gap < 0.1
    assert adapter.cost_ == adapter.history_[-1] < 0.3 * adapter.history_[0]


@sizes
def test_axes_are_kept(d, fitted, random_spd):
    points = random_spd(np.random.default_rng(8), 50, d)
    assert commutator(fitted[d].transform(points), points) < 1e-14


def test_folds_are_found_and_reported(domains):
    """A field that pulls all ellipsoids to one shape folds: the report says so, and the inverse is refused."""

    def one_shape(points):
        return np.diag([1.0, 2.0, 4.0]) * (1.0 + 1e-9 * points[:, :1, :1])

    adapter = mp.LengthField(projector=one_shape, n_centers=100, width=0.3, ridge=1e-9).fit(
        *domains[3]
    )
    points = domains[3][0]
    field = adapter._field()
    assert adapter.report_.near_singular > 0.1
    with pytest.raises(NotInvertibleError, match="nearly singular"):
        adapter.inverse_transform(adapter.transform(points[:2]))
    assert field.folded_centers > MAX_NEAR_SINGULAR
    report = reported(field, Samples(field, points, one_shape, 0.0), 0)
    slopes = field.slopes(*field.base(points))
    assert report.reversing == np.mean(np.linalg.det(slopes) < 0.0) > 0.0
    along = spd.to_vector(np.einsum("nik,njk->nkij", *[field.base(points)[1]] * 2))
    contrary = np.einsum("nki,nij,nkj->nk", along, slopes, along).min(axis=1) <= 0.0
    assert report.nonmonotone == np.mean(contrary) > 0.0


@sizes
def test_derivative_agrees_with_finite_differences(d, fitted, random_spd):
    field = fitted[d]._field()
    rng = np.random.default_rng(11)
    points = np.concatenate([random_spd(rng, 4, d), np.eye(d)[None] * 1.3])
    check_slopes(field, spd.to_vector(field.power * spd.logm(points) + field.shift * np.eye(d)))


def check_slopes(field, x):
    """Compare slopes at vectors (n, D) with central differences."""

    def logarithms(vectors):
        return spd.to_vector(field.logarithms(*np.linalg.eigh(spd.from_vector(vectors))))

    step = 1e-5 * np.eye(x.shape[1])
    expected = np.stack([(logarithms(x + e) - logarithms(x - e)) / 2e-5 for e in step], axis=-1)
    assert_allclose(field.slopes(*np.linalg.eigh(spd.from_vector(x))), expected, atol=1e-7)


class Searching:
    """A made-up student that remembers nothing, and can move its ellipsoids' first two lengths but not the third."""

    def __init__(self, ways=None):
        self.ways = ways
        self.epsilons = []

    def search(self, damping):
        self.epsilons.append(damping)
        return self

    def nearest(self, points, neighbors=None):
        ways = np.eye(3)[:2, :, None] * np.eye(3)[:2, None] if self.ways is None else self.ways
        return bounded(points), np.broadcast_to(ways, (len(points), *np.shape(ways)))


def test_a_searching_projector_gets_the_damping_and_returns_derivatives(domains):
    searching = Searching()
    adapter = mp.LengthField(damping=0.01, projector=searching).fit(*domains[3])
    assert set(searching.epsilons) == {adapter.student_damping_}
    free = mp.LengthField(damping=0.01, projector=bounded).fit(*domains[3])
    assert free.cost_ < adapter.cost_ < 0.5 * adapter.history_[0]


def test_the_report_has_the_gaps_of_the_images(fitted, random_spd):
    points = random_spd(np.random.default_rng(13), 40, 3, 30.0)
    images = fitted[3].transform(points)
    report = reported(fitted[3]._field(), Samples(fitted[3]._field(), points, bounded, 0.0), 0)
    gaps = spd.distance(images, bounded(images))
    assert_allclose([report.gap, report.gap_p95], [gaps.mean(), np.percentile(gaps, 95)], rtol=1e-6)


@pytest.mark.parametrize(
    ("projector", "error", "words"),
    [
        (3, InvalidInputError, "projector"),
        (lambda p: p[:-1], InvalidInputError, r"projector\(points\) must have shape"),
        (lambda p: p[:, :2, :2], InvalidInputError, r"projector\(points\) must have shape"),
        (lambda p: -p, NotSPDError, r"projector\(points\)\[0\] is indefinite"),
        (lambda p: p * np.nan, InvalidInputError, r"projector\(points\) must be finite"),
        (
            lambda p: np.broadcast_to(np.eye(3), p.shape),
            InvalidInputError,
            "the same ellipsoid for all",
        ),
        (Searching(np.ones((2, 2, 2))), InvalidInputError, "second of projector.search"),
        (
            Searching(np.full((1, 3, 3), np.inf)),
            InvalidInputError,
            "second of projector.search.* finite",
        ),
    ],
)
def test_bad_projectors_are_refused(projector, error, words, domains):
    adapter = mp.LengthField(projector=projector)
    with pytest.raises(error, match=words):
        adapter.fit(*domains[3])
    assert not hasattr(adapter, "lengths_")


AXIS = np.array([2.0, -1.0, 2.0]) / 3.0


class Round:
    """A synthetic student with bounded lengths, more so along the axes that lie near its own."""

    def __init__(self, axis=AXIS):
        self.axis = axis

    def __call__(self, points):
        values, vectors = np.linalg.eigh(points)
        bound = 1.0 + np.einsum("i,nij->nj", AXIS, vectors) ** 2
        return (vectors * np.clip(values, 0.2 * bound, 2.5 * bound)[:, None]) @ np.swapaxes(
            vectors, -1, -2
        )


@pytest.fixture(scope="module")
def round_domains(random_spd):
    rng = np.random.default_rng(0)
    return random_spd(rng, 200, 3, 30.0), Round()(random_spd(rng, 80, 3))


@pytest.fixture(scope="module")
def round_field(round_domains):
    return mp.LengthField(damping=0.01, projector=Round(), n_centers=40).fit(*round_domains)


def test_turned_about_the_axis_ellipsoids_have_turned_images(round_domains, round_field):
    adapter = round_field
    points = round_domains[0][:20]
    images = adapter.transform(points)
    turn = Rotation.from_rotvec(1.1 * AXIS).as_matrix()
    assert_allclose(adapter.transform(turn @ points @ turn.T), turn @ images @ turn.T, atol=1e-9)
    other = Rotation.from_rotvec(np.cross(AXIS, [1.0, 0.0, 0.0])).as_matrix()
    assert (
        spd.distance(adapter.transform(other @ points @ other.T), other @ images @ other.T).max()
        > 0.1
    )


def test_derivative_and_inverse_know_of_the_axis(round_domains, round_field):
    adapter = round_field
    points = round_domains[0][:20]
    field = adapter._field()
    check_slopes(field, spd.to_vector(field.power * spd.logm(points[:5]) + field.shift * np.eye(3)))
    fair = points[singular_values(adapter, points) > 0.2]
    assert len(fair) > 5
    assert spd.distance(adapter.inverse_transform(adapter.transform(fair)), fair).max() < 1e-8


def test_an_arm_that_goes_round_has_an_axis():
    panda = mp.load_arm("panda")
    assert_allclose(mp.FeasibleProjector(panda).axis, [0.0, 0.0, 1.0], atol=1e-12)
    lower = panda.lower.copy()
    upper = panda.upper.copy()
    upper[0] = lower[0] + np.radians(299.0)
    assert mp.FeasibleProjector(panda.narrowed(lower, upper)).axis is None
    assert mp.FeasibleProjector(panda, EllipsoidSpec(part="full")).axis is None
    assert_allclose(
        mp.FeasibleProjector(panda, EllipsoidSpec("force")).axis, [0.0, 0.0, 1.0], atol=1e-12
    )


def test_the_default_damping_is_that_of_the_projector():
    panda = mp.load_arm("panda")
    domain = mp.sample_domain(panda, 256, random_state=0)
    projector = mp.FeasibleProjector(panda, damping=0.03)
    field = mp.LengthField(projector=projector, n_samples=64, n_rounds=1).fit(domain, domain)
    known = mp.LengthField(damping=0.03, projector=projector, n_samples=64, n_rounds=1)
    assert field.student_damping_ == known.fit(domain, domain).student_damping_ > 0.0
