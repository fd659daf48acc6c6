"""Kill commands that write, by SIGKILL and Ctrl-C at random moments, and count what is in place then: ``make kills``.

They run in children of a process that has everything loaded, so that the moments are those of the work.
"""

import argparse
import random
import signal
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from kills.trial import NAMES, strike, works


def main() -> int:
    """Strike all works, or some; the exit code is 1 if anything is half or missing, or ended with an error."""
    parser = argparse.ArgumentParser(prog="python -m kills", description="Kill commands at random moments.")
    parser.add_argument("works", nargs="*", default=NAMES, help=f"some of: {', '.join(NAMES)}; default: all")
    parser.add_argument("-n", type=int, default=200, help="strikes of each work by each signal")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    generator, bad = random.Random(arguments.seed), 0
    with TemporaryDirectory() as folder:
        every = works(Path(folder))
        for key in arguments.works:
            every[key].warm()
            for number in (signal.SIGKILL, signal.SIGINT):
                count = strike(every[key], number, arguments.n, generator, Path(folder) / "log")
                print(key, number.name, dict(count), flush=True)
                bad += sum(count.values()) - count["struck"] - count["old"] - count["new"]
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
