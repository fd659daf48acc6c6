"""What the domains say about the rotation: flat axes, curvature and the comparison of two rotations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from maniport import load_arm, sample_domain, spd
from maniport.bodies import Arm
from maniport.errors import IdentifiabilityWarning
from maniport.transfer import RiemannianICP
from maniport.transfer.cloud_pair import CloudPair
from maniport.transfer.identifiability import identify
from maniport.transfer.rigid_adapter import recentre, transport_rotation

FRAME = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def damped(points):
    """Add a hundredth of the mean axis."""
    return points + 0.01 * np.trace(points.mean(axis=0)) / 3.0 * np.eye(3)


def recentred(teacher, student):
    """Both clouds about the identity, the teacher dilated, the student's mean and the transport rotation."""
    center_t, center_s = spd.mean(teacher), spd.mean(student)
    ratio = spd.dispersion(student, center_s) / spd.dispersion(teacher, center_t)
    start = transport_rotation(center_t, center_s)
    return recentre(teacher, center_t, ratio), recentre(student, center_s), center_s, start


def made_up(seed, n):
    """Two draws of a domain without any symmetry: log-vectors of a random covariance."""
    random = np.random.default_rng(seed)
    vectors = random.standard_normal((2 * n, 6)) @ (random.standard_normal((6, 6)) / np.sqrt(6.0)).T
    points = spd.expm(spd.from_vector(vectors))
    return points[:n], points[n:]


def planar(base=None):
    """An arm of two links of one metre."""
    return Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]], base=base)


# ---- distances between clouds -----------------------------------------------------------------------------------


def test_distances_equal_scipys(random_spd, random_rotation):
    """Mean distances equal those of SciPy's matrix of distances between the logarithms, after turning."""
    random = np.random.default_rng(0)
    teacher, student, turn = random_spd(random, 30, 3), random_spd(random, 40, 3), random_rotation(random, 3)
    vectors = [spd.to_vector(spd.logm(cloud)) for cloud in (student, turn @ teacher @ turn.T)]
    expected = cdist(*vectors)
    to_teachers, to_students = CloudPair(teacher, student).distances(turn)
    np.testing.assert_allclose(to_teachers, expected.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(to_students, expected.mean(axis=0), rtol=1e-12)


# ---- flat axes ----------------------------------------------------------------------------------------------------


def test_plane_of_a_planar_arm_is_named_for_every_seed():
    """Two planar arms, known mounting: the student's normal is the flat axis, and the only one, for every seed."""
    for seed in range(20):
        teacher = FRAME @ damped(sample_domain(planar(), 256, seed)) @ FRAME.T
        student = damped(sample_domain(planar(FRAME), 256, seed + 100))
        moved, fixed, center, _ = recentred(teacher, student)
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
        moved, fixed, center, start = recentred(*domains)
        found = identify(CloudPair(moved, fixed), start, center)
        assert found.flat.tolist() == [True, False, False]
        assert abs(found.flat_axes[0, 2]) > np.cos(np.deg2rad(5.0))
        assert "the z axis of the student's base" in found.in_words()


@pytest.mark.parametrize("n", [100, 400])
def test_no_false_alarm_without_symmetry(n):
    """A made-up domain without symmetry is called determined for every seed."""
    for seed in range(25):
        moved, fixed, center, start = recentred(*made_up(seed, n))
        found = identify(CloudPair(moved, fixed), start, center)
        assert found.determined, (seed, found.curvature, found.standard_error)
        assert found.in_words() == "the domains determine the rotation in every direction"


def test_flat_axis_turns_with_the_students_base(random_rotation):
    """Where the student's base frame is turned, the named axis turns with it, and the curvature stays."""
    turn = random_rotation(np.random.default_rng(5), 3)
    teacher, student = (damped(sample_domain(planar(), 256, seed)) for seed in (0, 1))
    moved, fixed, center, start = recentred(teacher, student)
    plain = identify(CloudPair(moved, fixed), start, center)
    moved, fixed, center, _ = recentred(teacher, turn @ student @ turn.T)
    other = identify(CloudPair(moved, fixed), turn @ start, center)
    np.testing.assert_allclose(other.curvature, plain.curvature, atol=1e-4)
    assert abs(other.flat_axes[0] @ turn @ plain.flat_axes[0]) > np.cos(np.deg2rad(0.5))


def test_large_sizes_are_not_examined_and_claim_nothing(random_spd):
    """Beyond d = 6 a fit ends soon, says what it left out, and does not call the rotation determined."""
    random = np.random.default_rng(9)
    clouds = [random_spd(random, 40, 8) for _ in range(2)]
    with pytest.warns(IdentifiabilityWarning, match="was not examined, nor rival starts, for d = 8 with its 28 direct"):
        adapter = RiemannianICP(n_resamples=2, random_state=0).fit(*clouds)
    found = adapter.identifiability_
    assert not found.examined
    assert not found.determined
    assert found.directions.shape == (0, 28)
    assert found.resampled.shape == (2, 8, 8)
    assert found.flat_axes.shape == (0, 3)
    assert "not examined" in found._repr_html_()


@pytest.mark.parametrize(("d", "directions"), [(2, 1), (6, 15)])
def test_other_sizes_count_their_directions(d, directions, random_spd):
    """SO(d) has d (d − 1) / 2 directions; axes have names for d = 3 only."""
    random = np.random.default_rng(6)
    clouds = [random_spd(random, 60, d) for _ in range(2)]
    found = identify(CloudPair(*clouds), np.eye(d), np.eye(d))
    assert found.curvature.shape == found.flat.shape == (directions,)
    assert found.axes.shape == (0, 3)
    assert "the domains" in found.in_words()


@pytest.mark.parametrize(
    ("d", "free", "words"),
    [
        (2, [0], "the domains do not determine the rotation"),
        (3, [0], "the domains do not determine the rotation about the x axis of the student's base (0.0° off)"),
        (3, [0, 1, 2], "the domains do not determine the rotation about any axis"),
        (4, [1, 4], "the domains do not determine the rotation in 2 of 6 directions"),
    ],
)
def test_what_is_free_is_said(d, free, words, random_spd):
    """The plane has one direction, which needs no name; axes are named for d = 3; beyond, directions are counted."""
    random = np.random.default_rng(10)
    found = identify(CloudPair(random_spd(random, 10, d), random_spd(random, 10, d)), np.eye(d), np.eye(d))
    m = d * (d - 1) // 2
    said = replace(found, flat=np.isin(np.arange(m), free), axes=np.eye(3) if d == 3 else found.axes)
    assert said.in_words() == words
    assert not said.determined


# ---- optima and resampling ----------------------------------------------------------------------------------------


def test_optima_are_distinct_and_counted(random_spd):
    """Ends of searches within 5° are one optimum with its lowest cost; the best optimum comes first."""
    near = Rotation.from_rotvec([0.02, 0.0, 0.0]).as_matrix()
    far = Rotation.from_rotvec([0.0, 1.0, 0.0]).as_matrix()
    endings = [(far, 0.5), (np.eye(3), 2.0), (near, 1.0)]
    random = np.random.default_rng(7)
    found = identify(
        CloudPair(random_spd(random, 20, 3), random_spd(random, 20, 3)), np.eye(3), np.eye(3), endings
    ).optima
    assert [(one.cost, one.n_starts) for one in found] == [(0.5, 1), (1.0, 2)]
    np.testing.assert_array_equal(found[1].rotation, near)
    assert all(one.cloud_distance >= 0.0 for one in found)


def test_spread_is_the_root_mean_square_angle(random_spd):
    """Resampled rotations 3° and 4° away spread by their root mean square; without any the spread is nan."""
    random = np.random.default_rng(8)
    pair = CloudPair(random_spd(random, 20, 3), random_spd(random, 20, 3))
    turned = [Rotation.from_euler("x", angle, degrees=True).as_matrix() for angle in (3.0, -4.0)]
    assert identify(pair, np.eye(3), np.eye(3), resampled=turned).spread_deg == pytest.approx(np.sqrt(12.5))
    assert np.isnan(identify(pair, np.eye(3), np.eye(3)).spread_deg)
