"""Reads mutated files of every format in child processes and prints the outcome: ``make fuzz``.

A child may use a limited amount of memory and time; one that ends by a signal is counted, and the next continues with
the following file. A file at fault is made again by its number.
"""

import argparse
import random
import resource
import signal
import subprocess
import sys
import traceback
import warnings
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from fuzz.mutations import mutated
from fuzz.targets import TARGETS, Target
from maniport.errors import ManiportError

MEMORY = 3 * 2**30
"""Address space of a child beyond what it has at its start [bytes]."""
SECONDS = 20
"""Longest time for one file."""
READ = "read"
REFUSED = "refused"
"""Right outcomes."""


def mutation(name: str, number: int) -> bytes:
    """Return a mutated file by its number: the same whenever it is made."""
    seeds = TARGETS[name].seeds()
    generator = random.Random(f"{name} {number}")
    return mutated(generator.choice(seeds), seeds, generator)


def outcome(target: Target, path: Path, content: bytes) -> str:
    """Write a file, read it, and return a word or a line about what happened."""
    path.write_bytes(content)
    try:
        target.read(path)
    except ManiportError:
        return REFUSED
    except Exception as error:  # noqa: BLE001 - any other is a fault
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = " ".join(str(error).split())[:120]
        return f"{type(error).__name__} at {Path(place.filename).name}:{place.lineno}: {text}"
    return READ


def child(name: str, start: int, stop: int) -> None:
    """Read mutations one after the other; print the outcome of each."""
    target = TARGETS[name]
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"file{target.suffix}"
        for content in target.seeds():  # imports and compilation do not count
            outcome(target, path, content)
        pages = Path("/proc/self/statm")
        if pages.exists():
            used = resource.getpagesize() * int(pages.read_text().split()[0])
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
        for number in range(start, stop):
            content = mutation(name, number)
            signal.alarm(SECONDS)
            result = outcome(target, path, content)
            signal.alarm(0)
            print(result, flush=True)


def run(name: str, count: int) -> Counter[str]:
    """Read `count` mutations of a format; return the outcomes, those at fault with the number of the first file."""
    results = []
    number = 0
    while number < count:
        command = [sys.executable, "-m", "fuzz", "--child", name, str(number), str(count)]
        ended = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False
        )
        results += ended.stdout.splitlines()
        if len(results) < count:
            alarm = ended.returncode == -signal.SIGALRM
            results.append(
                f"not read after {SECONDS} s" if alarm else f"ended with {ended.returncode}"
            )
        number = len(results)
    first = {result: f"{result} (first: {i})" for i, result in reversed([*enumerate(results)])}
    return Counter(result if result in (READ, REFUSED) else first[result] for result in results)


def main() -> int:
    """Run all formats, or some; the exit code is 1 when something is at fault."""
    warnings.simplefilter("ignore")
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
        return 0
    parser = argparse.ArgumentParser(
        prog="python -m fuzz", description="Reads mutated files of every format."
    )
    parser.add_argument("formats", nargs="*", help=f"some of: {', '.join(TARGETS)}; default: all")
    parser.add_argument("-n", type=int, default=10_000, help="mutations of each format")
    arguments = parser.parse_args()
    faults = 0
    for name in arguments.formats or TARGETS:
        results = run(name, arguments.n)
        faults += results.total() - results[READ] - results[REFUSED]
        print(name, dict(results), flush=True)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
