"""How things are measured: races between two functions, rows of the table, fresh processes."""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SCALE_PLOT, BATCH_PLOT = (ROOT / "docs" / f"benchmark_{name}.png" for name in ("scale", "batch"))
SHORTEST = 0.005  # s
"""Work quicker than this is repeated inside one measurement, so that the clock's own cost disappears."""


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    work, ours, peer : str
        What is done, how maniport does at it, and how the peer does (empty where there is none).
    figure, wanted : str
        What was measured and what was asked for.
    reached : bool or None
        None where nothing was asked for.
    note : str
        What one has to know to believe the figure.
    """

    work: str
    ours: str
    peer: str
    figure: str
    wanted: str
    reached: bool | None
    note: str = ""


@dataclass(frozen=True)
class Race:
    """Least time of each function [s]."""

    ours: float
    peer: float

    @property
    def ratio(self) -> float:
        """How many times faster ours is."""
        return self.peer / self.ours


def race(ours: Callable[[], Any], peer: Callable[[], Any], seconds: float = 3.0, least: int = 3) -> Race:
    """Time two functions in turn, for `seconds` and at least `least` times each; the least time of each counts.

    Both run once before, which compiles what is compiled and fills the caches. Taking turns exposes both to the same
    disturbances, and a minimum forgets them.
    """
    times: tuple[list[float], list[float]] = [], []
    repeats = [_repeats(function) for function in (ours, peer)]
    end = time.perf_counter() + seconds
    while len(times[0]) < least or time.perf_counter() < end:
        for function, repeat, found in zip((ours, peer), repeats, times, strict=True):
            found.append(_timed(function, repeat))
    return Race(min(times[0]), min(times[1]))


def faster(work: str, result: Race, peer: str, wanted: float, note: str = "", valid: bool = True) -> Row:
    """Row that asks for a ratio; it is only reached when the results are `valid`, too."""
    return Row(
        work,
        duration(result.ours),
        f"{peer}: {duration(result.peer)}",
        f"{result.ratio:.3g}×",
        f"≥ {wanted:g}×",
        valid and result.ratio >= wanted,
        note,
    )


def within(work: str, value: float, limit: float, show: Callable[[float], str], note: str = "") -> Row:
    """Row that asks for a value at most `limit`."""
    return Row(work, show(value), "", show(value), f"≤ {show(limit)}", value <= limit, note)


def failed(work: str, wanted: str, reason: str) -> Row:
    """Row of work that could not be measured."""
    return Row(work, "–", "", "not measured", wanted, False, reason)


def duration(seconds: float) -> str:
    """Show a time with three digits and its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def megabytes(value: float) -> str:
    """Show an amount of memory."""
    return f"{value:.0f} MB"


def fresh_process(*arguments: str, timeout: float = 600.0) -> tuple[float, dict[str, Any]]:
    """Run Python in a new process; return its wall time [s] and the JSON of its last line of output (or nothing)."""
    begin = time.perf_counter()
    command = [sys.executable, *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, cwd=ROOT, check=False)
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"python {' '.join(arguments)} took longer than {timeout:g} s") from None
    wall = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} failed:\n{done.stderr[-2000:]}")
    lines = done.stdout.strip().splitlines()
    return wall, json.loads(lines[-1]) if lines else {}


def peak_memory() -> float:
    """Largest resident memory of this process so far [MB], libraries included."""
    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss also counts the parent that this process was forked from
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(line.split()[1]) / 1024
    import resource  # not on Windows

    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used / 2**20 if sys.platform == "darwin" else used / 1024


def _repeats(function: Callable[[], Any]) -> int:
    """Warm up, and find how many calls make one measurement."""
    if _timed(function, 1) > 1.0:
        return 1
    return max(1, round(SHORTEST / max(_timed(function, 1), 1e-7)))


def _timed(function: Callable[[], Any], repeats: int) -> float:
    begin = time.perf_counter()
    for _ in range(repeats):
        function()
    return (time.perf_counter() - begin) / repeats
