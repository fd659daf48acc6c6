"""The start competes with what the search made of it, and the fit says what the domains do not determine."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import maniport as mp
from maniport.arms import Arm
from maniport.errors import IdentifiabilityWarning
from maniport.transfer import Search
from maniport.transfer.rotation_group import rotation_angle

DEFAULTS = Search()


FRAME = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def planar(base=None):
    """An arm of two links of one meter."""
    return Arm.from_dh("planar", [[0, 0, 1, 0], [0, 0, 1, 0]], base=base)


def planar_error(n, seed, search=DEFAULTS):
    """Undivided RMSE on held-out ellipsoids of the planar pair, known base orientation, independent Sobol samples."""
    teacher, student = mp.sample_domain(planar(), n, seed), mp.sample_domain(planar(FRAME), n, seed + 100)
    adapter = mp.RiemannianICP(damping=0.01, base_rotation=FRAME, search=search).fit(teacher, student)
    new = mp.sample_domain(planar(), 300, seed + 200)
    return np.sqrt(np.mean(adapter.errors(new, FRAME @ new @ FRAME.T) ** 2)), adapter


@pytest.fixture(scope="module")
def panda_draws():
    """A pair of independent draws of the Panda's domain."""
    panda = mp.load_arm("panda")
    return [[mp.sample_domain(panda, 4096, 10 * seed + i) for i in (0, 1)] for seed in range(1)]


@pytest.mark.parametrize(("n", "wanted", "draws"), [(256, 0.1, 5), (1024, 0.01, 5)])
def test_planar_pair_with_known_mounting(n, wanted, draws):
    """Independent samples of the planar pair: the median error over some draws stays below what is promised."""
    errors, adapters = zip(*(planar_error(n, seed) for seed in range(draws)), strict=True)
    assert np.median(errors) < wanted
    assert all(rotation_angle(one.rotation_, one.start_rotation_) < 1e-6 for one in adapters)


def test_identity_test_of_the_panda(panda_draws):
    """Panda to Panda: the defaults change an ellipsoid by at most 0.15 where nothing should change."""
    for first, second in panda_draws:
        for frame in (None, np.eye(3)):
            adapter = mp.RiemannianICP(damping=0.01, base_rotation=frame, random_state=0).fit(first, second)
            assert np.sqrt(np.mean(adapter.errors(first, first) ** 2)) <= 0.15
            assert adapter.start_kept_


def test_a_wrong_start_does_not_win(panda_draws):
    """Where the student is turned by 30° about a determined axis, the rotation found is taken."""
    turn = Rotation.from_euler("x", 30.0, degrees=True).as_matrix()
    first, second = panda_draws[0]
    adapter = mp.RiemannianICP(damping=0.01).fit(first, turn @ second @ turn.T)
    assert not adapter.start_kept_
    assert np.rad2deg(rotation_angle(adapter.rotation_, turn)) < 15.0


# ---- what fit says ------------------------------------------------------------------------------------------------


def test_fit_names_the_flat_axis_and_what_to_give():
    """Without base_rotation and pairs, `fit` warns and names the axis."""
    teacher, student = mp.sample_domain(planar(), 256, 0), mp.sample_domain(planar(FRAME), 256, 1)
    with pytest.warns(IdentifiabilityWarning, match=r"about the x axis of the student's base.*base_rotation.*pairs"):
        mp.RiemannianICP(damping=0.01).fit(teacher, student)


@pytest.mark.filterwarnings("error::maniport.errors.IdentifiabilityWarning")
def test_fit_is_silent_where_the_mounting_or_pairs_are_known():
    """Who has said what the domains cannot tell is not warned."""
    teacher, student = mp.sample_domain(planar(), 256, 0), mp.sample_domain(planar(FRAME), 256, 1)
    mp.RiemannianICP(damping=0.01, base_rotation=FRAME).fit(teacher, student)
    mp.RiemannianICP(damping=0.01).fit(teacher, student, pairs=(teacher[:3], FRAME @ teacher[:3] @ FRAME.T))
