"""What a second process compiles, and does, while the main job works."""

import inspect
import io
import os
import pickle
import subprocess
import sys
import time
import warnings
from functools import partial
from unittest import mock

import numpy as np
import pytest
from numba import config

import maniport as mp
from maniport import ahead, aside, compiling, second
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation import choose
from maniport.second import helped
from maniport.telling.drawing import drawing
from maniport.tracking import StartBank
from maniport.validation import as_count

WAITS = """
import sys
import threading
import numba
import numpy as np
from maniport import second
from maniport.spd.kernels import eigh, loops

told = []
begun = threading.Event()

def tell(step, fraction, found=""):
    told.append(step)
    if len(told) == 2:
        begun.set()

with second.helped(tell):
    assert begun.wait(300.0)
    assert np.allclose(eigh(np.eye(3)[None].repeat(20, axis=0))[0], 1.0)
stats = loops.eigh_loop.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), set(told))
"""
AGAIN = """
import sys
import numba
import numpy as np
from maniport.spd.kernels import eigh, loops

eigh(np.eye(3)[None].repeat(20, axis=0))
print(sum(loops.eigh_loop.stats.cache_misses.values()), "numba.np.npyimpl" in sys.modules)
print(numba.njit(lambda x: np.sqrt(x) + 1.0)(4.0))
"""


@pytest.mark.parametrize("line", ahead.FIRST + ahead.REST)
def test_what_is_compiled_ahead_is_there(line):
    """Every function of the list exists, is kept in the cache and takes so many arguments."""
    kernel, arguments = ahead._kernel(line)
    assert isinstance(kernel._cache, compiling._SoundCache)
    assert len(inspect.signature(kernel.py_func).parameters) == len(arguments)


@pytest.mark.skipif(int(config.NUMBA_NUM_THREADS) < 2, reason="there is no processor for a second process")
def test_who_works_waits_for_what_is_being_compiled(tmp_path):
    """A function that the second process is compiling comes out of the cache; the end of the work ends it.

    What comes out of the cache in a later process does not make Numba's compiler ready; what is compiled does.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    expected = (WAITS, ["1 0 {'compile for this machine, once'}"]), (AGAIN, ["0 False", "3.0"])
    for program, lines in expected:
        run = [sys.executable, "-c", program]
        done = subprocess.run(run, env=environment, capture_output=True, text=True, timeout=300)
        assert done.stdout.splitlines() == lines, done.stderr


def test_nobody_compiles_what_another_one_is_at():
    """What is being compiled there is not claimed here, and what is claimed here is left alone there."""
    one = second._Second(None)
    one._compiles = "there"
    assert not one._claim("there")
    assert one._claim("here")
    assert list(ahead.compile_missing(lambda name: False, ahead.FIRST)) == []


def test_work_goes_before_what_only_the_first_process_needs():
    """What waits is handed over where the second process would compile else; after it, it may compile."""
    one = second._Second(None)
    said = ("compiles", "first"), ("would", "rest"), ("done", (7, [])), ("would", "rest")
    messages, answers = io.BytesIO(b"".join(map(pickle.dumps, said))), mock.Mock(wraps=io.BytesIO())
    one._process = mock.Mock(stdout=messages, stdin=answers)
    found = one.take(os.getpid, os.getpid)
    one._listen()
    assert [pickle.loads(call.args[0]) for call in answers.write.call_args_list] == [True, os.getpid, True]
    assert found() == 7


def test_one_processor_has_no_second_process(monkeypatch):
    """Where two processes would only wait for one another there is one."""
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", 1)
    monkeypatch.setattr(second.subprocess, "Popen", None)
    with helped():
        assert (compiling.beside, aside.helper) == (None, None)


@pytest.fixture(scope="module")
def helper():
    """The second process, ready for work."""
    nothing = mock.patch.multiple(second, LOADED=(), WANTED=())
    with mock.patch.object(config, "NUMBA_NUM_THREADS", 2), nothing, helped():
        one = aside.helper
        with one._changed:
            assert one._changed.wait_for(lambda: one._free, 300.0)
        yield one


def test_who_hands_work_over_gets_what_it_would_do_itself(helper):
    """Results, errors and warnings of work that is handed over are those of the same work done here."""
    work = os.getpid, partial(as_count, 0, "n"), partial(warnings.warn, "beware", ManiportWarning), lambda: os.getpid()
    first, wrong, warned, own = (aside.aside(one) for one in work)
    assert first() == helper._process.pid
    with pytest.raises(InvalidInputError, match="n must be"):
        wrong()
    with pytest.warns(ManiportWarning, match="beware"):
        warned()
    assert own() == os.getpid()  # it cannot be sent


def test_who_waits_does_what_is_needed_later(helper, tmp_path):
    """While a result is not there yet, and only then, work that waits for such a moment is done, once."""
    done, pipe = [], tmp_path / "pipe"
    os.mkfifo(pipe)
    with helper._changed:
        assert helper._changed.wait_for(lambda: helper._free, 300.0)
    with mock.patch.object(aside, "helper", helper):
        late = aside.aside(pipe.read_bytes)  # it lasts until the pipe is written
        aside.meanwhile(lambda: done.append("bridge") or pipe.write_bytes(b""))
        assert done == []
        late()
    with mock.patch.object(aside, "helper", None):
        aside.meanwhile(partial(done.append, "nobody waits"))
        aside.aside(os.getpid)()
    assert done == ["bridge"]


def test_two_processes_find_what_one_finds(helper):
    """The method that is chosen, its measures and a figure are the same, bit for bit, with help and without."""
    person, robot = (mp.load_arm(name) for name in ("rhuman", "panda"))
    shown = person.ellipsoids(person.sample(20, 0))
    domains = [mp.sample_domain(arm, 64, 0) for arm in (person, robot)]
    bank = StartBank.build(robot, 500)

    def both():
        figure = drawing("curves", np.arange(20.0), {"person": shown}, unit="m/s")
        return choose(*domains, shown, robot=robot, bank=bank), figure().files

    with mock.patch.object(helper, "take", wraps=helper.take) as take, mock.patch.object(aside, "helper", helper):
        (helped_choice, helped_files), took = both(), take.call_count
    with mock.patch.object(aside, "helper", None):
        choice, files = both()
    assert took == 1
    assert (choice.method, repr(choice.evaluation.rows), files) == (
        helped_choice.method, repr(helped_choice.evaluation.rows), helped_files,
    )  # fmt: skip
    assert np.array_equal(choice.adapter.transform(shown), helped_choice.adapter.transform(shown))


def test_who_loses_the_second_process_goes_on_alone(helper):
    """Where it is ended from outside, what it was at and what waits for it is done here."""
    at, waits = (aside.aside(partial(time.sleep, seconds)) for seconds in (0.5, 0.0))
    helper._process.kill()
    assert (at(), waits(), aside.aside(os.getpid)()) == (None, None, os.getpid())


def test_what_is_not_begun_is_done_here():
    """Nobody waits for work that the second process has not come to."""
    assert second._Second(None).take(os.getpid, os.getpid)() == os.getpid()
