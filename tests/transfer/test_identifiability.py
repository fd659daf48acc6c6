"""Axes about which the domains leave the rotation free, the warning of a fit, and the test that keeps the start."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.arms import Arm
from maniport.errors import IdentifiabilityWarning
from maniport.transfer.identifiability import CloudPair, free_axes
from maniport.transfer.rigid_adapter import recenter
from maniport.transfer.rotation_group import rotation_angle

FRAME = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def planar(n, seed, base=None):
    return mp.sample_domain(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]], base=base), n, seed)


def axes_between(teacher, student, rotation=None, damping=0.01):
    adapter = mp.ParallelTransport(damping=damping, base_rotation=rotation).fit(teacher, student)
    sides = adapter.teacher_side(teacher), adapter.student_side(student)
    means = adapter.teacher_mean_, adapter.student_mean_
    clouds = map(recenter, sides, means, (adapter.dispersion_ratio_, 1.0))
    return free_axes(CloudPair(*clouds), adapter.rotation_, adapter.student_mean_)


@pytest.fixture(scope="module")
def panda_domains():
    panda = mp.load_arm("panda")
    return [mp.sample_domain(panda, n, seed) for seed, n in enumerate((4096, 16384))]


def test_plane_of_a_planar_arm_is_free_for_every_seed():
    for seed in range(10):
        axes = axes_between(planar(256, seed), planar(256, seed + 100, FRAME), FRAME)
        assert axes.shape == (1, 3)
        assert abs(axes[0, 0]) > np.cos(
            np.deg2rad(1.0)
        )  # the student's links move in its y-z plane


def test_axis_of_the_panda_is_free(panda_domains):
    axes = axes_between(*panda_domains)
    assert axes.shape == (1, 3)
    assert abs(axes[0, 2]) > np.cos(np.deg2rad(5.0))


@pytest.mark.parametrize("n", [100, 400])
def test_no_false_alarm_without_symmetry(n):
    for seed in range(8):
        random = np.random.default_rng(seed)
        vectors = (
            random.standard_normal((2 * n, 6)) @ (random.standard_normal((6, 6)) / np.sqrt(6.0)).T
        )
        points = spd.expm(spd.from_vector(vectors))
        assert len(axes_between(points[:n], points[n:], damping=None)) == 0


def test_free_axis_turns_with_the_students_base(random_rotation):
    turn = random_rotation(np.random.default_rng(5), 3)
    teacher = planar(256, 0)
    student = planar(256, 1)
    plain = axes_between(teacher, student, np.eye(3))
    other = axes_between(teacher, turn @ student @ turn.T, turn)
    assert abs(other[0] @ turn @ plain[0]) > np.cos(np.deg2rad(0.5))


def test_fit_warns_of_the_free_axis_unless_the_base_rotation_is_known():
    teacher = planar(256, 0)
    student = planar(256, 1, FRAME)
    with pytest.warns(IdentifiabilityWarning, match=r"x axis.*base_rotation"):
        mp.RiemannianICP(damping=0.01).fit(teacher, student)
    with warnings.catch_warnings():
        warnings.simplefilter("error", IdentifiabilityWarning)
        mp.RiemannianICP(damping=0.01, base_rotation=FRAME).fit(teacher, student)


@pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")
@pytest.mark.parametrize("frame", [None, np.eye(3)])
def test_identity_test_of_the_panda(panda_domains, frame):
    """Panda to Panda: the defaults change an ellipsoid by at most 0.15 where nothing should change."""
    first = panda_domains[0]
    second = panda_domains[1][:4096]
    adapter = mp.RiemannianICP(damping=0.01, base_rotation=frame).fit(first, second)
    assert np.sqrt(np.mean(adapter.errors(first, first) ** 2)) <= 0.15
    assert adapter.start_kept_


@pytest.mark.filterwarnings("ignore::maniport.errors.IdentifiabilityWarning")
def test_a_wrong_start_does_not_win(panda_domains):
    turn = Rotation.from_euler("x", 30.0, degrees=True).as_matrix()
    first = panda_domains[0]
    second = panda_domains[1][:4096]
    adapter = mp.RiemannianICP(damping=0.01).fit(first, turn @ second @ turn.T)
    assert not adapter.start_kept_
    assert np.rad2deg(rotation_angle(adapter.rotation_, turn)) < 15.0
