"""The second process of the main job: it compiles what is missing, and takes on work that can be done meanwhile.

Whatever it does the first process would do alike: results are the same, bit for bit, with it and without, and where it
is ended from outside the first one goes on alone.
"""

import gc
import importlib
import os
import pickle
import subprocess
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, TypeVar

from numba import config

from maniport import ahead, aside, compiling
from maniport.errors import ManiportWarning
from maniport.orphans import end_with_parent
from maniport.start import ONE_THREAD
from maniport.steps import Progress, Step

T = TypeVar("T")

LOADED = "maniport.telling.figures", "maniport.telling.page.motions"
"""Modules of the work that is mostly handed over, loaded while nobody asks for anything."""
WANTED = "maniport.tracking.plan.stages", "maniport.telling.page.motions"
"""Modules that the first process needs later, loaded while it waits for a result."""

SELDOM = 5_000, 50, 100
"""How seldom it looks for what nobody refers to: Python's own habit takes 9 % of the time of compiling."""


@contextmanager
def helped(progress: Progress | None = None) -> Iterator[None]:
    """Have a second process beside the block where there is a processor for it, and tell what it compiles."""
    one = _Second(progress)
    if config.NUMBA_NUM_THREADS > 1 and not config.DISABLE_JIT:
        compiling.beside, aside.helper = one.compiled, one
        one.start()
    try:
        yield
    finally:
        compiling.beside = aside.helper = None
        one.end()


class _Task:
    """Work that was handed over, and what came out: (result, warnings), None where it has to be done again."""

    def __init__(self, here: Callable[[], Any], pickled: bytes):
        self.here, self.pickled = here, pickled
        self.found: tuple[Any, list[Warning]] | None = None
        self.over = False


class _Second:
    """The second process, seen from the first."""

    def __init__(self, progress: Progress | None):
        self._progress = progress
        self._process: subprocess.Popen[bytes] | None = None
        self._changed = threading.Condition()
        self._compiles = ""
        self._waiting, self._begun = deque[_Task](), deque[_Task]()
        self._bridges: list[Callable[[], object]] = [partial(importlib.import_module, module) for module in WANTED]
        self._free = False
        self._alone = threading.Lock()
        self._claimed = set[str]()
        self._last = ahead.compile_missing(self._claim, reversed(ahead.FIRST + ahead.REST))
        self._listener = threading.Thread(target=self._listen, daemon=True, name="maniport-second")

    def start(self) -> None:
        """Start it."""
        alone = {**os.environ, "NUMBA_NUM_THREADS": "1", **dict.fromkeys(ONE_THREAD, "1")}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "maniport.second", str(os.getpid()), *LOADED],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=alone,
        )  # fmt: skip
        self._listener.start()

    def compiled(self, name: str) -> bool:
        """Wait where it is compiling a function that is missing; return whether it was.

        Meanwhile what it would come to last is compiled here: all of it is needed.
        """
        if self._claim(name):
            return False
        more = True
        while more and self._compiles == name and self._alone.acquire(blocking=False):  # once at a time
            try:
                more = next(self._last, None) is not None
            finally:
                self._alone.release()
        with self._changed:
            self._changed.wait_for(lambda: self._compiles != name)
        return True

    def _claim(self, name: str) -> bool:
        """Whether a function may be compiled here, which the second process then leaves alone."""
        with self._changed:
            if self._compiles == name:
                return False
            self._claimed.add(name)
            return True

    def take(self, work: Callable[[], T], here: Callable[[], T]) -> Callable[[], T]:
        """Let it do some work when it has time; what it has not begun when the result is wanted is done here."""
        try:
            task = _Task(here, pickle.dumps(work))
        except (pickle.PicklingError, TypeError, AttributeError, RuntimeError):  # there are such adapters and arms
            return here
        with self._changed:
            self._waiting.append(task)
            self._hand_over()
        return partial(self._result, task)

    def bridge(self, work: Callable[[], object]) -> None:
        """Do some work here while the next result is waited for, if it is."""
        self._bridges.append(work)

    def end(self) -> None:
        """Nobody waits for what is left to do."""
        if self._process is not None:
            self._process.kill()
            self._listener.join()
            self._process.wait()
            assert self._process.stdin is not None
            with suppress(OSError):
                self._process.stdin.close()

    def _result(self, task: _Task) -> Any:
        with self._changed:
            if task in self._waiting:
                self._waiting.remove(task)
                task.over = True
        while self._bridges and not task.over:
            self._bridges.pop(0)()
        with self._changed:
            self._changed.wait_for(lambda: task.over)
        if task.found is None:
            return task.here()
        value, said = task.found
        for one in said:
            warnings.warn(one, stacklevel=3)
        return value

    def _hand_over(self) -> None:
        """Send a task where one waits and is waited for; the condition is held."""
        if self._free and self._waiting:
            self._free = False
            self._hand_one()

    def _hand_one(self) -> None:
        self._begun.append(self._waiting.popleft())
        self._send(self._begun[-1].pickled)

    def _send(self, message: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(OSError):  # where it has ended, which the listener sees as well
            self._process.stdin.write(message)
            self._process.stdin.flush()

    def _listen(self) -> None:
        """Note what it says, and answer.

        That is the name of each function before it compiles it, or would if no work waits; that it is free; and what
        came out of work.
        """
        assert self._process is not None
        assert self._process.stdout is not None
        step, count = None, 0
        with self._process.stdout as messages:
            while True:
                try:
                    kind, content = pickle.load(messages)
                except (EOFError, OSError, pickle.UnpicklingError):  # it has ended
                    break
                with self._changed:
                    self._compiles = ""
                    if kind == "would" and self._waiting:
                        self._hand_one()
                        kind = "works"
                    elif kind in ("compiles", "would"):
                        self._compiles = "" if content in self._claimed else content
                        self._send(pickle.dumps(bool(self._compiles)))
                    elif kind == "free":
                        self._free = True
                    elif kind == "done":
                        task = self._begun.popleft()
                        task.found, task.over = content, True
                    self._hand_over()
                    self._changed.notify_all()
                if kind in ("compiles", "would"):
                    step = step or Step(self._progress, "compile for this machine, once")
                    count += 1
                    step(count / len(ahead.FIRST + ahead.REST))
                elif kind == "free" and step is not None:
                    step.end(f"{count} functions")
                    step = None
        with self._changed:
            self._compiles, self._free = "", False
            for task in self._begun:
                task.over = True
            self._changed.notify_all()


def _done(work: Callable[[], Any]) -> bytes:
    """Do some work; return what came out, pickled, with what it warned of. What fails is to be done again, there."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            found = work()
        said = [one.message for one in caught if issubclass(one.category, ManiportWarning)]
        return pickle.dumps(("done", (found, said)))
    except Exception:  # noqa: BLE001  the first process meets it as well, and tells it
        return pickle.dumps(("done", None))


def main() -> None:
    """Compile what is missing and do what is handed over; end when nobody listens.

    What is handed over goes before what only the first process needs.
    """
    end_with_parent(int(sys.argv[1]))
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # what is printed on the way is no message

        def say(message: bytes) -> None:
            out.write(message)
            out.flush()

        def claim(kind: str, name: str) -> bool:
            say(pickle.dumps((kind, name)))
            while not isinstance(answer := pickle.load(sys.stdin.buffer), bool):
                say(_done(answer))
                say(pickle.dumps((kind, name)))
            return answer

        gc.set_threshold(*SELDOM)
        try:
            for _ in ahead.compile_missing(partial(claim, "compiles"), ahead.FIRST):
                pass
            for module in sys.argv[2:]:
                importlib.import_module(module)
            for _ in ahead.compile_missing(partial(claim, "would"), ahead.REST):
                pass
            while True:
                say(pickle.dumps(("free", None)))
                say(_done(pickle.load(sys.stdin.buffer)))
        except (BrokenPipeError, EOFError):
            os._exit(0)


if __name__ == "__main__":
    main()
