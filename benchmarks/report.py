"""The table on the terminal and in BENCHMARKS.md, with the machine it was measured on."""

import datetime
import importlib.metadata
import os
import platform
from pathlib import Path

import numba
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_info

from .measure import BATCH_PLOT, ROOT, SCALE_PLOT, Row

PACKAGES = (
    "maniport",
    "numpy",
    "scipy",
    "numba",
    "scikit-learn",
    "joblib",
    "pin",
    "pin-pink",
    "daqp",
    "pyriemann",
    "pymanopt",
    "autograd",
    "roboticstoolbox-python",
)

INTRODUCTION = """\
# Benchmarks

Written by `make bench` (about half an hour on two cores). Every comparison is a race in one process: both
sides take turns on the same input, and the least time of each counts. The results are compared, too: a line is only
reached when both agree, or when both meet the stated tolerance. All numbers are float64.
"""

MARKS = {True: "yes", False: "**no**", None: ""}


PICTURES = (
    (
        "Time and peak memory of a fit",
        SCALE_PLOT,
        "A complete ICP fit with N ellipsoids on each side, human → Panda, each in a process of its own.\n"
        "The memory includes the libraries; before the fit it holds both domains. One matrix of N × N scores\n"
        "would take 80 GB at N = 100,000.",
    ),
    (
        "Time of a batch",
        BATCH_PLOT,
        "Batches of 48 and of 200 recordings × 2 robots by two processes, without pages; the maps of 10 persons are\n"
        "fitted once in each.",
    ),
)
"""What grows: a picture's name, its file and what it shows."""


def machine() -> dict[str, str]:
    """Where and with what the figures were measured."""
    load = f"; load average at the start {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    blas = max((pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"), default=1)
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": f"{_processor()}, {os.cpu_count()} cores{_memory()}{load}",
        "threads": f"up to {numba.config.NUMBA_NUM_THREADS} of Numba, {blas} of BLAS, as both come",
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        "packages": versions,
    }


def show(console: Console, rows: list[Row], about: dict[str, str]) -> None:
    """Print everything."""
    table = Table(title="maniport against others", show_lines=True)
    for name in ("work", "ours", "peer", "figure", "wanted", "reached"):
        table.add_column(name, overflow="fold")
    for row in rows:
        style = {True: "green", False: "red", None: ""}[row.reached]
        mark = {True: "yes", False: "no", None: ""}[row.reached]
        work = f"{row.work}\n[dim]{row.note}[/dim]" if row.note else row.work
        table.add_row(work, row.ours, row.peer, row.figure, row.wanted, mark, style=style)
    console.print(table)
    for name, value in about.items():
        console.print(f"{name}: {value}", highlight=False)
    console.print(_verdict(rows))


def write(path: Path, rows: list[Row], about: dict[str, str]) -> None:
    """Write BENCHMARKS.md."""
    lines = [INTRODUCTION, *(f"- {name}: {value}" for name, value in about.items()), "", _verdict(rows), ""]
    lines += ["| work | ours | peer | figure | wanted | reached |", "|---|---|---|---|---|---|"]
    notes: list[str] = []
    for row in rows:
        mark = ""
        if row.note:
            notes.append(row.note)
            mark = f" [{len(notes)}]"
        cells = (row.work + mark, row.ours, row.peer, row.figure, row.wanted, MARKS[row.reached])
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    lines += ["", *(f"{number}. {note}" for number, note in enumerate(notes, start=1)), ""]
    pictures = [
        f"![{name}]({file.relative_to(ROOT).as_posix()})\n\n*{told}*\n"
        for name, file, told in PICTURES
        if file.exists()
    ]
    lines += ["## Growth\n", *pictures] if pictures else []
    path.write_text("\n".join(lines), encoding="utf-8")


def _verdict(rows: list[Row]) -> str:
    asked = [row for row in rows if row.reached is not None]
    missed = [row.work for row in asked if not row.reached]
    return f"{len(asked) - len(missed)} of {len(asked)} targets reached." + (
        f" Not reached: {'; '.join(missed)}." if missed else ""
    )


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


def _memory() -> str:
    try:
        size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    except (AttributeError, OSError, ValueError):
        return ""
    return f", {size:.0f} GB"
