"""ICP between clouds with a part in common, noise and outliers, and between separate samples of one arm."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.report import report_of
from maniport.spd.kernels import power_congruence, roots
from maniport.transfer.icp.congruence import geometric_median
from maniport.transfer.icp.energy import EnergyDistance
from maniport.transfer.icp.pairs import Factors, fit_pairs, residuals_of
from maniport.transfer.rotation_group import rotation_from_vector

RECOVERED = 0.15

pytestmark = pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")


@pytest.fixture
def ellipsoids():
    """Make n ellipsoids of size d: the Panda's, or random ones."""
    panda = mp.load_arm("panda")

    def make(rng, n, d):
        if d != 3:
            return spd.expm(spd.from_vector(rng.standard_normal((n, d * (d + 1) // 2))))
        return panda.manipulability(panda.sample(n, rng, sequence="uniform"))

    return make


def outliers(rng, count):
    factor = rng.standard_normal((count, 3, 7)) * np.array([0.5, 0.4, 0.2])[:, None]
    return factor @ np.swapaxes(factor, 1, 2)


def error(adapter, truth, new):
    distances = spd.distance(adapter.transform(new), truth.apply(new))
    return np.sqrt(np.mean(distances**2))


@pytest.mark.parametrize(
    ("d", "n", "m", "common", "noise"),
    [
        (3, 100, 100, 70, 0.0),
        (3, 100, 100, 50, 0.05),
        (3, 60, 100, 60, 0.0),
        (3, 100, 60, 60, 0.0),
        (3, 100, 100, 100, 0.1),
        (2, 100, 100, 70, 0.0),
        (6, 60, 60, 42, 0.0),
    ],
)
def test_clouds_with_a_part_in_common(d, n, m, common, noise, ellipsoids, random_map):
    rng = np.random.default_rng([d, n, m])
    points = ellipsoids(rng, n + m - common, d)
    new = ellipsoids(rng, 20, d)
    truth = random_map(rng, points)
    student = truth.apply(np.concatenate([points[:common], points[n:]]))
    vectors = noise * rng.standard_normal((m, d * (d + 1) // 2))
    root = spd.powm(student, 0.5)
    student = root @ spd.expm(spd.from_vector(vectors)) @ root

    adapter = mp.RiemannianICP().fit(points[:n], rng.permutation(student))
    assert error(adapter, truth, new) < (RECOVERED if noise else 0.02)
    assert adapter.criterion_ == "pairs"
    assert 0.8 * common <= adapter.n_pairs_ <= 1.1 * common
    assert adapter.overlap_ == adapter.n_pairs_ / min(n, m)
    pairs = next(metric for metric in report_of(adapter).metrics if metric.key == "n_pairs")
    assert pairs.value == adapter.n_pairs_


@pytest.mark.parametrize("shares", [(0.0, 0.3), (0.3, 0.0), (0.3, 0.3)])
def test_outliers(shares, ellipsoids, random_map):
    rng = np.random.default_rng(4)
    points = ellipsoids(rng, 100, 3)
    new = ellipsoids(rng, 20, 3)
    truth = random_map(rng, points)
    clouds = [points, truth.apply(points)]
    for cloud, share in zip(clouds, shares, strict=True):
        count = round(share * len(cloud))
        cloud[rng.choice(len(cloud), count, replace=False)] = outliers(rng, count)

    adapter = mp.RiemannianICP().fit(clouds[0], rng.permutation(clouds[1]))
    assert error(adapter, truth, new) < RECOVERED
    printed = mp.RiemannianICP(criterion="correspondence")
    assert error(printed.fit(clouds[0], clouds[1]), truth, new) > RECOVERED


def test_exact_copies_need_no_pairs(ellipsoids, random_map):
    rng = np.random.default_rng(0)
    points = ellipsoids(rng, 100, 3)
    truth = random_map(rng, points)
    student = rng.permutation(truth.apply(points))
    adapter = mp.RiemannianICP().fit(points, student)
    printed = mp.RiemannianICP(criterion="correspondence").fit(points, student)
    assert adapter.criterion_ == "correspondence"
    assert adapter.n_pairs_ is None
    assert np.array_equal(adapter.transform(points), printed.transform(points))


@pytest.mark.parametrize(("axis", "degrees"), [("x", 40.0), ("y", 150.0)])
def test_tilt_between_separate_samples_of_one_arm(axis, degrees):
    panda = mp.load_arm("panda")
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    teacher = mp.sample_domain(panda, 1024, 0)
    student = mp.sample_domain(panda, 1024, 1)
    adapter = mp.RiemannianICP(damping=0.01).fit(teacher, turn @ student @ turn.T)
    cosine = abs(adapter.map_rotation_[:, 2] @ turn[:, 2])  # half turns leave the domain as it is
    assert np.degrees(np.arccos(min(1.0, cosine))) < 10.0
    assert adapter.criterion_ == "energy"
    assert not adapter.start_kept_
    assert adapter.cost_ == adapter.history_[-1] < adapter.history_[0]


def test_separate_samples_have_no_pairs_that_agree(ellipsoids):
    rng = np.random.default_rng(1)
    adapter = mp.RiemannianICP(damping=0.01, base_rotation=np.eye(3))
    adapter.fit(ellipsoids(rng, 200, 3), ellipsoids(rng, 200, 3))
    assert adapter.criterion_ == "correspondence"
    assert adapter.n_pairs_ is None


@pytest.mark.parametrize("d", [2, 3, 6])
def test_derivatives_of_pairs(d, random_spd):
    rng = np.random.default_rng(d)
    teacher = random_spd(rng, 4, d, 4.0)
    whitening = roots(random_spd(rng, 4, d, 4.0))[1]
    middle = random_spd(rng, 2, d, 4.0)
    factors = Factors(middle[0], 0.7, middle[1])
    derivatives = residuals_of(factors, teacher, whitening).derivatives
    step = 1e-5
    changes = []
    for sign in (1.0, -1.0):
        other = factors._replace(ratio=factors.ratio + sign * step)
        changes.append(residuals_of(other, teacher, whitening).vectors)
    expected = (changes[0] - changes[1]) / (2.0 * step)
    assert_allclose(derivatives[:, :, -1], expected, atol=1e-5)

    place = d * (d + 1) // 2 + 1  # B ← B (I + E), E = e₁ e₂ᵀ
    changes = []
    for sign in (1.0, -1.0):
        change = np.eye(d)
        change[0, 1] = sign * step
        other = factors._replace(right=factors.right @ change)
        changes.append(residuals_of(other, teacher, whitening).vectors)
    expected = (changes[0] - changes[1]) / (2.0 * step)
    assert_allclose(derivatives[:, :, place], expected, atol=1e-5)


def test_fit_to_pairs_finds_the_map(random_spd, random_map):
    rng = np.random.default_rng(3)
    teacher = random_spd(rng, 30, 3)
    truth = random_map(rng, teacher)
    start = (
        truth.factors[0],
        1.0,
        truth.factors[2] @ rotation_from_vector(np.array([0.3, 0.2, 0.1])),
    )
    found, distances = fit_pairs(Factors(*start), teacher, truth.apply(teacher), np.ones_like, 50)
    assert distances.max() < 1e-9
    rigid = found.rigid()
    assert_allclose(np.linalg.det(rigid.rotation), 1.0)
    expected = power_congruence(found.left, teacher, found.ratio, found.right)
    assert_allclose(rigid.apply(teacher), expected, rtol=1e-9)


@pytest.mark.parametrize("d", [2, 3, 4])
def test_gradient_of_the_energy_distance(d, random_spd, random_rotation):
    rng = np.random.default_rng(d)
    energy = EnergyDistance(random_spd(rng, 30, d), random_spd(rng, 40, d))
    rotation = random_rotation(rng, d)
    _, gradient, slope = energy.derivatives(rotation, 1.2)
    step = 1e-3  # distances are in single precision
    for place, direction in enumerate(np.eye(len(gradient))):
        ends = []
        for sign in (1.0, -1.0):
            turned = rotation_from_vector(sign * step * direction) @ rotation
            ends.append(energy.value(turned, 1.2))
        assert gradient[place] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=5e-3)
    ends = [energy.value(rotation, 1.2 + sign * step) for sign in (1.0, -1.0)]
    assert slope == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=5e-3)


def test_geometric_median_resists_outliers(random_spd):
    rng = np.random.default_rng(2)
    points = random_spd(rng, 100, 3)
    center = spd.mean(points)
    points[:30] *= 1e6
    moved = spd.distance(center, geometric_median(points))
    assert moved < 0.5 * spd.distance(center, spd.mean(points))


def test_half_turns_of_the_panda_are_open():
    panda = mp.load_arm("panda")
    adapter = mp.RiemannianICP(damping=0.01)
    adapter.fit(mp.sample_domain(panda, 1024, 0), mp.sample_domain(panda, 1024, 1))
    horizontal = np.abs(adapter.half_turns_[:, :2]).max(axis=1) > 0.9
    assert horizontal.sum() >= 2
    before = adapter.half_turn_distances_[0]
    assert_allclose(adapter.half_turn_distances_[1:], before, rtol=2e-3)


def test_half_turns_of_random_covariance_are_excluded():
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((6, 6)) / np.sqrt(6.0)
    points = spd.expm(spd.from_vector(rng.standard_normal((400, 6)) @ mixing.T))
    adapter = mp.RiemannianICP().fit(points[:200], points[200:])
    assert len(adapter.half_turns_) == 0
