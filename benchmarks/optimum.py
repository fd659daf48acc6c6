"""How much motions differ by seed and by crops of milliseconds: ``python -m benchmarks.optimum FILE``.

Each pair of a clip and a robot is transferred with several seeds, each with the clip moved by some milliseconds. The
results are appended to FILE, one JSON object a line; runs that it has already are not repeated. With ``--reference``,
pairs are also transferred with twenty times the search.
"""

import argparse
import itertools
import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from unittest import mock

import numpy as np

import maniport as mp
from maniport.mocap import shipped_recording
from maniport.motion.plan import plan_options

ROBOTS = ("panda", "ur5", "xarm7", "iiwa", "kinova3", "g1_right_arm")
CLIPS = (
    ("freeform", 2.0, 3.0),
    ("freeform", 5.0, 6.2),
    ("freeform", 0.5, 2.5),
    ("freeform", 1.0, 7.0),
    ("ladder", 10.0, 13.0),
    ("ladder", 20.0, 21.5),
    ("ladder", 22.0, 26.0),
    ("ladder", 5.0, 15.0),
)
CROPS = ((0, 0.0), (1, 0.03), (2, -0.03), (3, 0.01))  # seed, and shift of the clip [s]
SEARCH = 20  # times as many placements in the reference


@dataclass(frozen=True)
class Run:
    """One transfer."""

    recording: str
    start: float
    stop: float
    robot: str
    seed: int
    shift: float
    reference: bool = False


def transferred(run: Run) -> dict[str, float]:
    """Transfer a clip; return what its motion is measured by."""
    budget = plan_options.DEFAULT_BUDGET
    if run.reference:
        rounds = [each._replace(kept=SEARCH * each.kept) for each in budget.rounds[:-1]]
        budget = replace(
            budget, candidates=SEARCH * budget.candidates, rounds=(*rounds, budget.rounds[-1])
        )
    begin = time.process_time()
    with mock.patch.object(plan_options, "DEFAULT_BUDGET", budget):
        result = mp.transfer_recording(
            shipped_recording(run.recording),
            robot=run.robot,
            start=run.start + run.shift,
            stop=run.stop + run.shift,
            seed=run.seed,
            capability="none",
        )
    motion = result.arm.motion
    return {
        "rms": float(np.sqrt(np.mean(motion.distance**2))),
        "position_error_95_mm": 1e3 * float(np.percentile(motion.position_error, 95.0)),
        "duration_s": float(motion.control_time[-1]),
        "colliding": float(result.motion.clearance.share),
        "processor_s": time.process_time() - begin,
    }


def runs(clips: int, robots: list[str], reference: bool) -> Iterator[Run]:
    """Return all runs; a reference is of each fifth pair, with the first seed."""
    pairs = itertools.product(CLIPS[:clips], robots)
    for i, ((recording, start, stop), robot) in enumerate(pairs):
        for seed, shift in CROPS:
            yield Run(recording, start, stop, robot, seed, shift)
        if reference and i % 5 == 0:
            yield Run(recording, start, stop, robot, *CROPS[0], reference=True)


def printed(records: list[Mapping[str, float]], pair: str, gap: str) -> str:
    """Return a row of the table of a pair."""
    rms = np.array([record["rms"] for record in records])
    means = [
        np.mean([record[name] for record in records])
        for name in ("duration_s", "position_error_95_mm", "processor_s")
    ]
    spread = 100.0 * rms.std(ddof=1) / rms.mean()
    return (
        f"| {pair} | {rms.mean():.3f} | {rms.max():.3f} | {spread:.1f} % | {gap} | "
        f"{means[0]:.1f} | {means[1]:.1f} | {means[2]:.1f} |"
    )


def main() -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.optimum", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--clips", type=int, default=len(CLIPS), help="number of clips")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    parser.add_argument("--reference", action="store_true")
    options = parser.parse_args()
    known = {}
    if options.file.exists():
        for line in options.file.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            known[Run(**record["run"])] = record["result"]
    wanted = list(runs(options.clips, options.robots, options.reference))
    for run in wanted:
        if run not in known:
            known[run] = transferred(run)
            line = json.dumps({"run": vars(run), "result": known[run]})
            with options.file.open("a", encoding="utf-8") as file:
                file.write(f"{line}\n")

    print("| clip → robot | rms | largest | sd | gap | s | 95 % [mm] | processor s |")
    print("|---|---|---|---|---|---|---|---|")
    grouped = itertools.groupby(wanted, lambda run: (run.recording, run.start, run.stop, run.robot))
    for (recording, start, stop, robot), of_pair in grouped:
        pair_runs = list(of_pair)
        records = [known[run] for run in pair_runs if not run.reference]
        gap = "–"
        for run in pair_runs:
            if run.reference:
                gap = f"{100.0 * (records[0]['rms'] / known[run]['rms'] - 1.0):.1f} %"
        print(printed(records, f"{recording} {start:g}–{stop:g} s → {robot}", gap))


if __name__ == "__main__":
    main()
