"""Threads of the kernels."""

import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maniport import spd
from maniport.spd import kernels


@pytest.mark.parametrize("d", [2, 3, 6])
def test_threads_change_no_bit(d, random_spd, monkeypatch):
    """Shared among threads, every kernel gives the same bits as in one thread, and as for a part of the batch."""
    x, y = (np.tile(points, (60, 1, 1)) for points in random_spd(np.random.default_rng(d), (2, 1000), d))

    def everything():
        power = kernels.power_congruence(y[0], x, 0.3, y[1])
        return [*kernels.eigh(x), kernels.congruence(x, y), kernels.distances(x, y), power]

    monkeypatch.setattr(kernels.config, "NUMBA_NUM_THREADS", 4)
    shared = everything()
    monkeypatch.setattr(kernels.config, "NUMBA_NUM_THREADS", 1)
    for together, alone in zip(shared, everything(), strict=True):
        assert_array_equal(together, alone)
        assert_array_equal(together[:1000], alone[-1000:])


def test_concurrent_callers_do_not_disturb_each_other(random_spd):
    """Kernels may be called from several threads at once."""
    x = random_spd(np.random.default_rng(1), (500,), 3)
    expected, found = spd.mean(x), {}
    callers = [threading.Thread(target=lambda i=i: found.update({i: spd.mean(x)})) for i in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert all(np.array_equal(found[i], expected) for i in range(4))
