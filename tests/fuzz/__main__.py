"""Reads mutated files of every format in child processes and prints the outcome: ``make fuzz``.

A child may use a limited amount of memory and time; one that ends by a signal is counted, and the next continues with
the following file. Files at fault are kept.
"""

import argparse
import random
import resource
import signal
import subprocess
import sys
import time
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
READ, REFUSED = "read", "refused"
"""Right outcomes."""


def mutation(name: str, number: int) -> bytes:
    """Return a mutated file by its number: the same whenever it is made."""
    seeds, generator = TARGETS[name].seeds(), random.Random(f"{name} {number}")
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
        return f"{type(error).__name__} at {Path(place.filename).name}:{place.lineno}: {str(error)[:120]}"
    return READ


def child(name: str, start: int, stop: int) -> None:
    """Read mutations one after the other; print the number before each, and the outcome after it."""
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
            print(f"> {number}", flush=True)
            signal.alarm(SECONDS)
            began = time.monotonic()
            result = outcome(target, path, content)
            signal.alarm(0)
            print(f"< {number} {time.monotonic() - began:.3f} {result}", flush=True)


def run(name: str, count: int, kept: Path) -> tuple[Counter[str], float]:
    """Read `count` mutations of a format; return the outcomes and the longest time [s]."""
    results: Counter[str] = Counter()
    slowest, number, faults = 0.0, 0, []
    while number < count:
        command = [sys.executable, "-m", "fuzz", "--child", name, str(number), str(count)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        started = None
        for line in process.stdout or ():
            words = line.split(maxsplit=3)
            if words[:1] == [">"]:
                started = int(words[1])
            elif words[:1] == ["<"]:
                number, slowest = int(words[1]) + 1, max(slowest, float(words[2]))
                results[words[3].strip()] += 1
                faults += [] if words[3].strip() in (READ, REFUSED) else [int(words[1])]
        code = process.wait()
        if started is None:
            raise RuntimeError(f"{name}: nothing was read; see: {' '.join(command)}")
        if number < count:
            results[f"not read after {SECONDS} s" if code == -signal.SIGALRM else f"ended with {code}"] += 1
            faults.append(started)
            number = started + 1
    for fault in faults[:20]:
        kept.mkdir(parents=True, exist_ok=True)
        (kept / f"{name}-{fault}{TARGETS[name].suffix}").write_bytes(mutation(name, fault))
    return results, slowest


def main() -> int:
    """Run all formats, or some; the exit code is 1 when something is at fault."""
    warnings.simplefilter("ignore")
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
        return 0
    parser = argparse.ArgumentParser(prog="python -m fuzz", description="Reads mutated files of every format.")
    parser.add_argument("formats", nargs="*", help=f"some of: {', '.join(TARGETS)}; default: all")
    parser.add_argument("-n", type=int, default=10_000, help="mutations of each format")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-found"), help="folder for files at fault")
    arguments = parser.parse_args()
    faults = 0
    print(f"{'format':14} {'files':>6} {'read':>6} {'refused':>8} {'faults':>6} {'s':>7} {'slowest':>8}", flush=True)
    for name in arguments.formats or TARGETS:
        began = time.monotonic()
        results, slowest = run(name, arguments.n, arguments.keep)
        read, refused = results.pop(READ, 0), results.pop(REFUSED, 0)
        faults += results.total()
        took, fault = time.monotonic() - began, results.total()
        print(f"{name:14} {arguments.n:6} {read:6} {refused:8} {fault:6} {took:7.1f} {slowest:8.3f}", flush=True)
        for result, times in results.most_common():
            print(f"    {times} × {result}", flush=True)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
