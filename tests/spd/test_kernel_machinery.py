"""Threads of the kernels."""

import multiprocessing
import os
import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maniport import spd
from maniport.spd import kernels
from maniport.spd.kernels import threads


@pytest.fixture
def many_threads(monkeypatch):
    """Share even small batches among four threads."""
    monkeypatch.setattr(threads.config, "NUMBA_NUM_THREADS", 4)
    monkeypatch.setattr(threads, "_pool", None)
    monkeypatch.setattr(threads, "PART_WORK", 1)


@pytest.mark.parametrize("d", [2, 3, 6])
def test_threads_change_no_bit(d, random_spd, many_threads, monkeypatch):
    """Shared among threads, every kernel gives the same bits as in one thread."""
    x, y = random_spd(np.random.default_rng(d), (2, 1000), d)
    weights = np.full(1000, 1e-3)

    def everything():
        at = kernels.moments(x, y[0], weights, weights, True)
        power = kernels.power_congruence(y[0], x, 0.3, y[1])
        return [*kernels.eigh(x), kernels.congruence(x, y), kernels.distances(x, y), power, at.gradient, at.hessian]

    shared = everything()
    monkeypatch.setattr(threads.config, "NUMBA_NUM_THREADS", 1)
    for together, alone in zip(shared, everything(), strict=True):
        assert_array_equal(together, alone)


def test_parts_cover_a_batch_once_and_in_order(many_threads):
    """Every matrix belongs to one part, and results come in the order of the parts, whoever worked them out."""
    workers = set()

    def work(first, last):
        workers.add(threading.get_ident())
        return list(range(first, last))

    for count in (0, 1, 16, 1000, 12345):
        assert [index for part in threads.in_parts(work, count, 3) for index in part] == list(range(count))
    assert len(workers) <= 4


def test_an_error_in_a_thread_reaches_the_caller(many_threads):
    """What goes wrong in a part is raised where the kernel was called."""

    def work(first, last):
        if first >= 500:
            raise KeyError(first)

    with pytest.raises(KeyError):
        threads.in_parts(work, 1000, 3)


def _decompose(queue, x):
    queue.put(kernels.eigh(x)[0])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes fork on POSIX only")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(random_spd, many_threads):
    """After a fork, which no thread survives, kernels still share their work and finish."""
    x = random_spd(np.random.default_rng(0), (1000,), 3)
    expected = kernels.eigh(x)[0]
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_decompose, args=(queue, x))
    child.start()
    assert_array_equal(queue.get(timeout=60), expected)
    child.join()


def test_concurrent_callers_do_not_disturb_each_other(random_spd, many_threads):
    """Kernels may be called from several threads at once."""
    x = random_spd(np.random.default_rng(1), (500,), 3)
    expected, found = spd.mean(x), {}
    callers = [threading.Thread(target=lambda i=i: found.update({i: spd.mean(x)})) for i in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(found) == 4
    for mean in found.values():
        assert_array_equal(mean, expected)
