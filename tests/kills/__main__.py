"""Kills commands that write, by SIGKILL and Ctrl-C at random moments, and says what was in place then: ``make kills``.

Most run in children of a process that has everything loaded, so that the moments are those of the work; some are
started cold. At the end a complete run of each must leave nothing but its result.
"""

import argparse
import random
import signal
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from kills.trial import Count, cold, complete, forked, left, strike
from kills.works import NAMES, Command, small, works

LOOP = 0.1
"""Longest time after which the writer of folders is struck [s]; it writes one in milliseconds."""
TOLD = 50
"""After so many there is a line of what came of them so far."""
STARTED = 0.15
"""Python itself has started by then [s]: what Ctrl-C does before is its own affair."""


def line(name: str, by: str, count: Count, seconds: float) -> None:
    """Print what came of it so far."""
    figures = (count.struck, count.old, count.new, count.half, count.missing, count.ended, count.left, count.cleaned)
    print(f"{name:10} {by:7} " + " ".join(f"{figure:7}" for figure in figures) + f" {seconds:7.1f}", flush=True)
    for fault in count.faults[:5]:
        print(f"    {fault}", flush=True)


def main() -> int:
    """Strike all works, or some; the exit code is 1 when anything is half, missing or left."""
    parser = argparse.ArgumentParser(prog="python -m kills", description="Kills what writes, at random moments.")
    parser.add_argument("works", nargs="*", default=NAMES, help=f"some of: {', '.join(NAMES)}; default: all")
    parser.add_argument("-n", type=int, default=200, help="strikes of each work by each signal")
    parser.add_argument("--cold", type=int, default=20, help="strikes of commands that are started cold")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    random_, bad = random.Random(arguments.seed), 0
    print(f"{'work':10} {'by':7}   struck     old     new    half missing   ended    left cleaned       s", flush=True)
    with TemporaryDirectory() as folder, small():
        log, every = Path(folder) / "log", works(Path(folder))
        for key in arguments.works:
            work = every[key]
            run, times = (cold, arguments.cold // 2) if key == "cold" else (forked, arguments.n)
            if run is forked:
                work.warm()
            else:
                for which in (0, 1):
                    complete(work, which, run, log)
                    work.learn(which)
            longest = LOOP
            if isinstance(work, Command):
                longest = max(complete(work, which, run, log) for which in (1, 0))
            for number in (signal.SIGKILL, signal.SIGINT):
                began = time.monotonic()
                within = (STARTED if run is cold else 0.0, longest)
                for count in strike(work, number, times, within, random_, log, run):
                    if count.struck % TOLD == 0 and count.struck < times:
                        line(key, number.name, count, time.monotonic() - began)
                if isinstance(work, Command):
                    complete(work, 0, run, log)
                else:
                    work.warm()
                rest = left(work)
                line(key, number.name, count, time.monotonic() - began)
                print(f"    after a complete run there is beside the result: {rest or 'nothing'}", flush=True)
                bad += count.half + count.missing + len(count.faults) + len(rest)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
