import numpy as np
import pytest

from maniport import MeanTransport, ParallelTransport, RiemannianICP, spd
from maniport.errors import InvalidInputError
from maniport.evaluation.comparison import TRANSPORT, baselines_for


@pytest.fixture
def domains(make_cloud, rng):
    return make_cloud(rng, 60), 3.0 * make_cloud(rng, 80, spread=0.3)


def test_mean_transport_matches_the_means_and_nothing_else(domains, turn_about):
    """The teacher's mean becomes the student's, and all distances stay: a congruence by S̄^½ (R_b T̄ R_bᵀ)^-½ R_b."""
    turn, points = turn_about(35.0, axis=1), domains[0]
    adapter = MeanTransport(base_rotation=turn).fit(*domains)
    teacher, student = (spd.mean(cloud) for cloud in domains)
    factor = spd.powm(student, 0.5) @ spd.powm(turn @ teacher @ turn.T, -0.5) @ turn
    images = adapter.transform(points)
    np.testing.assert_allclose(images, factor @ points @ factor.T, rtol=1e-8)
    np.testing.assert_allclose(adapter.inverse_transform(images), points, rtol=1e-8)


def test_a_method_is_not_its_own_baseline(domains):
    assert TRANSPORT not in baselines_for(ParallelTransport())
    own = ParallelTransport(damping=0.01)
    adapter = RiemannianICP(damping=0.01).fit(*domains)
    baselines = baselines_for(adapter, ("identity", own))
    assert list(baselines) == ["identity", TRANSPORT]
    assert baselines[TRANSPORT].get_params() == own.get_params()
    for rows, word in (((ParallelTransport(damping=0.02),), "rows"), (("identity baseline",), "method")):
        with pytest.raises(InvalidInputError, match=word):
            baselines_for(adapter, rows)
