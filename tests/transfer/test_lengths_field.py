"""Laws of the lengths field: axes, where it fades, symmetries, inverse, derivative, and what it is told."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.distance import cdist
from sklearn.base import clone

import maniport as mp
from maniport import spd
from maniport.errors import FileFormatError, InvalidInputError, NotInvertibleError, NotSPDError
from maniport.files import load_arrays, save_arrays
from maniport.transfer.lengths.field import KAPPA, LengthsMap, damped
from maniport.transfer.lengths.fit import Samples, centers_among
from maniport.transfer.lengths.inverse import MOST_FOLDED, Inverse
from maniport.transfer.lengths.projector import as_projector
from maniport.transfer.lengths.report import reported
from maniport.transfer.lengths.symmetry import NO_AXIS

sizes = pytest.mark.parametrize("d", [2, 3, 6])


def bounded(points):
    """The nearest ellipsoids whose eigenvalues lie from 0.4 to 3: what a made-up student can make, in closed form."""
    values, vectors = np.linalg.eigh(points)
    return (vectors * np.clip(values, 0.4, 3.0)[:, None]) @ np.swapaxes(vectors, -1, -2)


def commutator(images, points):
    """How far images are from having the axes of points."""
    return np.abs(images @ points - points @ images).max() / np.abs(images).max() / np.abs(points).max()


@pytest.fixture(scope="module")
def domains(random_spd):
    """A teacher's and a student's domain by their size; the student's lengths are bounded."""
    found = {}
    for d in (2, 3, 6):
        rng = np.random.default_rng(d)
        found[d] = random_spd(rng, 150, d, 30.0) * rng.uniform(0.6, 1.6, (150, 1, 1)), bounded(random_spd(rng, 80, d))
    return found


@pytest.fixture(scope="module")
def fitted(domains):
    """Fields toward bounded lengths by their size, without damping."""
    return {d: mp.LengthsField(projector=bounded, n_centers=40).fit(*pair) for d, pair in domains.items()}


def turned_toward(domains, angle):
    """A field that may turn, toward ellipsoids that are turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return mp.LengthsField(projector=lambda points: turn @ points @ turn.T, n_centers=40, turn=True).fit(*domains[3])


@pytest.fixture(scope="module")
def turning(domains):
    """A field that may turn, toward ellipsoids that are turned a little."""
    return turned_toward(domains, 0.1)


@sizes
def test_images_come_nearer_to_what_the_student_can_make(d, domains, fitted, random_spd):
    """Images of ellipsoids that no fit has seen are several times nearer to it than the map without a field."""
    adapter, new = fitted[d], random_spd(np.random.default_rng(7), 50, d, 30.0)
    away = spd.distance(adapter.transform(new), bounded(adapter.transform(new)))
    plain = mp.LengthsField(projector=lambda points: points * 1.0).fit(*domains[d]).transform(new)
    assert away.mean() < 0.5 * spd.distance(plain, bounded(plain)).mean()
    assert adapter.report_.gap < 0.1
    assert adapter.cost_ == adapter.history_[-1] < 0.3 * adapter.history_[0]


@sizes
def test_axes_are_kept(d, fitted, random_spd):
    """Images have the axes of what is mapped, to rounding."""
    points = random_spd(np.random.default_rng(8), 50, d)
    assert commutator(fitted[d].transform(points), points) < 1e-14


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_images_are_positive_definite_at_every_scale(scale, domains, fitted, random_spd):
    """Whatever the size of what is mapped, needles and singular ones with damping included, its image is SPD."""
    points = scale * random_spd(np.random.default_rng(9), 30, 3, 1e6)
    spd.logm(fitted[3].transform(points))
    lossy = mp.LengthsField(damping=0.01, projector=bounded, n_centers=40).fit(*domains[3])
    needle = np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    spd.logm(lossy.transform(np.concatenate([points, scale * np.array([needle, np.diag([0.0, 1.0, 0.0])])])))


def test_turned_axes_come_nearer_to_what_is_turned(turning):
    """Every round brings the images nearer to ellipsoids that are turned, those that turn the axes, too."""
    assert np.all(np.diff(turning.history_) < 0.0)


def test_what_is_nearly_right_is_hardly_turned(domains, turning):
    """Of a small gap that the lengths leave the turns take a smaller share than of a large one."""
    shares = []
    for adapter in (turned_toward(domains, 0.01), turning):
        left, turned = adapter.history_[adapter.n_rounds], adapter.cost_
        shares.append(1.0 - turned / left)
    assert 0.0 < shares[0] < 0.5 * shares[1]


def test_turns_are_fitted_to_more_samples_and_leave_the_lengths(domains):
    """What turns is also asked for samples that the lengths have not seen, and the lengths are those without turns.

    It has two of three of their centres.
    """
    asked = []

    def projector(points):
        asked.append(len(points))
        return bounded(points)

    plain, turned = (
        mp.LengthsField(projector=projector, n_samples=100, n_centers=40, turn=turn).fit(*domains[3])
        for turn in (False, True)
    )
    assert sorted(set(asked)) == [18, 32, 100]  # set apart, for turns alone, for both
    assert_array_equal(turned.lengths_, plain.lengths_)
    assert len(turned.turns_) == 27


def test_far_from_the_samples_it_is_the_map_without_a_field(domains, fitted, turning):
    """Eight dispersions from the samples and farther the field is nothing."""
    far = np.exp(8.0 * fitted[3].student_dispersion_) * domains[3][0]
    s, middles = fitted[3].dispersion_ratio_, [fitted[3].teacher_mean_, fitted[3].student_mean_]
    k = np.exp((np.linalg.slogdet(middles[1])[1] - s * np.linalg.slogdet(middles[0])[1]) / 3)
    for adapter in (fitted[3], turning):
        assert_allclose(adapter.transform(far), k * spd.power(far, s), rtol=1e-12)


def test_volumes_of_the_means_agree_before_the_field(domains):
    """Where nothing is asked of the lengths, the mean of the images has the volume of the student's mean."""
    adapter = mp.LengthsField(projector=lambda points: points * 1.0).fit(*domains[3])
    images = adapter.transform(domains[3][0])
    assert np.linalg.det(spd.mean(images)) == pytest.approx(np.linalg.det(adapter.student_mean_), rel=1e-9)
    assert adapter.report_.moved < 1e-12
    assert adapter.report_.singular_value == pytest.approx(1.0)


@sizes
def test_inverse_undoes_the_map(d, fitted, random_spd):
    """Where the derivative is far from singular, the inverse gives back what was mapped to 1e-9."""
    adapter, points = fitted[d], random_spd(np.random.default_rng(10), 40, d, 30.0)
    points = points[adapter.singular_values(points) >= 0.15]
    assert len(points) > 20
    assert spd.distance(adapter.inverse_transform(adapter.transform(points)), points).max() < 1e-9


def test_inverse_undoes_the_map_with_turn_damping_and_mounting(domains, turning, random_rotation, random_singular):
    """Also where axes turn, and where damping was added and taken off in another frame."""
    points = domains[3][0]
    assert spd.distance(turning.inverse_transform(turning.transform(points)), points).max() < 1e-9
    turn = random_rotation(np.random.default_rng(0), 3)
    adapter = mp.LengthsField(damping=0.05, mounting=turn, projector=lambda p: 1.1 * p, n_centers=20).fit(*domains[3])
    flat = random_singular(np.random.default_rng(1), 20, 3)
    assert_allclose(adapter.inverse_transform(adapter.transform(flat)), flat, atol=1e-9)


def test_folds_are_told_at_the_query(domains):
    """A field that pulls all ellipsoids to one shape folds: singular values say so, and the inverse is refused."""
    shape = np.diag([1.0, 2.0, 4.0])
    adapter = mp.LengthsField(
        projector=lambda p: shape * (1.0 + 1e-9 * p[:, :1, :1]), n_centers=100, width=0.3, ridge=1e-9
    ).fit(*domains[3])
    points = domains[3][0]
    assert adapter.report_.folded > 0.1
    assert not adapter.report_.invertible
    with pytest.raises(NotInvertibleError, match=r"folds at \d+% of its centers, more than 2%"):
        adapter.inverse_transform(adapter.transform(points[:2]))
    assert Inverse.of(adapter._field()).folded > MOST_FOLDED


def fold_between_centers():
    """A map of 2×2 ellipsoids that turns left into right beside its one center and at no center."""
    none = np.zeros((1, 3))
    return LengthsMap(1.0, 0.0, 0.0, 0.5, none, np.array([[1.5, 0.0, 0.0]]), none[:0], NO_AXIS)


def test_no_second_origin_is_taken_for_the_only_one():
    """Where several ellipsoids have one image, none of them is told; elsewhere the right one."""
    field = fold_between_centers()
    times = np.linspace(-3.0, 3.0, 200)
    points = spd.expm(times[:, None, None] * np.eye(2) + np.diag([0.1, -0.1]))
    assert field.singular_values(points).min() < 0.0
    images = field.apply(points)
    back = Inverse.of(field)(images)
    told = np.isfinite(back[:, 0, 0])
    assert spd.distance(back[told], points[told]).max() < 1e-9
    # what has the same image differs in volume only, and so lies on the same line
    heights = np.linalg.slogdet(images)[1]
    crossings = np.array([np.count_nonzero(np.diff(np.sign(heights - height))) for height in heights])
    assert np.sum(crossings > 2) > 20
    assert not np.any(told & (crossings > 2))
    assert told.sum() > 100


def test_ellipsoids_where_the_map_folds_are_named(domains, monkeypatch):
    """The inverse names the first of them and how many there are."""
    adapter = mp.LengthsField(projector=bounded, n_centers=40).fit(*domains[2])
    field = fold_between_centers()
    monkeypatch.setattr(adapter, "_field", lambda: field)
    folded = spd.expm(np.array([-2.0, 0.45, 0.5])[:, None, None] * np.diag([1.0, 0.9]))
    with pytest.raises(NotInvertibleError, match=r"points\[1\] lies where the map folds .* 2 of 3 do"):
        adapter.inverse_transform(field.apply(folded))


@sizes
def test_derivative_agrees_with_finite_differences(d, fitted, random_spd):
    """The slopes of log f by log F₀ are those of differences, at equal eigenvalues too."""
    field, rng = fitted[d]._field(), np.random.default_rng(11)
    points = np.concatenate([random_spd(rng, 4, d), np.eye(d)[None] * 1.3])
    check_slopes(field, spd.to_vector(field.power * spd.logm(points) + field.shift * np.eye(d)))


def test_derivative_of_the_turning_field_agrees_with_finite_differences(turning, random_spd):
    """The same where axes turn."""
    field = turning._field()
    check_slopes(field, spd.to_vector(field.power * spd.logm(random_spd(np.random.default_rng(12), 4, 3))))


def check_slopes(field, x):
    """Compare slopes at vectors (n, D) with central differences."""

    def logarithms(vectors):
        return spd.to_vector(field.logarithms(*np.linalg.eigh(spd.from_vector(vectors))))

    step = 1e-5 * np.eye(x.shape[1])
    wanted = np.stack([(logarithms(x + e) - logarithms(x - e)) / 2e-5 for e in step], axis=-1)
    assert_allclose(field.slopes(*np.linalg.eigh(spd.from_vector(x))), wanted, atol=1e-7)


def test_it_is_smooth_where_eigenvalues_are_equal(fitted):
    """Along a path through a ball second differences of the image shrink fourfold with half the step."""

    def roughest(step):
        times = np.arange(-0.2, 0.2, step)
        path = np.eye(3) * np.exp(np.stack([times, -times, 0.0 * times], axis=-1))[:, :, None]
        path[:, 0, 1] = path[:, 1, 0] = 0.3 * times
        return np.abs(np.diff(fitted[3].transform(path), 2, axis=0)).max()

    assert roughest(0.002) / roughest(0.001) == pytest.approx(4.0, rel=0.1)


def test_turning_both_bodies_turns_the_map_and_units_only_scale_it(domains, random_rotation, random_spd):
    """The map commutes with one rotation of both domains, and with with other units of either side."""
    rng = np.random.default_rng(13)
    turn, new = random_rotation(rng, 3), random_spd(rng, 20, 3)
    teacher, student = domains[3]
    options = {"damping": 0.02, "n_centers": 30}
    plain = mp.LengthsField(**options).fit(teacher, student)
    turned = mp.LengthsField(**options).fit(turn @ teacher @ turn.T, turn @ student @ turn.T)
    image = plain.transform(new)
    assert_allclose(turned.transform(turn @ new @ turn.T), turn @ image @ turn.T, atol=1e-7 * np.abs(image).max())
    scaled = mp.LengthsField(**options).fit(5.0 * teacher, 0.3 * student)
    assert_allclose(scaled.transform(5.0 * new), 0.3 * image, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("epsilon", [1e-6, 1.0, 1e4])
def test_release_of_the_damping_undoes_it(epsilon, domains, random_spd):
    """What the map releases is what `damped` adds; of what carries the damping nearly all of it comes off."""
    field = mp.LengthsField(projector=lambda p: p * 1.0).fit(*domains[3])._field()
    values = epsilon * np.logspace(-6, 6, 25)
    images = field.apply(np.eye(3) * values[:, None, None], epsilon)
    plain = field.apply(np.eye(3) * values[:, None, None])
    assert_allclose(damped(images, epsilon), plain, rtol=3e-14)
    above = plain[:, 0, 0] > epsilon
    lost = (plain - images)[above, 0, 0] / epsilon
    assert np.all((lost > 1.0 - np.sqrt(KAPPA)) & (lost < 1.0 - KAPPA + 1e-9))


def test_it_keeps_what_it_tells_in_files(domains, fitted, turning, tmp_path):
    """A saved field maps, inverts and reports the same, bit by bit; a damaged report is refused by name."""
    path = tmp_path / "adapter.npz"
    for adapter in (fitted[3], turning):
        adapter.save(path)
        loaded, points = mp.load_adapter(path), domains[3][0]
        assert loaded.projector is None
        assert loaded.report_ == adapter.report_
        assert_array_equal(loaded.transform(points), adapter.transform(points))
        assert_array_equal(loaded.inverse_transform(points[:5]), adapter.inverse_transform(points[:5]))
    arrays = load_arrays(path, "adapter file")
    text = str(arrays["adapter"]).replace('"gap"', '"hole"')
    save_arrays(path, {**arrays, "adapter": np.array(text)})
    with pytest.raises(FileFormatError, match=r"damaged adapter file.*hole"):
        mp.load_adapter(path)


@sizes
def test_compiled_field_is_transform(d, domains, fitted):
    """One at a time, into a new array or its own, the field gives what `transform` gives."""
    teacher, student = domains[d]
    turn = np.linalg.qr(np.random.default_rng(d).standard_normal((d, d)))[0] if d != 6 else np.eye(6)
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    mounted = mp.LengthsField(damping=0.01, mounting=turn, projector=bounded, n_centers=20).fit(teacher, student)
    for adapter in (fitted[d], mounted):
        compiled, wanted = adapter.compiled(), adapter.transform(teacher)
        for point, image in zip(teacher[:20], wanted, strict=False):
            own = point.copy()
            assert_allclose(compiled(own, own), image, rtol=1e-9, atol=1e-12 * np.abs(image).max())
    floored = mp.LengthsField(floor=0.5, projector=bounded, n_centers=20).fit(teacher, student)
    one_by_one = np.array([floored.compiled()(point) for point in teacher[:20]])
    assert_allclose(one_by_one, floored.transform(teacher[:20]), rtol=1e-9, atol=1e-12)
    with pytest.raises(NotSPDError, match="positive-definite"):
        compiled(-np.eye(d))
    with pytest.raises(InvalidInputError, match="C-contiguous"):
        compiled(np.eye(d + 1))


def test_novelty_tells_where_no_sample_is(domains, fitted):
    """It is next to nothing at the centres and one far away; between nothing and one elsewhere."""
    adapter, (teacher, _) = fitted[3], domains[3]
    centers = spd.expm(
        (spd.from_vector(adapter.centers_) - adapter._field().shift * np.eye(3)) / adapter._field().power
    )
    assert adapter.novelty(centers).max() < 1e-4
    assert_allclose(adapter.novelty(1e9 * teacher), 1.0)
    assert 0.0 < adapter.novelty(teacher).max() < 1.0


def test_every_center_is_the_farthest_from_those_before():
    """The first lies in the middle of the samples; each later one is the sample that is farthest from all before."""
    x = np.random.default_rng(11).standard_normal((60, 6)) + 2.0
    chosen = centers_among(x, 12)
    assert chosen[0] == np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1))
    for count in range(1, 12):
        assert chosen[count] == np.argmax(cdist(x, x[chosen[:count]]).min(axis=1))


def test_two_halves_agree_where_the_student_is_simple(domains):
    """With `halves`, two fits to half of the samples each are compared; without, nothing is said of them."""
    report = mp.LengthsField(projector=bounded, n_centers=40, halves=True).fit(*domains[3]).report_
    assert 0.0 < report.agreement < 1.0
    assert "half-fits" in report.in_words()


def test_the_halves_share_no_sample_and_leave_none_out(domains):
    """Where the rounds begin, the two half-fits ask together for just the images that the whole fit asks for."""
    asked = []
    mp.LengthsField(projector=lambda points: bounded(asked.append(points) or points), n_centers=40, halves=True).fit(
        *domains[3]
    )
    whole, halves = asked[0], [points for points in asked if len(points) == len(asked[0]) // 2]
    both = np.concatenate([halves[0], halves[len(halves) // 2]])
    assert_allclose(np.sort(np.linalg.det(both)), np.sort(np.linalg.det(whole)), rtol=1e-12)


class Searching:
    """A made-up student that remembers nothing, and can move its ellipsoids' first two lengths but not the third."""

    def __init__(self, ways=None):
        self.ways, self.epsilons = ways, []

    def search(self, damping):
        """Begin a search."""
        self.epsilons.append(damping)
        return self

    def nearest(self, points, neighbors=None):
        """Return those of bounded lengths, and the ways."""
        ways = np.eye(3)[:2, :, None] * np.eye(3)[:2, None] if self.ways is None else self.ways
        return bounded(points), np.broadcast_to(ways, (len(points), *np.shape(ways)))


def test_a_projector_that_searches_is_told_the_damping_and_asked_for_ways(domains):
    """It gets the student's ε, and where the student can move by itself, errors count less: the cost stays larger."""
    searching = Searching()
    adapter = mp.LengthsField(damping=0.01, projector=searching).fit(*domains[3])
    assert set(searching.epsilons) == {adapter.student_damping_}
    free = mp.LengthsField(damping=0.01, projector=bounded).fit(*domains[3])
    assert free.cost_ < adapter.cost_ < 0.5 * adapter.history_[0]


def test_ways_turn_with_the_student(domains, random_rotation):
    """Where both bodies and the ways that the student can move are turned alike, so is the map."""
    turn = random_rotation(np.random.default_rng(12), 3)
    ways = np.eye(3)[:2, :, None] * np.eye(3)[:2, None]
    plain = mp.LengthsField(projector=Searching(ways), n_centers=40).fit(*domains[3])
    turned = mp.LengthsField(projector=Searching(turn @ ways @ turn.T), n_centers=40)
    turned.fit(*(turn @ cloud @ turn.T for cloud in domains[3]))
    teacher = domains[3][0][:20]
    expected = turn @ plain.transform(teacher) @ turn.T
    assert spd.distance(turned.transform(turn @ teacher @ turn.T), expected).max() < 1e-6


def test_a_projector_that_searches_is_told_the_nearest_samples(domains):
    """Beside the images it gets three other samples for each, whose postures may do: those that resemble it most."""
    told = []

    class Remembering(Searching):
        def nearest(self, points, neighbors=None):
            told.append((points, neighbors))
            return super().nearest(points, neighbors)

    mp.LengthsField(projector=Remembering(), n_centers=40).fit(*domains[3])
    images, neighbors = told[0]
    apart = spd.log_euclidean.distance(images[:, None], images) + np.diag(np.full(len(images), np.inf))
    assert_array_equal(neighbors, np.argsort(apart, axis=1)[:, :3])


def test_the_report_says_what_the_field_does(turning, random_spd):
    """Gap, turn of the longest axis, what lengths are moved by, and steps are those of the images."""
    points = random_spd(np.random.default_rng(13), 40, 3, 30.0)
    field, images = turning._field(), turning.transform(points)
    plain = replace(field, lengths=0.0 * field.lengths, turns=field.turns[:0])
    report = reported(field, Samples.of(plain, points, as_projector(bounded), 0.0), points, 0, None)
    gaps = spd.distance(images, bounded(images))
    assert_allclose([report.gap, report.gap_p95], [gaps.mean(), np.percentile(gaps, 95)], rtol=1e-6)
    longest, axes = np.linalg.eigh(images)[1][:, :, -1], np.linalg.eigh(points)[1]
    angles = [np.degrees(np.arccos(np.abs(own.T @ one).max())) for own, one in zip(axes, longest, strict=True)]
    assert report.turn == pytest.approx(np.median(angles), rel=1e-6)
    assert report.turn > 0.1
    assert report.moved == pytest.approx(spd.distance(plain.apply(points), images).mean())
    assert report.singular_value == pytest.approx(turning.singular_values(points).min())


def test_damping_looks_at_each_alone():
    """What is flat is told by its own size: a tiny ellipsoid is damped alike beside a large one and alone."""
    tiny, large = 1e-30 * np.diag([1.0, 2.0, 3.0]), np.diag([1.0, 2.0, 0.0])
    both = damped(np.array([tiny, large]), 0.1)
    assert_array_equal(both, [damped(tiny, 0.1), damped(large, 0.1)])


def test_folds_are_said(fitted):
    """The report says at how many samples the map folds, or that it folds at none."""
    report = fitted[3].report_
    assert "(folds at none)" in replace(report, folded=0.0).in_words()
    assert "(folds at 2.5 %)" in replace(report, folded=0.025).in_words()


@pytest.mark.parametrize(
    ("projector", "error", "words"),
    [
        (3, InvalidInputError, "projector must be callable"),
        (lambda p: p[:-1], InvalidInputError, r"projector\(points\) must have shape"),
        (lambda p: p[:, :2, :2], InvalidInputError, r"projector\(points\) must have shape"),
        (lambda p: -p, NotSPDError, r"projector\(points\)\[0\] is indefinite"),
        (lambda p: p * np.nan, InvalidInputError, r"projector\(points\) must be finite"),
        (lambda p: np.broadcast_to(np.eye(3), p.shape), InvalidInputError, "the same ellipsoid for all"),
        (Searching(np.ones((2, 2, 2))), InvalidInputError, "second of projector.search"),
        (Searching(np.full((1, 3, 3), np.inf)), InvalidInputError, "second of projector.search.* finite"),
    ],
)
def test_bad_projectors_are_refused(projector, error, words, domains):
    """What tells no nearest ellipsoids is refused at the first question by what it said; nothing is fitted."""
    adapter = mp.LengthsField(projector=projector)
    with pytest.raises(error, match=words):
        adapter.fit(*domains[3])
    assert not hasattr(adapter, "lengths_")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"n_centers": 500}, "n_centers must be at most the number of samples, 132; found 500"),
        ({"n_centers": 0}, "n_centers"),
        ({"width": 0.0}, "width"),
        ({"ridge": -1.0}, "ridge"),
        ({"n_rounds": 0}, "n_rounds"),
        ({"n_samples": 1}, "n_samples"),
        ({"turn": "yes"}, "turn"),
        ({"halves": 2}, "halves"),
    ],
)
def test_bad_parameters_are_refused_by_name(options, words, domains):
    """Each names what is wrong with it."""
    with pytest.raises(InvalidInputError, match=words):
        mp.LengthsField(**options).fit(*domains[3])


def test_too_few_samples_are_refused(domains):
    """A field of d×d ellipsoids needs more than d of either side."""
    teacher, student = domains[3]
    with pytest.raises(InvalidInputError, match=r"teacher must hold more than 3 .* found 3"):
        mp.LengthsField().fit(teacher[:3], student)
    with pytest.raises(InvalidInputError, match=r"student must hold more than 3 .* found 2"):
        mp.LengthsField().fit(teacher, student[:2])


def test_a_clone_shares_its_projector(domains):
    """The arm's projector is a parameter that a clone keeps, not a copy; functions too."""
    projector = mp.FeasibleProjector(mp.load_arm("panda"), bank=mp.StartBank.build(mp.load_arm("panda"), 64))
    copy = clone(mp.LengthsField(projector=projector))
    assert copy.projector is projector
    assert "FeasibleProjector('panda'" in repr(copy)
    assert clone(mp.LengthsField(projector=bounded)).projector is bounded


@pytest.mark.parametrize("d", [2, 3])
def test_ellipsoids_too_elongated_for_a_field_are_refused(d, random_spd):
    """Where rounding would lose an image in the fit, an error says so, without a warning or nan."""
    rng = np.random.default_rng(0)
    teacher, student = random_spd(rng, 14, d, 1e6), random_spd(rng, 14, d, 1e12)
    with warnings.catch_warnings(action="error"), pytest.raises(NotSPDError, match=r"singular|ill-conditioned"):
        mp.LengthsField().fit(teacher, student)


def test_images_out_of_range_are_refused():
    """An image that would overflow, and a matrix that rounding has made indefinite, raise instead of becoming inf."""
    plain = LengthsMap(3.0, 0.0, 0.0, 1.0, np.zeros((0, 6)), np.zeros((0, 3)), np.zeros((0, 6)), NO_AXIS)
    assert_allclose(plain.apply(2.0 * np.eye(3)[None]), 8.0 * np.eye(3)[None])
    with pytest.raises(InvalidInputError, match="points have an image with an eigenvalue beyond"):
        plain.apply(1e60 * np.eye(3)[None])
    with pytest.raises(NotSPDError, match="rounding makes them indefinite"):
        plain.apply(np.diag([1.0, 1.0, -1e-20])[None])
