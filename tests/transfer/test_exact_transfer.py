"""A student that is an exact image of the teacher, which the map must find without error, and how the search behaves.

The toy is that of Reithmeir et al. 2022, who reach an RMSE of 0.042 with 100 ellipsoids and 0.095 with the 12 most
singular ones. `tests/studies` has their pair of planar arms.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import maniport as mp
from maniport import spd
from maniport.transfer.icp.correspondence import CORRESPONDENCES
from maniport.transfer.rigid_adapter import transport_rotation


@pytest.mark.parametrize("kind", CORRESPONDENCES)
@pytest.mark.parametrize("most_singular", [None, 12])
@pytest.mark.parametrize(("d", "seed"), [(3, 0), (3, 1), (2, 0), (6, 0)])
def test_toy_of_the_paper(d, seed, most_singular, kind, random_spd, random_map):
    """100 ellipsoids, the Panda's or others, under a random rotation, dispersion and mean, shuffled: a map is exact."""
    rng = np.random.default_rng(seed)
    panda = mp.load_arm("panda")
    ellipsoids = random_spd(rng, 110, d)
    if d == 3:
        ellipsoids = panda.manipulability(panda.sample(110, rng, sequence="uniform"))
    teacher = ellipsoids[:100]
    new = ellipsoids[100:]
    truth = random_map(rng, teacher)
    adapter = mp.RiemannianICP(most_singular=most_singular, correspondence=kind)
    adapter.fit(teacher, rng.permutation(truth.apply(teacher)))
    assert np.sqrt(np.mean(spd.distance(adapter.transform(new), truth.apply(new)) ** 2)) < 1e-6
    assert adapter.converged_
    assert adapter.dispersion_ratio_ == pytest.approx(truth.ratio, rel=1e-6)


@pytest.fixture
def unequal(random_spd):
    """Two domains of different size that are no images of each other."""
    rng = np.random.default_rng(0)
    return random_spd(rng, 40, 3), random_spd(rng, 55, 3, 1e3)


def test_best_iterate_is_kept(unequal):
    options = {"require_improvement": False, "criterion": "correspondence"}
    start = mp.RiemannianICP(n_starts=0, **options).fit(*unequal)
    adapter = mp.RiemannianICP(**options).fit(*unequal)
    assert adapter.cost_ == adapter.history_.min()
    assert adapter.cost_ <= start.cost_ <= start.history_[0]
    kept = int(start.history_.argmin())
    assert 0 < kept < start.n_iter_
    assert f"iteration {kept} " in start.stop_reason_
    assert not start.converged_


def test_start_is_respected(unequal, random_rotation):
    plain = mp.ParallelTransport().fit(*unequal)
    base_rotation = random_rotation(np.random.default_rng(0), 3)
    adapter = mp.RiemannianICP(n_starts=0).fit(*unequal)
    assert_allclose(adapter.start_rotation_, plain.rotation_)
    assert_allclose(adapter.set_params(start="identity").fit(*unequal).start_rotation_, np.eye(3))
    adapter.set_params(base_rotation=base_rotation, start="parallel-transport", n_starts=4).fit(
        *unequal
    )
    assert_allclose(adapter.teacher_mean_, base_rotation @ plain.teacher_mean_ @ base_rotation.T)
    expected = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
    assert_allclose(adapter.start_rotation_, expected)
