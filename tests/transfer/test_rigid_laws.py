"""Laws of the rigid maps: identity, inverse, equivariance, means and dispersions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from quick_transport import Transport

import maniport as mp
from maniport import spd
from maniport.transfer import Search

seeds = given(seed=st.integers(0, 2**32 - 1))
sizes = pytest.mark.parametrize("d", [2, 3, 6])
rigid = pytest.mark.parametrize("kind", [mp.ParallelTransport, mp.RiemannianICP])


def turned(rotation, points):
    """Build Q X Qᵀ."""
    image = rotation @ points @ rotation.T
    return 0.5 * (image + np.swapaxes(image, -1, -2))


def relative_error(found, wanted):
    """Largest difference of two sets of matrices, each relative to the size of its matrix."""
    return np.max(np.linalg.norm(found - wanted, axis=(-2, -1)) / np.linalg.norm(wanted, axis=(-2, -1)))


def search(kind, **options):
    """Make an adapter; ICP with a seed and few rivals, and neither with what it tells of the clouds."""
    if kind is mp.ParallelTransport:
        return Transport(**options)
    return kind(search=Search(n_starts=2), random_state=0, **options)


@sizes
@rigid
@pytest.mark.parametrize("damping", [None, 0.01])
def test_other_base_frame_of_the_student(kind, d, damping, random_spd, random_rotation):
    """Turning the student's base frame by Q, with a base_rotation of Q R_b, turns every result by Q."""
    rng = np.random.default_rng(d)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    base_rotation, q = random_rotation(rng, d), random_rotation(rng, d)
    plain = search(kind, damping=damping, base_rotation=base_rotation).fit(teacher, student)
    other = search(kind, damping=damping, base_rotation=q @ base_rotation).fit(teacher, turned(q, student))
    assert relative_error(other.transform(new), turned(q, plain.transform(new))) < 1e-8


@sizes
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("adapter", [Transport(), mp.RiemannianICP(search=Search(n_starts=0))], ids=["pt", "icp"])
def test_common_congruence(adapter, d, seed, random_spd):
    """Congruence of all data by C is congruence of all results: f'(C T Cᵀ) = C f(T) Cᵀ.

    This holds without a known base orientation, regularization and rival starts: these are not carried along by C.
    """
    rng = np.random.default_rng(seed)
    teacher, student, new = (random_spd(rng, n, d) for n in (20, 25, 5))
    c = np.eye(d) + 0.3 * rng.standard_normal((d, d))
    wanted = turned(c, adapter.fit(teacher, student).transform(new))
    adapter.fit(turned(c, teacher), turned(c, student))
    assert relative_error(adapter.transform(turned(c, new)), wanted) < 1e-7


# ---- what parallel transport does ---------------------------------------------------------------------------------


@sizes
@seeds
@pytest.mark.parametrize("kind", ["mean", "rms"])
def test_mean_and_dispersion_arrive(d, kind, seed, random_spd):
    """The mapped training set has the student's mean and the student's dispersion."""
    rng = np.random.default_rng(seed)
    teacher, student = random_spd(rng, 20, d), random_spd(rng, 25, d, 1e3)
    adapter = Transport(dispersion=kind).fit(teacher, student)
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
    adapter = Transport().fit(teacher, student)
    start, end = spd.mean(teacher), spd.mean(student)
    moved, moved_new = (
        spd.transport(points, start, end) for points in (teacher, new)
    )  # E X Eᵀ, of points as of tangents
    recentered = spd.whiten(moved_new, spd.mean(moved))
    wanted = spd.unwhiten(spd.powm(recentered, adapter.dispersion_ratio_), spd.mean(student))
    assert relative_error(adapter.transform(new), wanted) < 1e-8


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
