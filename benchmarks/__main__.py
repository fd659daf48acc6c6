"""Measure computing times and write BENCHMARKS.md: ``python -m benchmarks``."""

import argparse
import datetime
import importlib
import importlib.metadata
import os
import platform
from pathlib import Path

from .measure import ROOT, Row

GROUPS = ("startup", "spd", "icp", "transfer", "arms", "live", "batch", "recordings", "recovery")
PACKAGES = (
    "maniport",
    "numpy",
    "scipy",
    "numba",
    "pin",
    "daqp",
    "pyriemann",
    "pymanopt",
    "roboticstoolbox-python",
)
INTRODUCTION = """\
# Benchmarks

Written by `make bench` on an idle machine. A comparison runs both sides in turn in one process on the same float64
input; the least time of each counts. A bound is only met if the results agree. Results of motions are in the
[evaluation](docs/evaluation.md); `scripts/characterize.py` measures them.
"""


def main() -> None:
    """Parse, measure, print, and write the file after a complete run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", action="append", choices=GROUPS, help="group to run; repeatable")
    parser.add_argument("--quick", action="store_true", help="smaller sizes and fewer repetitions")
    options = parser.parse_args()
    load = os.getloadavg()[0]
    rows: list[Row] = []
    for group in options.only or GROUPS:
        for row in importlib.import_module(f"{__package__}.{group}").rows(options.quick):
            rows.append(row)
            print(row.markdown(), flush=True)
    if options.only or options.quick:
        print("BENCHMARKS.md is not changed: only a complete run writes it.")
        return
    (ROOT / "BENCHMARKS.md").write_text(report(rows, load), encoding="utf-8")


def report(rows: list[Row], load: float) -> str:
    """Return the content of BENCHMARKS.md."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    bounded = [row for row in rows if row.met is not None]
    missed = [row.work for row in bounded if not row.met]
    verdict = f"{len(bounded) - len(missed)} of {len(bounded)} bounds are met."
    if missed:
        verdict += f" Missed: {'; '.join(missed)}."
    lines = [
        INTRODUCTION,
        f"- date: {datetime.datetime.now(datetime.UTC).date().isoformat()}",
        f"- machine: {processor()}, {os.cpu_count()} cores, load average at the start {load:.1f}",
        f"- system: {platform.system()} {platform.machine()}, Python {platform.python_version()}",
        f"- packages: {versions}",
        "",
        verdict,
        "",
        "| work | maniport | peer | ratio | bound | met | note |",
        "|---|---|---|---|---|---|---|",
        *(row.markdown() for row in rows),
    ]
    return "\n".join(lines) + "\n"


def processor() -> str:
    """Return the model of the processor."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"


if __name__ == "__main__":
    main()
