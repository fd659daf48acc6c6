"""What the domains tell about the rotation, what a fit warns of, and where the start wins over the search."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport import spd
from maniport.arms import Arm
from maniport.errors import IdentifiabilityWarning
from maniport.transfer.rotation_group import rotation_angle

FRAME = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def planar(n, seed, base=None):
    """Ellipsoids of an arm of two links of one meter."""
    return mp.sample_domain(Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]], base=base), n, seed)


def identified(teacher, student, **options):
    """What parallel transport tells of the domains."""
    return mp.ParallelTransport(**{"damping": 0.01} | options).fit(teacher, student).identifiability_


@pytest.fixture(scope="module")
def panda_domains():
    """Two independent draws of the Panda's domain."""
    panda = mp.load_arm("panda")
    return [mp.sample_domain(panda, n, seed) for seed, n in enumerate((4096, 16384))]


# ---- flat axes ----------------------------------------------------------------------------------------------------


def test_plane_of_a_planar_arm_is_named_for_every_seed():
    """Two planar arms with base rotation: the student's normal is the only flat axis, for every seed."""
    for seed in range(10):
        result = identified(planar(256, seed), planar(256, seed + 100, FRAME), base_rotation=FRAME)
        assert result.flat.tolist() == [True, False, False]
        assert abs(result.flat_axes[0, 0]) > np.cos(np.deg2rad(1.0))  # the student's links move in its y-z plane
        assert "the x axis of the student's base" in result.in_words()


def test_axis_of_the_panda_is_named(panda_domains):
    """Between two draws of the Panda's domain the flat axis lies within 5° of the base axis, and is the only one."""
    result = identified(*panda_domains)
    assert result.flat.tolist() == [True, False, False]
    assert abs(result.flat_axes[0, 2]) > np.cos(np.deg2rad(5.0))
    assert "the z axis of the student's base" in result.in_words()


@pytest.mark.parametrize("n", [100, 400])
def test_no_false_alarm_without_symmetry(n):
    """Two draws of a domain without symmetry, log-vectors of a random covariance, determine all, for every seed."""
    for seed in range(15):
        random = np.random.default_rng(seed)
        vectors = random.standard_normal((2 * n, 6)) @ (random.standard_normal((6, 6)) / np.sqrt(6.0)).T
        points = spd.expm(spd.from_vector(vectors))
        result = identified(points[:n], points[n:], damping=None)
        assert result.determined, (seed, result.curvature, result.standard_error)
        assert result.in_words() == "the domains determine the rotation in every direction"


def test_flat_axis_turns_with_the_students_base(random_rotation):
    """Where the student's base frame is turned, the named axis turns with it, and the curvature stays."""
    turn = random_rotation(np.random.default_rng(5), 3)
    teacher, student = planar(256, 0), planar(256, 1)
    plain = identified(teacher, student, base_rotation=np.eye(3))
    other = identified(teacher, turn @ student @ turn.T, base_rotation=turn)
    np.testing.assert_allclose(other.curvature, plain.curvature, atol=1e-4)
    assert abs(other.flat_axes[0] @ turn @ plain.flat_axes[0]) > np.cos(np.deg2rad(0.5))


def test_fit_names_the_flat_axis_and_what_to_give():
    """Without base_rotation and pairs, `fit` warns and names the axis."""
    teacher, student = planar(256, 0), planar(256, 1, FRAME)
    with pytest.warns(IdentifiabilityWarning, match=r"about the x axis of the student's base.*base_rotation.*pairs"):
        mp.RiemannianICP(damping=0.01).fit(teacher, student)


@pytest.mark.filterwarnings("error::maniport.errors.IdentifiabilityWarning")
def test_fit_is_silent_where_the_mounting_or_pairs_are_known():
    """Who has said what the domains cannot tell is not warned."""
    teacher, student = planar(256, 0), planar(256, 1, FRAME)
    mp.RiemannianICP(damping=0.01, base_rotation=FRAME).fit(teacher, student)
    mp.RiemannianICP(damping=0.01).fit(teacher, student, pairs=(teacher[:3], FRAME @ teacher[:3] @ FRAME.T))


# ---- the start competes with what the search made of it -----------------------------------------------------------


@pytest.mark.parametrize(("n", "allowed"), [(256, 0.1), (1024, 0.01)])
def test_planar_pair_with_known_mounting(n, allowed):
    """Independent samples of the planar pair: the median error over some draws stays below what is promised."""
    errors = []
    for seed in range(5):
        adapter = mp.RiemannianICP(damping=0.01, base_rotation=FRAME).fit(planar(n, seed), planar(n, seed + 100, FRAME))
        new = planar(300, seed + 200)
        errors.append(np.sqrt(np.mean(adapter.errors(new, FRAME @ new @ FRAME.T) ** 2)))
        assert rotation_angle(adapter.rotation_, adapter.start_rotation_) < 1e-6
    assert np.median(errors) < allowed


@pytest.mark.parametrize("frame", [None, np.eye(3)])
def test_identity_test_of_the_panda(panda_domains, frame):
    """Panda to Panda: the defaults change an ellipsoid by at most 0.15 where nothing should change."""
    first, second = panda_domains[0], panda_domains[1][:4096]
    adapter = mp.RiemannianICP(damping=0.01, base_rotation=frame, random_state=0).fit(first, second)
    assert np.sqrt(np.mean(adapter.errors(first, first) ** 2)) <= 0.15
    assert adapter.start_kept_


def test_a_wrong_start_does_not_win(panda_domains):
    """Where the student is turned by 30° about a determined axis, the rotation that the search finds is taken."""
    turn = Rotation.from_euler("x", 30.0, degrees=True).as_matrix()
    first, second = panda_domains[0], panda_domains[1][:4096]
    adapter = mp.RiemannianICP(damping=0.01).fit(first, turn @ second @ turn.T)
    assert not adapter.start_kept_
    assert np.rad2deg(rotation_angle(adapter.rotation_, turn)) < 15.0
