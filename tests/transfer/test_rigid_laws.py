"""Laws of the rigid maps: equivariance, means and dispersions; damping and its release."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.spd.kernels import congruence, release
from maniport.spd.kernels.loops import KAPPA
from maniport.spd.regularization import damped_again
from maniport.transfer.rigid_adapter import recenter

seeds = given(seed=st.integers(0, 2**32 - 1))
sizes = pytest.mark.parametrize("d", [2, 3, 6])


def relative_error(images, expected):
    """Largest difference of two sets of matrices, each relative to the size of its matrix."""
    return np.max(
        np.linalg.norm(images - expected, axis=(-2, -1)) / np.linalg.norm(expected, axis=(-2, -1))
    )


@sizes
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "adapter",
    [mp.ParallelTransport(), mp.ScaledTransport(), mp.RiemannianICP(n_starts=0)],
    ids=["pt", "scaled", "icp"],
)
def test_common_congruence(adapter, d, seed, random_spd):
    """Congruence of all data by C is congruence of all results: f'(C T Cᵀ) = C f(T) Cᵀ."""
    rng = np.random.default_rng(seed)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    c = np.eye(d) + 0.3 * rng.standard_normal((d, d))
    expected = congruence(c, adapter.fit(teacher, student).transform(new))
    adapter.fit(congruence(c, teacher), congruence(c, student))
    assert relative_error(adapter.transform(congruence(c, new)), expected) < 1e-7


@sizes
@seeds
def test_mean_and_dispersion_arrive(d, seed, random_spd):
    rng = np.random.default_rng(seed)
    teacher = random_spd(rng, 20, d)
    student = random_spd(rng, 25, d, 1e3)
    adapter = mp.ScaledTransport().fit(teacher, student)
    images = adapter.transform(teacher)
    assert spd.distance(spd.mean(images), spd.mean(student)) < 1e-8
    assert spd.dispersion(images) == pytest.approx(spd.dispersion(student), rel=1e-8)
    assert adapter.dispersion_ratio_ == pytest.approx(
        adapter.student_dispersion_ / adapter.teacher_dispersion_
    )


@sizes
@seeds
def test_closed_form_equals_the_paper_s_transport(d, seed, random_spd):
    rng = np.random.default_rng(seed)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    start = spd.mean(teacher)
    end = spd.mean(student)
    moved, moved_new = (
        spd.transport(points, start, end) for points in (teacher, new)
    )  # E X Eᵀ, of points as of tangents
    plain = mp.ParallelTransport().fit(teacher, student)
    assert plain.dispersion_ratio_ == 1.0
    assert relative_error(plain.transform(new), moved_new) < 1e-8
    assert relative_error(plain.inverse_transform(moved_new), new) < 1e-8
    adapter = mp.ScaledTransport().fit(teacher, student)
    recentered = recenter(moved_new, spd.mean(moved), adapter.dispersion_ratio_)
    expected = congruence(spd.powm(spd.mean(student), 0.5), recentered)
    assert relative_error(adapter.transform(new), expected) < 1e-8


@sizes
@seeds
def test_parallel_transport_preserves_distances_and_finds_the_mounting(d, seed, random_spd):
    rng = np.random.default_rng(seed)
    teacher = random_spd(rng, 20, d)
    student = random_spd(rng, 25, d, 1e3)
    images = mp.ParallelTransport().fit(teacher, student).transform(teacher)
    assert_allclose(
        spd.distance(images[1:], images[:-1]), spd.distance(teacher[1:], teacher[:-1]), rtol=1e-6
    )
    turn = np.linalg.qr(rng.standard_normal((d, d)))[0]
    turn[0] *= np.linalg.det(turn)
    mounted = congruence(turn, teacher)
    for kind in (mp.ParallelTransport, mp.ScaledTransport):
        adapter = kind(base_rotation=turn).fit(teacher, mounted)
        assert relative_error(adapter.transform(teacher), mounted) < 1e-8


@seeds
def test_released_damping_is_added_again(seed, random_singular):
    rng = np.random.default_rng(seed)
    domain = random_singular(rng, 30, 3)
    student = 3.0 * random_singular(rng, 40, 3)
    adapter = mp.ParallelTransport(damping=10 ** rng.uniform(-4, 0)).fit(domain, student)
    images = adapter.transform(domain)
    plain = adapter._map(adapter.teacher_side(domain))
    assert np.linalg.eigvalsh(images).min() > 0.0
    assert_allclose(damped_again(images, adapter.student_damping_), plain, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("epsilon", [1e-6, 1.0, 1e4])
def test_nearly_all_damping_is_released(epsilon):
    values = epsilon * np.logspace(0.001, 6, 25)
    images = release(np.eye(3) * values[:, None, None], epsilon)
    assert_allclose(damped_again(images, epsilon)[:, 0, 0], values, rtol=3e-14)
    lost = (values - images[:, 0, 0]) / epsilon
    assert np.all((lost > 1.0 - np.sqrt(KAPPA)) & (lost < 1.0 - KAPPA + 1e-9))
