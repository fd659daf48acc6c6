"""What a second process compiles while the main job works."""

import inspect
import os
import subprocess
import sys

import pytest
from numba import config

from maniport import ahead, compiling

WAITS = """
import threading
import numpy as np
from maniport import ahead
from maniport.spd.kernels import eigh, loops

told = []
begun = threading.Event()

def tell(step, fraction, found=""):
    told.append(step)
    if len(told) == 2:
        begun.set()

with ahead.helped(tell):
    assert begun.wait(60.0)
    assert np.allclose(eigh(np.eye(3)[None].repeat(20, axis=0))[0], 1.0)
stats = loops.eigh_loop.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), set(told))
"""


@pytest.mark.parametrize("line", ahead.NEEDED)
def test_what_is_compiled_ahead_is_there(line):
    """Every function of the list exists, is kept in the cache and takes so many arguments."""
    kernel, arguments = ahead._kernel(line)
    assert isinstance(kernel._cache, compiling._SoundCache)
    assert len(inspect.signature(kernel.py_func).parameters) == len(arguments)


@pytest.mark.skipif(int(config.NUMBA_NUM_THREADS) < 2, reason="there is no processor for a second process")
def test_who_works_waits_for_what_is_being_compiled(tmp_path):
    """A function that the second process is compiling comes out of the cache; the end of the work ends it."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", WAITS], env=environment, capture_output=True, text=True, timeout=100)
    assert done.stdout.strip() == "1 0 {'compile for this machine, once'}", done.stderr


def test_one_processor_has_no_second_process(monkeypatch):
    """Where two processes would only wait for one another there is one."""
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 1)
    monkeypatch.setattr(ahead.subprocess, "Popen", None)
    monkeypatch.setattr(compiling, "is_missing", lambda kernel, arguments: True)
    with ahead.helped():
        assert compiling.beside is None


def test_no_second_process_where_nothing_is_missing(monkeypatch):
    """What is in the cache is loaded, and that is all."""
    monkeypatch.setattr(ahead.subprocess, "Popen", None)
    monkeypatch.setattr(compiling, "is_missing", lambda kernel, arguments: False)
    with ahead.helped():
        pass
