"""What the domains say about the rotation: flat axes, curvature and the comparison of two rotations."""

import numpy as np
import pytest

from maniport import load_arm, sample_domain, spd
from maniport.arms import Arm
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.identifiability import identify
from maniport.transfer.rigid_adapter import recenter, transport_rotation

FRAME = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def damped(points):
    """Add a hundredth of the mean axis."""
    return points + 0.01 * np.trace(points.mean(axis=0)) / 3.0 * np.eye(3)


def recentered(teacher, student):
    """Both clouds about the identity, the teacher dilated, the student's mean and the transport rotation."""
    center_t, center_s = spd.mean(teacher), spd.mean(student)
    ratio = spd.dispersion(student, center_s) / spd.dispersion(teacher, center_t)
    start = transport_rotation(center_t, center_s)
    return recenter(teacher, center_t, ratio), recenter(student, center_s), center_s, start


def made_up(seed, n):
    """Two draws of a domain without any symmetry: log-vectors of a random covariance."""
    random = np.random.default_rng(seed)
    vectors = random.standard_normal((2 * n, 6)) @ (random.standard_normal((6, 6)) / np.sqrt(6.0)).T
    points = spd.expm(spd.from_vector(vectors))
    return points[:n], points[n:]


def planar(base=None):
    """An arm of two links of one meter."""
    return Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]], base=base)


# ---- flat axes ----------------------------------------------------------------------------------------------------


def test_plane_of_a_planar_arm_is_named_for_every_seed():
    """Two planar arms with base rotation: the student's normal is the only flat axis, for every seed."""
    for seed in range(20):
        teacher = FRAME @ damped(sample_domain(planar(), 256, seed)) @ FRAME.T
        student = damped(sample_domain(planar(FRAME), 256, seed + 100))
        moved, fixed, center, _ = recentered(teacher, student)
        start = transport_rotation(spd.mean(teacher), center)
        found = identify(CloudPair(moved, fixed), start, center)
        assert found.flat.tolist() == [True, False, False]
        assert abs(found.flat_axes[0, 0]) > np.cos(np.deg2rad(1.0))  # the student's links move in its y-z plane
        assert "the x axis of the student's base" in found.in_words()


def test_axis_of_the_panda_is_named():
    """Between two draws of the Panda's domain the flat axis lies within 5° of the base axis, and is the only one."""
    panda = load_arm("panda")
    for seed in range(3):
        domains = (damped(sample_domain(panda, n, 10 * seed + i)) for i, n in enumerate((4096, 16384)))
        moved, fixed, center, start = recentered(*domains)
        found = identify(CloudPair(moved, fixed), start, center)
        assert found.flat.tolist() == [True, False, False]
        assert abs(found.flat_axes[0, 2]) > np.cos(np.deg2rad(5.0))
        assert "the z axis of the student's base" in found.in_words()


@pytest.mark.parametrize("n", [100, 400])
def test_no_false_alarm_without_symmetry(n):
    """A made-up domain without symmetry is called determined for every seed."""
    for seed in range(25):
        moved, fixed, center, start = recentered(*made_up(seed, n))
        found = identify(CloudPair(moved, fixed), start, center)
        assert found.determined, (seed, found.curvature, found.standard_error)
        assert found.in_words() == "the domains determine the rotation in every direction"


def test_flat_axis_turns_with_the_students_base(random_rotation):
    """Where the student's base frame is turned, the named axis turns with it, and the curvature stays."""
    turn = random_rotation(np.random.default_rng(5), 3)
    teacher, student = (damped(sample_domain(planar(), 256, seed)) for seed in (0, 1))
    moved, fixed, center, start = recentered(teacher, student)
    plain = identify(CloudPair(moved, fixed), start, center)
    moved, fixed, center, _ = recentered(teacher, turn @ student @ turn.T)
    other = identify(CloudPair(moved, fixed), turn @ start, center)
    np.testing.assert_allclose(other.curvature, plain.curvature, atol=1e-4)
    assert abs(other.flat_axes[0] @ turn @ plain.flat_axes[0]) > np.cos(np.deg2rad(0.5))
