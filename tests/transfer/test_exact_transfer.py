"""Cases in which the student is an exact image of the teacher: what the map must find without error.

The toy is that of Reithmeir et al. 2022, who reach an RMSE of 0.042 with 100 ellipsoids and 0.095 with the 12 most
singular ones; with two planar arms they reach 0.36 to 0.42.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.transfer import Search
from maniport.transfer.rigid_adapter import transport_rotation

MOUNTING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
HALF_TURN = np.linspace(0.0, np.pi, 20)


@pytest.mark.parametrize("most_singular", [None, 12])
@pytest.mark.parametrize(("d", "seed"), [*((3, seed) for seed in range(5)), (2, 0), (2, 1), (6, 0), (6, 1)])
def test_toy_of_the_paper(d, seed, most_singular, random_spd, random_map):
    """100 ellipsoids, the Panda's or others, under a random rotation, dispersion and mean, shuffled: a map is exact."""
    rng, panda = np.random.default_rng(seed), mp.load_arm("panda")
    ellipsoids = random_spd(rng, 110, d)
    if d == 3:
        ellipsoids = panda.manipulability(panda.sample(110, rng, sequence="uniform"))
    teacher, new = ellipsoids[:100], ellipsoids[100:]
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(random_state=seed, search=Search(most_singular=most_singular))
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert np.sqrt(np.mean(spd.distance(adapter.transform(new), truth.apply(new)) ** 2)) < 1e-6
    assert adapter.converged_
    assert adapter.dispersion_ratio_ == pytest.approx(truth.ratio, rel=1e-6)


# ---- two planar arms ----------------------------------------------------------------------------------------------


def planar(q):
    """Ellipsoids, 3×3 and of rank 2 at most, of a horizontal arm with two links of 1 m."""
    first, both = q[..., 0], q[..., 0] + q[..., 1]
    jacobian = np.zeros((*first.shape, 3, 2))
    jacobian[..., 0, 0], jacobian[..., 0, 1] = -np.sin(first) - np.sin(both), -np.sin(both)
    jacobian[..., 1, 0], jacobian[..., 1, 1] = np.cos(first) + np.cos(both), np.cos(both)
    return jacobian @ np.swapaxes(jacobian, -1, -2)


def upright(q):
    """The same of the arm whose base is turned by the base_rotation."""
    return MOUNTING @ planar(q) @ MOUNTING.T


def sweep(fixed_joint, degrees):
    """One joint stands still at an angle, the other turns by 180° in 20 points."""
    still = np.full_like(HALF_TURN, np.deg2rad(degrees))
    return np.stack([still, HALF_TURN] if fixed_joint == 1 else [HALF_TURN, still], axis=-1)


ANGLES = np.linspace(-162.0, 180.0, 10)
TRAJECTORIES = np.concatenate([sweep(joint, angle) for joint in (1, 2) for angle in ANGLES])
RANDOM = np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 2))
EVALUATION = {"M-Eval-1": sweep(2, -135.0), "M-Eval-2": sweep(1, -110.0), "M-Eval-3": sweep(2, 65.0)}


@pytest.mark.parametrize("training", [TRAJECTORIES, RANDOM], ids=["400 trajectory points", "500 random"])
@pytest.mark.parametrize("remedy", [{"eigenvalue_floor": 1e-4}, {"damping": 0.01}], ids=str)
@pytest.mark.parametrize(
    "method",
    [
        mp.RiemannianICP(random_state=0),
        mp.RiemannianICP(random_state=0, search=Search(most_singular=100)),
        mp.RiemannianICP(base_rotation=MOUNTING),
        mp.ParallelTransport(base_rotation=MOUNTING),
    ],
    ids=["icp", "icp-100-most-singular", "icp-mounting", "pt-mounting"],
)
def test_planar_arms_with_the_same_samples(method, training, remedy):
    """From the same joint samples, or with known base orientation, the evaluation trajectories are mapped exactly."""
    adapter = method.set_params(damping=None, eigenvalue_floor=None).set_params(**remedy)
    adapter.fit(planar(training), upright(training))
    for name, q in EVALUATION.items():
        assert np.sqrt(np.mean(adapter.errors(planar(q), upright(q)) ** 2)) < 1e-6, name


# ---- how the search behaves ---------------------------------------------------------------------------------------


@pytest.fixture
def unequal(random_spd):
    """Two domains of different size that are no images of each other."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 40, 3), random_spd(rng, 55, 3, 1e3)


def test_best_iterate_is_kept(unequal):
    """The cost is the lowest of the history, and never above the one at parallel transport's start."""
    start = mp.RiemannianICP(search=Search(n_starts=0, require_improvement=False)).fit(*unequal)
    for seed in range(5):
        adapter = mp.RiemannianICP(random_state=seed, search=Search(require_improvement=False)).fit(*unequal)
        assert adapter.cost_ == adapter.history_.min()
        assert adapter.cost_ <= start.cost_ <= start.history_[0]
        assert adapter.stop_reason_


def test_start_is_respected(unequal, random_rotation):
    """The only start is parallel transport, the identity, or the known base orientation."""
    plain, base_rotation = mp.ParallelTransport().fit(*unequal), random_rotation(np.random.default_rng(0), 3)
    adapter = mp.RiemannianICP(search=Search(n_starts=0)).fit(*unequal)
    assert_allclose(adapter.start_rotation_, plain.rotation_)
    assert_allclose(adapter.set_params(search=Search(start="identity")).fit(*unequal).start_rotation_, np.eye(3))
    adapter.set_params(base_rotation=base_rotation, search=Search(start="parallel-transport", n_starts=4)).fit(*unequal)
    wanted = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
    assert_allclose(adapter.start_rotation_, wanted)


def test_most_singular_ellipsoids_are_matched_only(unequal):
    """Only as many ellipsoids of each domain are matched as asked for; more than there are means all."""
    adapter = mp.RiemannianICP(search=Search(n_starts=0, most_singular=7)).fit(*unequal)
    assert adapter.correspondence_.shape == (7,)
    assert adapter.correspondence_.max() < 7
    every = mp.RiemannianICP(search=Search(n_starts=0, most_singular=1000)).fit(*unequal)
    assert every.cost_ == mp.RiemannianICP(search=Search(n_starts=0)).fit(*unequal).cost_
