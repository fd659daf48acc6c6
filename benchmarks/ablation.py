"""Ablation of placement and planning: each stage, weight and constant with and without it.

    python -m benchmarks.ablation run FILE.jsonl [--variants ...] [--robots ...] [--motions ...] [--seeds N]
    python -m benchmarks.ablation table FILE.jsonl [--base one-pass]

Every run places a path and plans a motion anew, on one core. A run that is in the file already is not repeated, so
that an interrupted study continues. The table compares each variant with a base on the same robots, motions and seeds:
median ratios of the rms distance, the duration and the computing time, and the spread of the seeds of the base.
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import maniport as mp
from maniport.bodies import VELOCITY, Arm
from maniport.demonstrations import fit_arm, read_recording, shipped_recording
from maniport.pipeline.follow import follow
from maniport.tracking import PlanControl
from maniport.tracking.effort import EFFORTS, FULL, QUICK, Detail, Effort
from maniport.tracking.placement import placement_search
from maniport.tracking.plan import plan, planner, shortest_path

from .inputs import DAMPING
from .tracking_motions import motions
from .tracking_robots import FILES, ROBOTS

BASE = EFFORTS[FULL]
ONE_PASS = replace(BASE, first=Detail(0.1, 0.55), rivals=False, again=False, gives_way=False)

VARIANTS: dict[str, Effort] = {
    "all": BASE,
    "quick": EFFORTS[QUICK],
    "one-pass": ONE_PASS,
    "one-pass, smoothness 0.3": replace(ONE_PASS, first=Detail(0.3, 0.55)),
    "one-pass, smoothness 1": replace(ONE_PASS, first=Detail(1.0, 0.55)),
    "one-pass + rivals": replace(ONE_PASS, rivals=True),
    "one-pass + restarts": replace(ONE_PASS, again=True),
    "one-pass + relaxation": replace(ONE_PASS, gives_way=True),
    "one-pass, placement: no improvement": replace(ONE_PASS, improved=0),
    "one-pass, placement: improved once": replace(ONE_PASS, improved=1),
    "one-pass, placement: joint descent": replace(ONE_PASS, improved=0, together=True),
    "one-pass, placement: joint descent, improved": replace(ONE_PASS, together=True),
    "one-pass, placement: 2 plans": replace(ONE_PASS, planned=2),
    "one-pass, placement: 1 plan": replace(ONE_PASS, planned=1),
    "one-pass, placement: 1024 candidates": replace(ONE_PASS, candidates=1024),
    "one-pass, placement: 12 samples": replace(ONE_PASS, samples=12),
    "one-pass, placement: 40 nodes": replace(ONE_PASS, place_nodes=40),
    "one-pass, placement: 40 stages": replace(ONE_PASS, place_stages=40),
    "one-pass, placement: 80 points": replace(ONE_PASS, placed_points=80),
    "one-pass, placement: 8 evaluations": replace(ONE_PASS, evaluations=8),
    "one-pass, 1 weight": replace(ONE_PASS, weights=1),
    "one-pass, 150 nodes": replace(ONE_PASS, nodes=150, most_nodes=150),
    "one-pass, 300 nodes": replace(ONE_PASS, nodes=300, most_nodes=300),
    "one-pass, stages of 1 s": replace(ONE_PASS, first=Detail(0.1, 1.0)),
    "one-pass, waypoints every 0.3 s": replace(ONE_PASS, piece=0.3),
    "one-pass, no waypoints between": replace(ONE_PASS, piece=1e9),
    "one-pass, coarse time grid": replace(ONE_PASS, fineness=0.16),
    "one-pass, stop at 1e-3": replace(ONE_PASS, enough=1e-3),
}
CONSTANTS: dict[str, tuple[Any, str, Any]] = {
    "one-pass, joint-motion weight 0.02": (shortest_path, "TRAVEL", 0.02),
    "one-pass, no jump penalty": (shortest_path, "LEAP", 0.0),
    "one-pass, planning time scale 2": (plan, "SLOWNESS", 2.0),
    "one-pass, no preference of small yaw": (placement_search, "EQUALLY_GOOD", 1.0),
    "one-pass, no minimum separation": (placement_search, "APART", 0.0),
    "one-pass, no slow-time speed limit": (planner, "QUICKEST", {"rad": 1e3, "m": 1e3}),
}
"""Module, name and value of a constant that a variant changes."""


def cases(names: list[str]) -> Iterator[tuple[str, Any, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, person, times [s], ellipsoids and hand path of the short motions and the two bundled recordings."""
    for motion in motions():
        if motion.name in names or not names:
            yield motion.name, motion.person, motion.robot_time, motion.profile, motion.hand
    for name in ("freeform", "ladder"):
        if name in names or not names:
            fit = fit_arm(read_recording(shipped_recording(name)), "myoarm")
            profile, path = fit.arm.ellipsoids(fit.joint_angles, VELOCITY), fit.arm.forward(fit.joint_angles)
            yield name, fit.arm, fit.time, profile, path[:, :3, 3]


def load(name: str) -> Arm:
    """Return a robot by name."""
    if name == "Panda":
        return mp.load_arm("panda")
    file, options = ROBOTS[name]
    return mp.load_arm(FILES / file, **options)


@contextmanager
def changed(name: str) -> Iterator[str]:
    """Register the search budget of a variant, with its constant changed; give the budget's name."""
    module, constant, value = CONSTANTS.get(name, (plan, "SLOWNESS", plan.SLOWNESS))
    before = getattr(module, constant)
    EFFORTS["ablation"] = VARIANTS.get(name, ONE_PASS)
    setattr(module, constant, value)
    defaults = shortest_path.shortest_path.__defaults__
    if constant == "TRAVEL":  # bound as a default argument and imported by the planner
        shortest_path.shortest_path.__defaults__, planner.TRAVEL = (value,), value
    try:
        yield "ablation"
    finally:
        setattr(module, constant, before)
        shortest_path.shortest_path.__defaults__, planner.TRAVEL = defaults, shortest_path.TRAVEL


def run(file: Path, variants: list[str], robots: list[str], names: list[str], seeds: int) -> None:
    """Append one line of JSON for each variant, robot, motion and seed."""
    done = {tuple(row[key] for key in ("variant", "robot", "motion", "seed")) for row in rows(file)}
    todo = list(cases(names))
    for robot in robots:
        arm = load(robot)
        student = mp.sample_domain(arm, 4096, 1)
        known = PlanControl().planner(arm, VELOCITY, 0)
        for name, person, clock, profile, path in todo:
            adapter = mp.ParallelTransport(damping=DAMPING, mounting=np.eye(3))
            adapter.fit(mp.sample_domain(person, 4096, 0), student)
            target, damping = adapter.transform(profile), adapter.student_regularization
            for seed in range(seeds):
                for variant in variants:
                    if (variant, robot, name, seed) in done:
                        continue
                    row: dict[str, Any] = {"variant": variant, "robot": robot, "motion": name, "seed": seed}
                    tolerance = 0.012 if name == "ladder" else 0.005
                    with changed(variant) as effort:
                        begin = time.process_time()
                        result = follow(
                            arm, target, clock, path, damping=damping, planner=known, effort=effort,
                            tip_tolerance=tolerance, random_state=seed,
                        )  # fmt: skip
                        row["seconds"] = time.process_time() - begin
                    motion = result.motion
                    row |= {
                        "rms": float(np.sqrt(np.mean(motion.distance**2))),
                        "duration": float(motion.control_time[-1]),
                        "error_p95": float(np.percentile(motion.position_error, 95)) / tolerance,
                        "error_max": float(motion.position_error.max()) / tolerance,
                        "collides": float(result.room.share),
                    }
                    with open(file, "a", encoding="utf-8") as stream:
                        stream.write(json.dumps(row) + "\n")


def rows(file: Path) -> list[dict[str, Any]]:
    """Return what was measured so far."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.is_file() else []


def table(file: Path, base: str) -> None:
    """Print a Markdown table of every variant beside the base."""
    by: dict[str, dict[tuple[Any, ...], dict[str, Any]]] = {}
    for row in rows(file):
        by.setdefault(row["variant"], {})[row["robot"], row["motion"], row["seed"]] = row
    reference = by[base]
    spreads: dict[tuple[Any, ...], list[float]] = {}
    for key, row in reference.items():
        spreads.setdefault(key[:2], []).append(row["rms"])
    spread = np.median([np.std(values) / np.mean(values) for values in spreads.values() if len(values) > 1] or [0.0])
    print(f"Base: {base}; seed spread of its rms distance: {spread:.1%} (median standard deviation over the mean)\n")
    print("| variant | runs | rms | 90th | duration | worst position error / tolerance | collisions | computing time |")
    print("|---|---|---|---|---|---|---|---|")
    for variant, found in by.items():
        shared = [key for key in found if key in reference]
        if not shared:
            continue
        ratio: Callable[[str], np.ndarray] = lambda what, found=found, shared=shared: np.array(  # noqa: E731
            [found[key][what] / reference[key][what] for key in shared]
        )
        worst, touching = (max(found[key][what] for key in shared) for what in ("error_max", "collides"))
        late = np.median([found[key]["error_p95"] for key in shared])
        print(
            f"| {variant} | {len(shared)} | {np.median(ratio('rms')) - 1:+.1%} | "
            f"{np.percentile(ratio('rms'), 90) - 1:+.1%} | {np.median(ratio('duration')) - 1:+.1%} | "
            f"{late:.2f} (95th), {worst:.1f} (max) | {touching:.1%} | ×{np.median(ratio('seconds')):.2f} |"
        )


def main() -> None:
    """Parse and run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True, dest="verb")
    runner, printer = verbs.add_parser("run"), verbs.add_parser("table")
    for verb in (runner, printer):
        verb.add_argument("file", type=Path)
    every = [*VARIANTS, *CONSTANTS]
    runner.add_argument("--variants", nargs="+", default=every, choices=every)
    runner.add_argument("--robots", nargs="+", default=["Panda", *ROBOTS], choices=["Panda", *ROBOTS])
    runner.add_argument("--motions", nargs="+", default=[])
    runner.add_argument("--seeds", type=int, default=5)
    printer.add_argument("--base", default="all")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.verb == "run":
        run(given.file, given.variants, given.robots, given.motions, given.seeds)
    else:
        table(given.file, given.base)


if __name__ == "__main__":
    main()
