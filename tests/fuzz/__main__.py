"""Reads mutated files of every format in child processes and says what came of them: ``make fuzz``.

A child may use so much memory and time; one that is ended by a signal is counted, and the next takes over after the
file at which that happened. Files at fault are kept.
"""

import argparse
import resource
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from fuzz.targets import TARGETS
from fuzz.trial import READ, REFUSED, files, outcome

MEMORY = 3 * 2**30
"""Address space of a child beyond what it has when it starts [bytes]."""
SECONDS = 20
"""Longest time that one file may take."""


def child(name: str, start: int, stop: int) -> None:
    """Read mutations one after the other and say on standard output before each which, and after it what came of it."""
    target = TARGETS[name]
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"file{target.suffix}"
        for content in target.seeds():  # what is imported, compiled and built once does not count
            outcome(target, path, content)
        pages = Path("/proc/self/statm")
        if pages.exists():
            used = resource.getpagesize() * int(pages.read_text().split()[0])
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
        for number, content in files(target, name, start, stop):
            print(f"> {number}", flush=True)
            signal.alarm(SECONDS)
            began = time.monotonic()
            result = outcome(target, path, content)
            took = time.monotonic() - began
            signal.alarm(0)
            print(f"< {number} {took:.3f} {result}", flush=True)


def run(name: str, count: int, kept: Path) -> tuple[Counter[str], float]:
    """Read `count` mutations of a format; what came of them, and the longest time of one [s]."""
    results: Counter[str] = Counter()
    slowest, number, found = 0.0, 0, []
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
                result = words[3].strip()
                results[result] += 1
                if result not in (READ, REFUSED):
                    found.append(int(words[1]))
        code = process.wait()
        if started is None:
            raise RuntimeError(f"{name}: nothing was tried; see: {' '.join(command)}")
        if number < count:
            slow = f"not read after {SECONDS} s"
            results[
                slow if code == -signal.SIGALRM else f"ended by signal {-code}" if code < 0 else f"ended: {code}"
            ] += 1
            found.append(started)
            number = started + 1
    for one in found[:20]:
        target = TARGETS[name]
        kept.mkdir(parents=True, exist_ok=True)
        content = next(content for _, content in files(target, name, one, one + 1))
        (kept / f"{name}-{one}{target.suffix}").write_bytes(content)
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
        fault = sum(results.values())
        faults += fault
        took = time.monotonic() - began
        print(f"{name:14} {arguments.n:6} {read:6} {refused:8} {fault:6} {took:7.1f} {slowest:8.3f}", flush=True)
        for result, times in results.most_common():
            print(f"    {times} × {result}", flush=True)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
