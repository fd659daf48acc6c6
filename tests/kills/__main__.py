"""Kill commands that write, by SIGKILL and Ctrl-C at random moments, and count what is in place then: ``make kills``.

They run in children of a process that has everything loaded, so that the moments are those of the work.
"""

import argparse
import random
import signal
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from kills.trial import complete, strike
from kills.works import NAMES, Command, small, works


def main() -> int:
    """Strike all works, or some; the exit code is 1 if anything is half, missing or left."""
    parser = argparse.ArgumentParser(prog="python -m kills", description="Kill commands at random moments.")
    parser.add_argument("works", nargs="*", default=NAMES, help=f"some of: {', '.join(NAMES)}; default: all")
    parser.add_argument("-n", type=int, default=200, help="strikes of each work by each signal")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    generator, bad = random.Random(arguments.seed), 0
    print(f"{'work':10} {'by':7}  struck     old     new    half missing       s", flush=True)
    with TemporaryDirectory() as folder, small():
        log, every = Path(folder) / "log", works(Path(folder))
        for key in arguments.works:
            work = every[key]
            work.warm()
            longest = max(complete(work, which, log) for which in (1, 0)) if isinstance(work, Command) else 0.1
            for number in (signal.SIGKILL, signal.SIGINT):
                began = time.monotonic()
                *_, count = strike(work, number, arguments.n, longest, generator, log)
                figures = (count.struck, count.old, count.new, count.half, count.missing)
                shown = " ".join(f"{figure:7}" for figure in figures)
                print(f"{key:10} {number.name:7} {shown} {time.monotonic() - began:7.1f}", flush=True)
                print("".join(f"    {fault}\n" for fault in count.faults[:5]), end="")
                bad += count.half + count.missing + len(count.faults)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
