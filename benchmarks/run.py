"""Runs the benchmarks, prints the table and writes BENCHMARKS.md."""

import argparse
import importlib
import time

from rich.console import Console

from . import report
from .measure import ROOT, Row, duration

GROUPS = (
    "startup",
    "spd",
    "rotation",
    "icp",
    "matching",
    "transfer",
    "lengths",
    "large",
    "domain",
    "arm_fit",
    "success",
    "recovery",
    "tracking",
    "planning",
    "complete",
    "live",
    "live_door",
    "batch",
    "scale",
    "soak",
)
"""In this order. The start comes first since, in the same runs, its first fit took 1.8 s after minutes of full load and
1.3 to 1.5 s by itself; why was not found out, and a user begins with it."""


def main() -> None:
    """Parse, measure, print; write only after a complete run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", action="append", choices=GROUPS, help="run this group; may be given several times")
    parser.add_argument("--quick", action="store_true", help="smaller sizes and fewer repetitions, for development")
    options = parser.parse_args()
    console, rows, about = Console(), list[Row](), report.machine()
    if not console.is_terminal:
        console = Console(width=160)
    begin = time.perf_counter()
    for group in options.only or GROUPS:
        module = importlib.import_module(f"{__package__}.{group}")
        for row in module.rows(options.quick):
            rows.append(row)
            verdict = {True: "reached", False: "NOT reached", None: ""}[row.reached]
            console.print(f"{group}: {row.work}: {row.figure} ({row.wanted}) {verdict}", highlight=False)
    about["duration"] = duration(time.perf_counter() - begin)
    report.show(console, rows, about)
    if options.only or options.quick:
        console.print("BENCHMARKS.md is left as it is: only a complete run rewrites it.")
    else:
        report.write(ROOT / "BENCHMARKS.md", rows, about)
        console.print("Wrote BENCHMARKS.md.")
