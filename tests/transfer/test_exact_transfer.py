"""Cases in which the student is an exact image of the teacher: what the map must find without error.

The toy is that of Reithmeir et al. 2022, who reach an RMSE of 0.042 with 100 ellipsoids and 0.095 with the 12 most
singular ones; with two planar arms they reach 0.36 to 0.42.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.bodies import Arm
from maniport.transfer import EllipsoidCorrespondence, Search
from maniport.transfer.icp.fit import most_singular as selected
from maniport.transfer.rigid_adapter import transport_rotation

MOUNTING = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
HALF_TURN = np.linspace(0.0, np.pi, 20)


def rmse(found, truth):
    """Root mean squared distance, undivided."""
    return float(np.sqrt(np.mean(spd.distance(found, truth) ** 2)))


@pytest.fixture(scope="module")
def panda():
    """The Panda's arm."""
    return mp.load_arm("panda")


@pytest.mark.parametrize("most_singular", [None, 12])
@pytest.mark.parametrize("seed", range(25))
def test_toy_of_the_paper(seed, most_singular, panda, random_map):
    """100 Panda ellipsoids under a random rotation, dispersion and mean, shuffled: new ones are mapped exactly."""
    rng = np.random.default_rng(seed)
    ellipsoids = panda.manipulability(panda.sample(110, rng, sequence="uniform"))
    teacher, new = ellipsoids[:100], ellipsoids[100:]
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(n_resamples=0, random_state=seed, search=Search(most_singular=most_singular))
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert rmse(adapter.transform(new), truth.apply(new)) < 1e-6
    assert adapter.converged_
    assert adapter.dispersion_ratio_ == pytest.approx(truth.ratio, rel=1e-6)


@pytest.mark.parametrize("most_singular", [None, 12])
@pytest.mark.parametrize(("d", "seed"), [(2, 0), (2, 1), (2, 2), (2, 3), (6, 0), (6, 1)])
def test_toy_of_other_sizes(d, seed, most_singular, random_spd, random_map):
    """The same holds for 2×2 and 6×6 matrices."""
    rng = np.random.default_rng(seed)
    teacher, new = random_spd(rng, 100, d), random_spd(rng, 10, d)
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(n_resamples=0, random_state=seed, search=Search(most_singular=most_singular))
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert rmse(adapter.transform(new), truth.apply(new)) < 1e-6


def test_part_of_the_teacher_is_enough_to_scout(panda, random_map):
    """Beyond 512 ellipsoids the starts are compared on part of them; the result is as exact."""
    rng = np.random.default_rng(0)
    teacher = panda.manipulability(panda.sample(700, rng))
    truth = random_map(rng, teacher, ratio=0.8)
    adapter = mp.RiemannianICP(random_state=0).fit(teacher, truth.apply(teacher))
    assert rmse(adapter.transform(teacher[:10]), truth.apply(teacher[:10])) < 1e-6
    assert len(adapter.correspondence_) == 700


# ---- two planar arms ----------------------------------------------------------------------------------------------


def planar(q):
    """Ellipsoids, 3×3 and of rank 2 at most, of a horizontal arm with two links of 1 m."""
    first, both = q[..., 0], q[..., 0] + q[..., 1]
    jacobian = np.zeros((*first.shape, 3, 2))
    jacobian[..., 0, 0], jacobian[..., 0, 1] = -np.sin(first) - np.sin(both), -np.sin(both)
    jacobian[..., 1, 0], jacobian[..., 1, 1] = np.cos(first) + np.cos(both), np.cos(both)
    return jacobian @ np.swapaxes(jacobian, -1, -2)


def upright(q):
    """The same of the arm whose base is turned by the mounting."""
    return MOUNTING @ planar(q) @ MOUNTING.T


def sweep(fixed_joint, degrees):
    """One joint stands still at an angle, the other turns by 180° in 20 points."""
    still = np.full_like(HALF_TURN, np.deg2rad(degrees))
    return np.stack([still, HALF_TURN] if fixed_joint == 1 else [HALF_TURN, still], axis=-1)


ANGLES = np.linspace(-162.0, 180.0, 10)
TRAJECTORIES = np.concatenate([sweep(joint, angle) for joint in (1, 2) for angle in ANGLES])
RANDOM = np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 2))
EVALUATION = {"M-Eval-1": sweep(2, -135.0), "M-Eval-2": sweep(1, -110.0), "M-Eval-3": sweep(2, 65.0)}


def test_planar_arms_agree_with_the_bodies():
    """The ellipsoids by hand are those of arms made from Denavit-Hartenberg tables."""
    links = [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    assert_allclose(planar(RANDOM), Arm.from_dh("flat", links).manipulability(RANDOM), atol=1e-12)
    assert_allclose(upright(RANDOM), Arm.from_dh("upright", links, base=MOUNTING).manipulability(RANDOM), atol=1e-12)
    assert len(TRAJECTORIES) == 400


@pytest.mark.parametrize("training", [TRAJECTORIES, RANDOM], ids=["400 trajectory points", "500 random"])
@pytest.mark.parametrize("remedy", [{"floor": 1e-4}, {"damping": 0.01}], ids=str)
@pytest.mark.parametrize(
    "method",
    [
        mp.RiemannianICP(random_state=0),
        mp.RiemannianICP(random_state=0, search=Search(most_singular=100)),
        mp.RiemannianICP(mounting=MOUNTING),
        mp.ParallelTransport(mounting=MOUNTING),
    ],
    ids=["icp", "icp-100-most-singular", "icp-mounting", "pt-mounting"],
)
def test_planar_arms_with_the_same_samples(method, training, remedy):
    """From the same joint samples, or with known mounting, the evaluation trajectories are mapped exactly."""
    adapter = method.set_params(damping=None, floor=None).set_params(**remedy)
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
    for seed in range(5):
        adapter = mp.RiemannianICP(random_state=seed, search=Search(compete=False)).fit(*unequal)
        assert adapter.cost_ == adapter.history_.min()
        assert len(adapter.history_) == adapter.n_iter_ + 1
        start = mp.RiemannianICP(search=Search(n_starts=0, compete=False)).fit(*unequal)
        assert adapter.cost_ <= start.cost_ <= start.history_[0]
        assert adapter.stop_reason_


def test_start_is_respected(unequal, random_rotation):
    """Without rivals the search starts at parallel transport, at the identity, or at the known mounting only."""
    plain, mounting = mp.ParallelTransport().fit(*unequal), random_rotation(np.random.default_rng(0), 3)
    adapter = mp.RiemannianICP(search=Search(n_starts=0)).fit(*unequal)
    assert_allclose(adapter.start_rotation_, plain.rotation_)
    assert_allclose(adapter.set_params(search=Search(start="identity")).fit(*unequal).start_rotation_, np.eye(3))
    adapter.set_params(mounting=mounting, search=Search(start="parallel-transport", n_starts=4)).fit(*unequal)
    wanted = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
    assert_allclose(adapter.start_rotation_, wanted)


def test_first_start_wins_a_tie(random_spd):
    """Of several exact rotations of a symmetric domain the one of parallel transport is taken."""
    half = random_spd(np.random.default_rng(0), 20, 3)
    domain = np.concatenate([turn @ half @ turn for turn in (np.eye(3), np.diag([1.0, -1.0, -1.0]))])
    for seed in range(3):
        adapter = mp.RiemannianICP(random_state=seed).fit(domain, domain)
        assert_allclose(adapter.rotation_, np.eye(3), atol=1e-9)
        assert adapter.start_kept_  # it was found again


def test_rivals_never_make_a_large_search_worse(panda):
    """A rival that looked better on part of the teacher only does not displace parallel transport's start."""
    points = panda.manipulability(panda.sample(1400, 4)) + 0.01 * np.eye(3)
    teacher, student = points[:700], points[700:]
    alone = mp.RiemannianICP(search=Search(n_starts=0)).fit(teacher, student)
    assert mp.RiemannianICP(random_state=0).fit(teacher, student).cost_ <= alone.cost_


def test_limits_stop_the_search(unequal):
    """The largest number of iterations is kept, and said to be why the search ended."""
    adapter = mp.RiemannianICP(search=Search(n_starts=0, max_iter=1, tol=1e-15)).fit(*unequal)
    assert adapter.n_iter_ == 1
    assert not adapter.converged_
    assert "1 iterations" in adapter.stop_reason_


def test_a_search_without_progress_says_which_iterate_it_keeps(random_spd):
    """Between unrelated clouds the search gives up, says so, and names the iterate that it keeps."""
    rng = np.random.default_rng(1)
    search = Search(n_starts=0, compete=False)
    adapter = mp.RiemannianICP(n_resamples=0, search=search).fit(random_spd(rng, 40, 3), random_spd(rng, 50, 3))
    best = int(np.argmin(adapter.history_))
    assert adapter.stop_reason_ == f"no better cost in {adapter.n_iter_ - best} iterations; iteration {best} is kept"
    assert adapter.cost_ == adapter.history_[best]
    assert not adapter.converged_


def test_most_singular_ellipsoids_are_matched_only(unequal):
    """Only as many ellipsoids of each domain are matched as asked for; more than there are means all."""
    adapter = mp.RiemannianICP(search=Search(n_starts=0, most_singular=7)).fit(*unequal)
    assert adapter.correspondence_.shape == (7,)
    assert adapter.correspondence_.max() < 7
    every = mp.RiemannianICP(search=Search(n_starts=0, most_singular=1000)).fit(*unequal)
    assert every.cost_ == mp.RiemannianICP(search=Search(n_starts=0)).fit(*unequal).cost_


def test_most_singular_ellipsoids_are_those_of_largest_condition(random_spd):
    """The selection takes the longest ellipsoids, in their order."""
    conditions = [5.0, 90.0, 2.0, 70.0, 80.0]
    rng = np.random.default_rng(0)
    points = np.concatenate([random_spd(rng, 1, 3, condition) for condition in conditions])
    assert_allclose(selected(points, 3), points[[1, 3, 4]])


@pytest.mark.parametrize("exponent", [0.0, 1.0, 3.0, 1000.0])
def test_exponent_of_the_weights(unequal, exponent):
    """Any non-negative exponent gives a finite cost, also one that leaves weight to the best pair only."""
    adapter = mp.RiemannianICP(
        correspondence=EllipsoidCorrespondence(exponent=exponent), search=Search(n_starts=0, max_iter=5)
    ).fit(*unequal)
    assert np.all(np.isfinite(adapter.history_))
