"""Laws of the rigid maps: equivariance, means and dispersions; what damping and a floor add, and what is removed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.transfer import Search
from maniport.transfer.adapter import RELEASED
from maniport.transfer.rigid_adapter import RigidMap

seeds = given(seed=st.integers(0, 2**32 - 1))
sizes = pytest.mark.parametrize("d", [2, 3, 6])
rigid = pytest.mark.parametrize("kind", [mp.ParallelTransport, mp.RiemannianICP])


def turned(rotation, points):
    """Build Q X Qᵀ."""
    image = rotation @ points @ rotation.T
    return 0.5 * (image + np.swapaxes(image, -1, -2))


def relative_error(images, expected):
    """Largest difference of two sets of matrices, each relative to the size of its matrix."""
    return np.max(np.linalg.norm(images - expected, axis=(-2, -1)) / np.linalg.norm(expected, axis=(-2, -1)))


def search(kind, **options):
    """Make an adapter; ICP with a seed and few rivals, and neither with what it tells of the clouds."""
    if kind is mp.ParallelTransport:
        return kind(**options).silent()
    return kind(search=Search(n_starts=2), random_state=0, **options)


@sizes
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "adapter", [mp.ParallelTransport().silent(), mp.RiemannianICP(search=Search(n_starts=0))], ids=["pt", "icp"]
)
def test_common_congruence(adapter, d, seed, random_spd):
    """Congruence of all data by C is congruence of all results: f'(C T Cᵀ) = C f(T) Cᵀ.

    This holds without a known base orientation, regularization and rival starts: these are not carried along by C.
    """
    rng = np.random.default_rng(seed)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    c = np.eye(d) + 0.3 * rng.standard_normal((d, d))
    expected = turned(c, adapter.fit(teacher, student).transform(new))
    adapter.fit(turned(c, teacher), turned(c, student))
    assert relative_error(adapter.transform(turned(c, new)), expected) < 1e-7


# ---- what parallel transport does ---------------------------------------------------------------------------------


@sizes
@seeds
@pytest.mark.parametrize("kind", ["mean", "rms"])
def test_mean_and_dispersion_arrive(d, kind, seed, random_spd):
    """The mapped training set has the student's mean and the student's dispersion."""
    rng = np.random.default_rng(seed)
    teacher, student = random_spd(rng, 20, d), random_spd(rng, 25, d, 1e3)
    adapter = mp.ParallelTransport(dispersion=kind).silent().fit(teacher, student)
    images = adapter.transform(teacher)
    assert spd.distance(spd.mean(images), spd.mean(student)) < 1e-8
    assert spd.dispersion(images, kind=kind) == pytest.approx(spd.dispersion(student, kind=kind), rel=1e-8)
    assert adapter.dispersion_ratio_ == pytest.approx(adapter.student_dispersion_ / adapter.teacher_dispersion_)


@sizes
@seeds
def test_closed_form_equals_the_paper_s_transport(d, seed, random_spd):
    """Transport by E, mean-transport with the new mean, dilation and the move to the student's mean give the same."""
    rng = np.random.default_rng(seed)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    adapter = mp.ParallelTransport().silent().fit(teacher, student)
    start, end = spd.mean(teacher), spd.mean(student)
    moved, moved_new = (
        spd.transport(points, start, end) for points in (teacher, new)
    )  # E X Eᵀ, of points as of tangents
    recentered = spd.whiten(moved_new, spd.mean(moved))
    expected = spd.unwhiten(spd.powm(recentered, adapter.dispersion_ratio_), spd.mean(student))
    assert relative_error(adapter.transform(new), expected) < 1e-8


@sizes
@rigid
@pytest.mark.parametrize("remedy", [{}, {"damping": 0.01}])
def test_known_mounting_is_exact(kind, d, remedy, random_spd, random_rotation):
    """Where the student is the teacher in another base frame, that frame as base_rotation gives the exact map."""
    rng = np.random.default_rng(d)
    teacher, new, base_rotation = random_spd(rng, 40, d), random_spd(rng, 5, d), random_rotation(rng, d)
    adapter = search(kind, base_rotation=base_rotation, **remedy).fit(
        teacher, turned(base_rotation, rng.permutation(teacher))
    )
    assert_allclose(adapter.transform(new), turned(base_rotation, new), atol=2e-6 * adapter.student_damping_ + 1e-9)
    assert adapter.errors(new, turned(base_rotation, new)).max() < 1e-8


# ---- damping and floors -------------------------------------------------------------------------------------------


def lowest_image_eigenvalues(rigid, points):
    """Smallest eigenvalue of f(P), from the largest one of its inverse, which rounding does not hide."""
    values, vectors = np.linalg.eigh(rigid.teacher_mean)
    whitening = (vectors / np.sqrt(values)) @ vectors.T
    values, vectors = np.linalg.eigh(whitening @ points @ whitening)
    inverse = (vectors * values[:, None] ** -rigid.ratio) @ np.swapaxes(vectors, -1, -2)
    values, frame = np.linalg.eigh(rigid.student_mean)
    back = (frame / np.sqrt(values)) @ frame.T @ rigid.rotation
    return 1.0 / np.linalg.eigvalsh(back @ inverse @ back.T)[:, -1]


@sizes
@pytest.mark.parametrize("ratio", [0.2, 0.9, 1.0, 1.0 + 1e-12, 1.001, 1.3, 3.0])
@settings(max_examples=5)
@seeds
def test_bound_on_the_lowest_eigenvalue_holds(d, ratio, seed, random_spd, random_rotation):
    """No image of T + ε I has an eigenvalue below the bound, be T random, a needle or zero."""
    rng = np.random.default_rng(seed)
    damping = 10 ** rng.uniform(-6, 0)
    teacher_mean = random_spd(rng, 1, d, 10 ** rng.uniform(0, 3))[0]
    rigid = RigidMap(teacher_mean, random_spd(rng, 1, d)[0], random_rotation(rng, d), ratio)
    directions = rng.standard_normal((200, d))
    needles = directions[:, :, None] * directions[:, None, :] * (damping * 10 ** rng.uniform(-4, 3, (200, 1, 1)))
    shapes = np.concatenate([needles, damping * random_spd(rng, 50, d, 1e4), np.zeros((1, d, d))])
    lowest = lowest_image_eigenvalues(rigid, shapes + damping * np.eye(d))
    bound = rigid.lowest_eigenvalue(damping)
    assert bound > 0
    assert lowest.min() >= bound * (1.0 - 1e-9)
    if ratio <= 1.0:  # then the zero matrix attains it
        assert lowest.min() == pytest.approx(bound, rel=1e-9)


def test_released_damping_is_all_of_it_between_equal_domains(random_singular):
    """Where the domains are equal all but a millionth of the damping comes off again, in the table too."""
    domain = random_singular(np.random.default_rng(0), 30, 3)
    for adapter in (mp.ParallelTransport(damping=0.01), mp.NearestNeighbor(damping=0.01)):
        adapter.fit(domain, domain)
        assert adapter.released_damping_ == pytest.approx(RELEASED * adapter.student_damping_, rel=1e-9)
    for adapter in (mp.ParallelTransport(eigenvalue_floor=1e-3), mp.NearestNeighbor(eigenvalue_floor=1e-3)):
        adapter.fit(domain, domain)
        assert adapter.teacher_damping_ == adapter.student_damping_ == adapter.released_damping_ == 0.0
