"""One run is struck at a random moment: what is in place then, and what is left beside it."""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from kills.works import HALF, MISSING, Command, Writer
from maniport import __main__ as entry_point

PATIENCE = 60.0
"""Longest time after which whoever was struck must have ended [s]."""


@dataclass
class Count:
    """What came of kills."""

    struck: int = 0
    old: int = 0
    new: int = 0
    half: int = 0
    missing: int = 0
    ended: int = 0
    left: int = 0
    cleaned: int = 0
    faults: list[str] = field(default_factory=list)


def forked(work: Command | Writer, which: int, log: Path) -> int:
    """Run in a child that has everything loaded; its process id."""
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # until the child is ready for it
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        return child
    code = 1
    try:
        signal.signal(signal.SIGINT, entry_point._end)
        tempfile.tempdir = str(work.target.parent)  # what is left there is seen, too
        with open(log, "w") as stream:
            os.dup2(stream.fileno(), 1)
            os.dup2(stream.fileno(), 2)
        sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        work.run(which)
        code = 0
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:  # noqa: BLE001 - a child must never return into the parent's work
        traceback.print_exc()
    finally:
        os._exit(code)


def cold(work: Command | Writer, which: int, log: Path) -> int:
    """Run the command as a user does, from the interpreter's start on; its process id."""
    command = [sys.executable, "-m", "maniport", *work.arguments(which)]
    environment = {**os.environ, "TMPDIR": str(work.target.parent)}
    with open(log, "w") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream, env=environment)
    process.returncode = 0  # it is waited for here, by its id
    return process.pid


def complete(work: Command | Writer, which: int, run: Callable[..., int], log: Path) -> float:
    """How long a complete run takes [s]."""
    began = time.monotonic()
    code = os.waitstatus_to_exitcode(os.waitpid(run(work, which, log), 0)[1])
    if code:
        raise RuntimeError(f"{work.name} ended with {code}: {log.read_text()}")
    return time.monotonic() - began


def ended(child: int) -> int | None:
    """Exit code of a child that was struck; None of one that goes on, which is ended."""
    for _ in range(int(PATIENCE / 0.002)):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def left(work: Command | Writer) -> set[str]:
    """What there is beside the result."""
    return {entry.name for entry in work.target.parent.iterdir() if entry != work.target}


def strike(work: Command | Writer, number: int, times: int, within: tuple[float, float], random_: random.Random,
           log: Path, run: Callable[..., int] = forked) -> Iterator[Count]:  # fmt: skip
    """Strike so many runs by a signal, one after the other, each at a moment of its length [s], evenly at random.

    Those that had ended by then are looked at, too, and counted by themselves. After each there is the count so far.
    """
    count = Count()
    while count.struck < times:
        before, earlier = work.state(), left(work)
        child = run(work, work.next(before), log)
        time.sleep(random_.uniform(*within))
        os.kill(child, number)
        code = ended(child)
        after, later = work.state(), left(work)
        count.struck += code != 0
        count.ended += code == 0
        count.half += after == HALF
        count.missing += after == MISSING
        count.old += after == before
        count.new += after not in (before, HALF, MISSING)
        count.left += len(later - earlier)
        count.cleaned += len(earlier - later)
        if code not in (0, 130 if number == signal.SIGINT else -number):
            count.faults.append(f"ended with {code}: {log.read_text()[-500:]}")
        if len(later) > 1 or (number == signal.SIGINT and later - earlier):
            count.faults.append(f"left: {later}")
        yield count
