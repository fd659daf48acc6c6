"""Comparisons of two functions, rows of the table, and fresh processes."""

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SHORTEST = 0.005  # shorter work is repeated within one measurement [s]


@dataclass(frozen=True)
class Row:
    """One row of the table."""

    work: str
    ours: str
    peer: str = ""
    ratio: str = ""
    bound: str = ""
    met: bool | None = None  # None without a bound
    note: str = ""

    def markdown(self) -> str:
        """Return the row of the Markdown table."""
        met = {True: "yes", False: "**no**", None: ""}[self.met]
        cells = self.work, self.ours, self.peer, self.ratio, self.bound, met, self.note
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


@dataclass(frozen=True)
class Times:
    """Least time of both functions [s]."""

    ours: float
    peer: float


def compare(
    ours: Callable[[], Any], peer: Callable[[], Any], seconds: float = 3.0, least: int = 3
) -> Times:
    """Time two functions in turn, for `seconds` and at least `least` times each, after one call that compiles."""
    times: tuple[list[float], list[float]] = [], []
    repeats = [_repeats(function) for function in (ours, peer)]
    end = time.perf_counter() + seconds
    while len(times[0]) < least or time.perf_counter() < end:
        for function, repeat, measured in zip((ours, peer), repeats, times, strict=True):
            measured.append(_timed(function, repeat))
    return Times(min(times[0]), min(times[1]))


def faster(
    work: str, times: Times, peer: str, bound: float, note: str = "", agrees: bool = True
) -> Row:
    """Make a row with a least ratio, which also needs results that agree."""
    ratio = times.peer / times.ours
    return Row(
        work,
        duration(times.ours),
        f"{peer}: {duration(times.peer)}",
        f"{ratio:.3g}×",
        f"≥ {bound:g}×",
        agrees and ratio >= bound,
        note,
    )


def within(
    work: str, value: float, bound: float, text: Callable[[float], str], note: str = ""
) -> Row:
    """Make a row with a largest value."""
    return Row(work, text(value), bound=f"≤ {text(bound)}", met=value <= bound, note=note)


def duration(seconds: float) -> str:
    """Format a time with three digits and its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def megabytes(value: float) -> str:
    """Format an amount of memory."""
    return f"{value:.0f} MB"


def fresh_process(*arguments: str, timeout: float = 3600.0) -> dict[str, Any]:
    """Run Python in a new process; return the JSON of its last line of output."""
    command = [sys.executable, *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=timeout, cwd=ROOT, check=False
    )
    if done.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} failed:\n{done.stderr[-2000:]}")
    content: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return content


def peak_memory() -> float:
    """Return the largest resident memory of this process so far, libraries included [MB]."""
    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss also counts the parent of a fork
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(line.split()[1]) / 1024
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used / 2**20 if sys.platform == "darwin" else used / 1024


def _repeats(function: Callable[[], Any]) -> int:
    if _timed(function, 1) > 1.0:
        return 1
    return max(1, round(SHORTEST / max(_timed(function, 1), 1e-7)))


def _timed(function: Callable[[], Any], repeats: int) -> float:
    begin = time.perf_counter()
    for _ in range(repeats):
        function()
    return (time.perf_counter() - begin) / repeats
