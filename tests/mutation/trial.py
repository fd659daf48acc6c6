"""A plugin of pytest that tries mutants in forks of one process, in which everything is loaded and compiled.

It runs the tests once and notes which functions each reaches. For every mutant of a function it runs those tests until
one fails, first those that have noticed most mutants of that function, then the quickest.
"""

import gc
import json
import os
import resource
import signal
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import Phase, settings
from mutmut.mutation import trampoline

# a failure is enough, it need not be made small
settings.register_profile(
    "mutants", derandomize=True, deadline=None, max_examples=15, database=None, phases=(Phase.explicit, Phase.generate)
)

LONGEST = 5
"""Processor time of a test beyond five times what it takes without a mutant [s]: loops that do not end are ended."""
IDLE = 20
"""How many times as long it may take by the clock: what waits for ever needs no processor."""

reached: set[str] = set()
by_fixture: dict[str, set[str]] = defaultdict(set)
trampoline.record_trampoline_hit = lambda name, caller=None: reached.add(name)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Take what `mutation` asks for."""
    parser.addoption("--mutants", type=Path)
    parser.addoption("--outcomes", type=Path)
    parser.addoption("--jobs", type=int)
    parser.addoption("--minutes", type=float)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Any:
    """Note what a fixture reaches: it is made for the first of the tests that use it alone."""
    before = set(reached)
    reached.clear()
    result = yield
    by_fixture[fixturedef.argname] |= reached
    reached.update(before)
    return result


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Run the tests without a mutant, then with each."""
    if session.testsfailed:
        raise session.Interrupted("tests could not be collected")
    trampoline.set_mutant_under_test("stats")
    took: dict[pytest.Item, float] = {}
    tests: dict[str, list[pytest.Item]] = defaultdict(list)
    for item, following in zip(session.items, [*session.items[1:], None], strict=True):
        reached.clear()
        began = time.process_time()
        if not passes(item, following):  # such as one that counts frames of calls
            print(f"left out, for it fails without a mutant: {item.nodeid}", flush=True)
            continue
        seconds = time.process_time() - began
        took[item] = seconds
        for function in reached.union(*(by_fixture[name] for name in item.fixturenames)):
            tests[function].append(item)
    trampoline.set_mutant_under_test("")
    outcomes = try_all(tests, took, session.config)
    if outcomes.pop("") != "survived":
        raise session.Failed("a test that passed fails when it is run again in a fork")
    session.config.getoption("--outcomes").write_text(json.dumps(outcomes))
    return True


def try_all(
    tests: dict[str, list[pytest.Item]], took: dict[pytest.Item, float], config: pytest.Config
) -> dict[str, str]:
    """Try the mutants that are asked for, several at a time; say what became of each, on the way, too."""
    asked = json.loads(config.getoption("--mutants").read_text())
    outcomes: dict[str, str] = {}
    notices: dict[str, Counter[pytest.Item]] = defaultdict(Counter)
    running = [Fork("", list(took), took)]  # nothing may fail there
    until = time.monotonic() + 60.0 * config.getoption("--minutes")
    gc.freeze()  # what is shared with forks is not to be touched
    for number, mutant in enumerate(asked):
        function = mutant.rpartition("__mutmut_")[0]
        if function not in tests:
            outcomes[mutant] = "not reached"
            continue
        while len(running) >= config.getoption("--jobs"):
            finish(running, outcomes, notices)
        if time.monotonic() > until:
            break
        if number % 100 == 0:
            print(f"{number} of {len(asked)} mutants; so far {Counter(outcomes.values())}", flush=True)
            config.getoption("--outcomes").write_text(json.dumps(outcomes))
        items = sorted(tests[function], key=lambda item: (-notices[function][item], took[item]))
        running.append(Fork(mutant, items, took))
    while running:
        finish(running, outcomes, notices)
    return outcomes


def passes(item: pytest.Item, following: pytest.Item | None) -> bool:
    """Run one test with its fixtures."""
    return not any(report.failed for report in runtestprotocol(item, log=False, nextitem=following))


class Fork:
    """A process that runs tests with a mutant and ends at the first that fails."""

    def __init__(self, mutant: str, items: list[pytest.Item], took: dict[pytest.Item, float]) -> None:
        self.mutant, self.items = mutant, items
        self.told, telling = os.pipe()
        self.process = os.fork()
        if self.process == 0:
            try:
                silence = os.open(os.devnull, os.O_WRONLY)
                os.dup2(silence, 1)
                os.dup2(silence, 2)
                trampoline.set_mutant_under_test(mutant)
                self._run(telling, took)
            finally:
                os._exit(1)  # reached only where something else than a test went wrong: that is noticed, too
        os.close(telling)

    def _run(self, telling: int, took: dict[pytest.Item, float]) -> None:
        """Run the tests within limits of time; tell the number of each before it begins."""
        _, most = resource.getrlimit(resource.RLIMIT_CPU)
        for number, (item, following) in enumerate(zip(self.items, [*self.items[1:], None], strict=True)):
            seconds = LONGEST + int(5.0 * took[item])
            resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + seconds, most))
            signal.alarm(IDLE * seconds)
            os.write(telling, number.to_bytes(2))
            if not passes(item, following):
                os._exit(1)
        os._exit(0)

    def end(self, status: int) -> tuple[str, pytest.Item]:
        """Return what became of the mutant, and the last test that was begun."""
        with os.fdopen(self.told, "rb") as told:
            last = self.items[int.from_bytes(told.read()[-2:])]
        code = os.waitstatus_to_exitcode(status)
        return "too long" if code in (-signal.SIGXCPU, -signal.SIGALRM) else "killed" if code else "survived", last


def finish(running: list[Fork], outcomes: dict[str, str], notices: dict[str, Counter[pytest.Item]]) -> None:
    """Wait for the end of one fork and note what became of it."""
    ended: list[Fork] = []
    while not ended:  # tests leave children of their own, which end, too
        process, status = os.wait()
        ended = [fork for fork in running if fork.process == process]
    running.remove(ended[0])
    mutant = ended[0].mutant
    outcomes[mutant], last = ended[0].end(status)
    if outcomes[mutant] != "survived":
        notices[mutant.rpartition("__mutmut_")[0]][last] += 1
