"""Many fits at once through joblib: adapters and arms travel between processes and bring back the same bits."""

import os
import pickle
import socket
import time

import joblib
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

import maniport as mp
from maniport.transfer import Search

PAIRS = [("rhuman", "panda"), ("panda", "rhuman"), ("myoarm", "panda")]
METHODS = [
    mp.ParallelTransport(damping=0.01),
    mp.RiemannianICP(damping=0.01, n_resamples=2, random_state=0, search=Search(max_iter=5)),
    mp.NearestNeighbor(damping=0.01),
]


@pytest.fixture(scope="module")
def arms():
    """Load the arms of all pairs."""
    return {name: mp.load_arm(name) for pair in PAIRS for name in pair}


@pytest.fixture(scope="module")
def domains(arms):
    """Sample a small domain of every arm."""
    return {name: mp.sample_domain(arm, 64, random_state=seed) for seed, (name, arm) in enumerate(arms.items())}


@pytest.fixture(scope="module")
def dask_cluster():
    """Start a Dask cluster of two processes that talk over the loopback interface only; close it afterwards."""
    if not os.environ.get("CI"):  # in CI a missing cluster is a failure
        pytest.importorskip("distributed")
    import distributed

    cluster = distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs="ERROR",
    )
    with cluster, distributed.Client(cluster) as client:
        yield client


@pytest.fixture(params=["loky", "threading", "dask"])
def two_workers(request):
    """Make joblib work on two workers of each kind."""
    if request.param == "dask":
        request.getfixturevalue("dask_cluster")
        with joblib.parallel_config(backend="dask"):
            yield request.param
    else:
        with joblib.parallel_config(backend=request.param, n_jobs=2):
            yield request.param


def fitted(adapter):
    """Collect what a fit has learned: every public attribute with a trailing underscore."""
    found = {key: value for key, value in vars(adapter).items() if key.endswith("_") and not key.startswith("_")}
    assert {"rotation_", "teacher_mean_", "student_mean_", "dispersion_ratio_"} <= set(found)
    return found


def assert_same_fit(one, other):
    """Compare two fitted adapters bit for bit."""
    assert type(one) is type(other)
    first, second = fitted(one), fitted(other)
    assert first.keys() == second.keys()
    for key in first:
        assert_array_equal(first[key], second[key], err_msg=key, strict=True)


def fit_pair(adapter, teacher, student):
    """Fit a copy of an adapter, as a worker would; the original stays as it is."""
    return clone(adapter).fit(teacher, student)


def met_process(folder):
    """Wait until two processes work on such tasks, and return the number of this one."""
    (folder / str(os.getpid())).touch()
    end = time.monotonic() + 60.0
    while len(list(folder.iterdir())) < 2 and time.monotonic() < end:
        time.sleep(0.01)
    return os.getpid()


@pytest.mark.parametrize("adapter", METHODS, ids=lambda adapter: type(adapter).__name__)
def test_many_fits_equal_serial_ones(adapter, domains, two_workers):
    """Robot pairs fitted by workers are, bit for bit, those fitted one after the other."""
    serial = [fit_pair(adapter, domains[teacher], domains[student]) for teacher, student in PAIRS]
    parallel = joblib.Parallel()(
        joblib.delayed(fit_pair)(adapter, domains[teacher], domains[student]) for teacher, student in PAIRS
    )
    for one, other in zip(serial, parallel, strict=True):
        assert_same_fit(one, other)
        assert_array_equal(one.transform(domains["panda"]), other.transform(domains["panda"]))


def test_large_domains_are_shared_read_only(domains):
    """Domains that joblib maps into the workers' memory, read-only, give the same fit as those in this process."""
    serial = [fit_pair(adapter, domains["rhuman"], domains["panda"]) for adapter in METHODS]
    parallel = joblib.Parallel(n_jobs=2, backend="loky", max_nbytes=1)(
        joblib.delayed(fit_pair)(adapter, domains["rhuman"], domains["panda"]) for adapter in METHODS
    )
    for one, other in zip(serial, parallel, strict=True):
        assert_same_fit(one, other)


def test_bound_fit_can_be_sent(domains, two_workers):
    """`delayed(adapter.fit)` works, and every call returns an adapter of its own."""
    adapters = joblib.Parallel()(
        joblib.delayed(mp.ParallelTransport(damping=0.01).fit)(domains[teacher], domains[student])
        for teacher, student in PAIRS
    )
    assert len({id(adapter) for adapter in adapters}) == len(PAIRS)
    assert_same_fit(adapters[0], mp.ParallelTransport(damping=0.01).fit(domains["rhuman"], domains["panda"]))


def test_starts_with_seeds_equal_serial_ones(domains, two_workers):
    """A multi-start over seeds finds the same costs on workers as it does here."""
    seeds = range(2)
    adapter = mp.RiemannianICP(damping=0.01, search=Search(max_iter=3))
    tasks = [clone(adapter).set_params(random_state=seed) for seed in seeds]
    serial = [fit_pair(task, domains["rhuman"], domains["panda"]).cost_ for task in tasks]
    parallel = joblib.Parallel()(joblib.delayed(fit_pair)(task, domains["rhuman"], domains["panda"]) for task in tasks)
    assert [one.cost_ for one in parallel] == serial


def test_grid_search_equals_serial_one(domains, two_workers):
    """Cross-validation over parameters gives the same scores and chooses the same adapter."""
    grid = {"scale": [True, False], "dispersion": ["mean", "rms"]}
    search = GridSearchCV(mp.ParallelTransport(damping=0.01), grid, cv=3)
    serial = clone(search).set_params(n_jobs=1)
    with joblib.parallel_config(backend="sequential"):
        serial.fit(domains["rhuman"], domains["panda"])
    # within the surrounding configuration: n_jobs=None takes its number of workers
    parallel = clone(search).fit(domains["rhuman"], domains["panda"])
    assert_array_equal(parallel.cv_results_["mean_test_score"], serial.cv_results_["mean_test_score"])
    assert parallel.best_params_ == serial.best_params_
    assert_same_fit(parallel.best_estimator_, serial.best_estimator_)


def test_arms_can_be_sent(arms, two_workers):
    """Domains sampled by workers from an arm they were sent equal those sampled here."""
    tasks = [(arm, 32, seed) for seed, arm in enumerate(arms.values())]
    serial = [mp.sample_domain(*task) for task in tasks]
    parallel = joblib.Parallel()(joblib.delayed(mp.sample_domain)(*task) for task in tasks)
    for one, other in zip(serial, parallel, strict=True):
        assert_array_equal(one, other)


def test_cluster_does_the_work(dask_cluster, tmp_path):
    """With the Dask backend tasks leave this process and reach both workers."""
    with joblib.parallel_config(backend="dask"):
        found = joblib.Parallel()(joblib.delayed(met_process)(tmp_path) for _ in range(20))
    assert os.getpid() not in found
    assert len(set(found)) == 2


def test_cluster_stays_on_this_machine(dask_cluster):
    """Scheduler and both workers listen on the loopback interface only, and there is no dashboard."""
    information = dask_cluster.scheduler_info()
    addresses = [information["address"], *information["workers"]]
    assert len(addresses) == 3
    for address in addresses:
        host = address.rsplit("/", 1)[-1].rsplit(":", 1)[0]
        assert socket.gethostbyname(host) == "127.0.0.1"
    assert dask_cluster.cluster.scheduler_spec["options"]["dashboard"] is False


@pytest.mark.parametrize("name", ["rhuman", "myoarm", "panda"])
def test_pickled_arm_is_the_same_arm(name, arms):
    """A pickled arm has the same joints, forward kinematics and Jacobian."""
    arm, copy = arms[name], pickle.loads(pickle.dumps(arms[name]))
    q = arm.sample(5, random_state=0)
    assert (copy.name, copy.joint_names) == (arm.name, arm.joint_names)
    assert_array_equal(copy.lower, arm.lower)
    assert_array_equal(copy.upper, arm.upper)
    assert_array_equal(copy.forward(q), arm.forward(q))
    assert_array_equal(copy.jacobian(q), arm.jacobian(q))


@pytest.mark.parametrize("adapter", METHODS, ids=lambda adapter: type(adapter).__name__)
def test_pickled_adapter_is_the_same_adapter(adapter, domains):
    """A pickled fitted adapter maps to the same bits."""
    one = fit_pair(adapter, domains["rhuman"], domains["panda"])
    one.transform(np.asarray(domains["rhuman"][:3]))  # anything kept from a call must travel, too
    other = pickle.loads(pickle.dumps(one))
    assert_same_fit(one, other)
    assert other.get_params() == one.get_params()
    assert_array_equal(one.transform(domains["rhuman"]), other.transform(domains["rhuman"]))
