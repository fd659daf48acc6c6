"""Many fits at once through joblib: adapters and arms travel between processes and bring back the same bits."""

import pickle

import joblib
import pytest
from numpy.testing import assert_array_equal
from sklearn.base import clone

import maniport as mp

PAIRS = [("rhuman", "panda"), ("panda", "rhuman")]
METHODS = [
    mp.ParallelTransport(damping=0.01),
    mp.RiemannianICP(damping=0.01, n_starts=2),
    mp.NearestNeighbor(damping=0.01),
]


@pytest.fixture(scope="module")
def domains():
    return {name: mp.sample_domain(mp.load_arm(name), 64, random_state=0) for name in PAIRS[0]}


def assert_same_fit(one, other):
    first, second = ({k: v for k, v in vars(x).items() if k.endswith("_") and k[0] != "_"} for x in (one, other))
    assert first.keys() == second.keys() >= {"rotation_", "teacher_mean_"}
    for name, value in first.items():
        assert_array_equal(value, second[name], err_msg=name, strict=True)


def test_work_in_processes_equals_serial_work(domains):
    """Fits with shared read-only domains, and samples of arms that were sent."""
    fits = [(clone(adapter), domains[a], domains[b]) for adapter in METHODS for a, b in PAIRS]
    arms = [mp.load_arm(name) for name in (*PAIRS[0], "myoarm")]
    with joblib.parallel_config("loky", n_jobs=2):
        fitted = joblib.Parallel(max_nbytes=1)(joblib.delayed(adapter.fit)(a, b) for adapter, a, b in fits)
        samples = joblib.Parallel()(joblib.delayed(mp.sample_domain)(arm, 32, 1) for arm in arms)
    for (adapter, a, b), found in zip(fits, fitted, strict=True):
        assert_same_fit(adapter.fit(a, b), found)
        assert_array_equal(adapter.transform(a), found.transform(a))
        assert_same_fit(pickle.loads(pickle.dumps(adapter)), found)
    for arm, found in zip(arms, samples, strict=True):
        assert_array_equal(mp.sample_domain(arm, 32, 1), found)
