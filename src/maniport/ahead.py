"""What the main job compiles when it first runs on a machine is compiled by a second process while it works.

Both keep what they compile in one cache. The one that works takes what is there, compiles what nobody has begun, and
waits for what the other one is at.
"""

import importlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import config, types
from numba.core.errors import NumbaError

from maniport import compiling
from maniport.steps import Progress, Step

NEEDED = """
spd.kernels.loops.eigh_loop f3 f2 f3 i i f2
spd.kernels.loops.compose_loop f2 f3 f3 i i f2
spd.kernels.loops.moments_loop f3 f3 f1 f1 f1 b i i f2
spd.kernels.loops.congruence_loop f3 i f3 i f3 i i f2
spd.kernels.loops.distance_loop f3 i f3 i f1 i i f2
spd.kernels.loops.eigh_loop f3 f2 f3 i i f1
spd.kernels.loops.compose_loop f2 f3 f3 i i f1
spd.kernels.loops.congruence_loop f3 i f3 i f3 i i f1
spd.kernels.loops.power_loop f3 f3 f f3 f f f3 i i f2
spd_check.vouch f3 f3 f f f f b
bodies.collisions.kernels.poses_of f2 f3 f2 b1 f4 f3
bodies.collisions.kernels.fill_room f4 f3 f2 i1 i1 f2 f2 i2 f1 f b2 f2
bodies.manipulability_jacobian._derivatives f3 f3 f2 f2 b f4
tracking.kernels.step_within_limits f2 f2 f3 f1 r1 r1 f2 f1
tracking.kernels.add_residual f2 f3 f2 f3
tracking.kernels.add_log_residual f2 f3 f4 f2 f3
transfer.cloud_kernels.sum_distances f2 f3 f2 f1 f2
transfer.cloud_kernels.nearest_distances f2 f3 f1
transfer.icp.correspondence.match_tree._search f2 f2 i1 i2 f4 f4 b1 f2 f3 f3 f3 f3 i1 f1
transfer.icp.correspondence.match_tree._most_promising f2 f2 f3 f3 f3 f3 i1
transfer.so3.minimize f3 f3 f3 f1 f2 f i f2
transfer.lengths.kernels.field_loop f3 f1 f2 f2 f2 f2 f2 f1 f3 i i f2
tracking.plan.shortest_path._values f2 f1 i1 f1 f1 f2 f f
tracking.kernels.log_slopes f2
""".strip().split("\n")
"""Functions and the types of their arguments: `f`, `i`, `b` numbers, whole ones, truth values; with a digit contiguous
arrays of so many dimensions, `r` read-only ones. What is imported quickly comes first, then what is needed first."""

KINDS: dict[str, Any] = {"f": types.float64, "r": types.float64, "i": types.int64, "b": types.boolean}
QUICK = "spd"
"""Begins the names of functions that are imported at once."""


@contextmanager
def helped(progress: Progress | None = None) -> Iterator[None]:
    """Let a second process compile ahead of the block, where something is missing and there is a processor for it."""
    beside = _Beside(progress)
    if config.NUMBA_NUM_THREADS > 1 and not config.DISABLE_JIT:
        compiling.beside = beside.compiled
        if any(compiling.is_missing(*_kernel(line)) for line in NEEDED if line.startswith(QUICK)):
            beside.start()
    try:
        yield
    finally:
        compiling.beside = None
        beside.end()


class _Beside:
    """The second process, started with the first function that is missing."""

    def __init__(self, progress: Progress | None):
        self._progress = progress
        self._process: subprocess.Popen[str] | None = None
        self._changed = threading.Condition()
        self._now = ""
        self._listener = threading.Thread(target=self._listen, daemon=True, name="maniport-ahead")

    def start(self) -> None:
        """Start the second process, once."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "maniport.ahead"],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
            self._listener.start()

    def compiled(self, name: str) -> bool:
        """Wait where the second process is compiling a function that is missing; return whether it was."""
        self.start()
        with self._changed:
            if self._now != name:
                return False
            self._changed.wait_for(lambda: self._now != name)
            return True

    def end(self) -> None:
        """Nobody waits for what is left to compile."""
        if self._process is not None:
            self._process.kill()
            self._listener.join()
            self._process.wait()

    def _listen(self) -> None:
        """Note what the second process is at, which tells the name of each function before it compiles it."""
        assert self._process is not None
        assert self._process.stdout is not None
        step, count = Step(self._progress, "compile for this machine, once"), 0
        with self._process.stdout as lines:
            for count, line in enumerate(lines):
                self._note(line.strip())
                step(count / len(NEEDED))
        self._note("")
        if count == len(NEEDED):
            step.end(f"{count} functions")

    def _note(self, name: str) -> None:
        with self._changed:
            self._now = name
            self._changed.notify_all()


def _kernel(line: str) -> tuple[Any, tuple[Any, ...]]:
    """Import a function of `NEEDED`; return it and the types of its arguments."""
    place, *words = line.split()
    module, _, name = place.rpartition(".")
    arguments = [
        KINDS[word[0]] if len(word) == 1 else types.Array(KINDS[word[0]], int(word[1]), "C", readonly=word[0] == "r")
        for word in words
    ]
    return getattr(importlib.import_module(f"maniport.{module}"), name), tuple(arguments)


def main() -> None:
    """Compile all that is needed, and tell which function is next; end when nobody listens."""
    try:
        for line in NEEDED:
            try:
                kernel, arguments = _kernel(line)
                print(compiling.name_of(kernel.py_func, arguments), flush=True)
                kernel.compile(arguments)
            except (AttributeError, TypeError, NumbaError) as error:  # of a function that changed: the others are left
                print(f"{line}: {error}", file=sys.stderr)
        print("", flush=True)  # done
    except BrokenPipeError:
        os._exit(0)


if __name__ == "__main__":
    main()
