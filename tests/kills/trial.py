"""Kill one run at a random moment; look at what is in place then, and what is left beside it."""

import os
import random
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from kills.works import HALF, MISSING, Command, Writer
from maniport import __main__ as entry_point


@dataclass
class Count:
    """Outcomes of kills."""

    struck: int = 0
    old: int = 0
    new: int = 0
    half: int = 0
    missing: int = 0
    faults: list[str] = field(default_factory=list)


def forked(work: Command | Writer, which: int, log: Path) -> int:
    """Run in a child that has everything loaded; return its process id."""
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # until the child is ready for it
    child = os.fork()
    if child:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
        return child
    code = 1
    try:
        signal.signal(signal.SIGINT, entry_point._interrupt)
        tempfile.tempdir = str(work.target.parent)  # leftovers there are seen, too
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


def complete(work: Command | Writer, which: int, log: Path) -> float:
    """Return how long a complete run takes [s]."""
    began = time.monotonic()
    code = os.waitstatus_to_exitcode(os.waitpid(forked(work, which, log), 0)[1])
    if code:
        raise RuntimeError(f"{work.name} ended with {code}: {log.read_text()}")
    return time.monotonic() - began


def ended(child: int, patience: float = 60.0) -> int | None:
    """Return the exit code of a child; None of one that goes on [s], which is ended."""
    for _ in range(int(patience / 0.002)):
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def left(work: Command | Writer) -> set[str]:
    """Return what is beside the result."""
    return {entry.name for entry in work.target.parent.iterdir() if entry != work.target}


def strike(
    work: Command | Writer, number: int, times: int, longest: float, generator: random.Random, log: Path
) -> Iterator[Count]:
    """Send a signal to so many runs, each at a random moment before `longest` [s]; yield the count after each."""
    count = Count()
    while count.struck < times:
        before, earlier = work.state(), left(work)
        child = forked(work, work.next(before), log)
        time.sleep(generator.uniform(0.0, longest))
        os.kill(child, number)
        code = ended(child)
        after, later = work.state(), left(work)
        count.struck += code != 0  # others had ended before
        count.half += after == HALF
        count.missing += after == MISSING
        count.old += after == before
        count.new += after not in (before, HALF, MISSING)
        if code not in (0, 130 if number == signal.SIGINT else -number):
            count.faults.append(f"ended with {code}: {log.read_text()[-500:]}")
        if number == signal.SIGINT and later - earlier:
            count.faults.append(f"left: {later}")
        yield count
