"""Ablation of placement and planning: the planner without each of its stages, and with other values of its constants.

    python -m benchmarks.ablation run FILE.jsonl [--variants ...] [--robots ...] [--motions ...] [--seeds N]
    python -m benchmarks.ablation table FILE.jsonl [--base full]

Every run places a path and plans a motion anew, on one core. A run that is in the file already is not repeated, so
that an interrupted study continues. The table compares each variant with a base on the same robots, motions and seeds:
median ratios of the rms distance, the duration and the computing time, and the spread of the seeds of the base.
"""

import argparse
import json
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import maniport as mp
from maniport.arms import VELOCITY, Arm
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.motion import MotionLimits, Planner, TargetTrajectory
from maniport.motion.placement import search
from maniport.motion.placement.cost import PlacementCost
from maniport.motion.plan import plan_options, planner
from maniport.motion.plan.plan_options import PLACEMENT_ROUNDS
from maniport.pipeline import follow_profile

from .inputs import DAMPING
from .motions import motions
from .robots import ROBOTS, load_robot

BUDGETS: dict[str, dict[str, Any]] = {
    "full": {},
    "150 nodes": {"nodes": 150},
    "stages of 1 s": {"stage": 1.0},
    "1024 candidates": {"candidates": 1024},
    "128 starts of placements": {
        "rounds": (PLACEMENT_ROUNDS[0]._replace(kept=128), *PLACEMENT_ROUNDS[1:])
    },
    "stop at 1e-3": {"rel_tol": 1e-3},
}
"""Changed search budgets."""
PATCHES: dict[str, tuple[Any, str, Any]] = {
    "no relaxation": (planner, "relaxed", lambda problem, time, q, terms, tolerance: q),
    "no joint descent of the placement": (
        PlacementCost,
        "improved",
        lambda cost, motions, steps: replace(motions, cost=cost.evaluate(motions).cost),
    ),
    "one branch of configurations": (search, "BRANCH", 0.0),
    "planning time scale 2": (planner, "PLANNING_TIME_SCALE", 2.0),
    "smoothness / 3": (planner, "SMOOTHNESS", planner.SMOOTHNESS / 3.0),
    "smoothness · 3": (planner, "SMOOTHNESS", planner.SMOOTHNESS * 3.0),
    "no first optimization at the stages": (
        planner,
        "optimize",
        lambda targets, time, q, terms, weight: q,
    ),
}
"""Changed functions and constants: module, name and value."""
VARIANTS = [*BUDGETS, *PATCHES]


def cases(names: list[str]) -> Iterator[tuple[str, Any, np.ndarray, np.ndarray, np.ndarray]]:
    """Name, person, times [s], ellipsoids and hand path of the short motions and the two bundled recordings."""
    for motion in motions():
        if motion.name in names or not names:
            yield motion.name, motion.person, motion.robot_time, motion.profile, motion.hand
    for name in ("freeform", "ladder"):
        if name in names or not names:
            fit = fit_arm(read_recording(shipped_recording(name)), "myoarm")
            profile = fit.arm.ellipsoids(fit.joint_angles, VELOCITY)
            path = fit.arm.forward(fit.joint_angles)
            yield name, fit.arm, fit.time, profile, path[:, :3, 3]


def load(name: str) -> Arm:
    """Return a robot by name."""
    return mp.load_arm("panda") if name == "Panda" else load_robot(name)


def changed(variant: str) -> ExitStack:
    """Set the search budget of a variant, and patch what the variant changes."""
    stack = ExitStack()
    budget = replace(plan_options.DEFAULT_BUDGET, **BUDGETS.get(variant, {}))
    stack.enter_context(mock.patch.object(plan_options, "DEFAULT_BUDGET", budget))
    if variant in PATCHES:
        stack.enter_context(mock.patch.object(*PATCHES[variant]))
    return stack


def run(file: Path, variants: list[str], robots: list[str], names: list[str], seeds: int) -> None:
    """Append one line of JSON for each variant, robot, motion and seed."""
    done = {tuple(row[key] for key in ("variant", "robot", "motion", "seed")) for row in rows(file)}
    todo = list(cases(names))
    for robot in robots:
        arm = load(robot)
        student = mp.sample_domain(arm, 4096, 1)
        samples = Planner.of(MotionLimits.of(arm), VELOCITY)
        for name, person, clock, profile, path in todo:
            adapter = mp.ScaledTransport(damping=DAMPING, base_rotation=np.eye(3))
            adapter.fit(mp.sample_domain(person, 4096, 0), student)
            target = adapter.transform(profile)
            tolerance = 0.012 if name == "ladder" else 0.005
            targets = TargetTrajectory.checked(
                arm, clock, target, positions=path, damping=adapter.student_regularization
            )
            options = {
                "planner": samples,
                "position_tolerance": tolerance,
            }
            for seed, variant in ((seed, variant) for seed in range(seeds) for variant in variants):
                if (variant, robot, name, seed) in done:
                    continue
                with changed(variant):
                    begin = time.process_time()
                    options |= {"seed": seed}
                    result = follow_profile(arm, targets, place=True, **options)
                    seconds = time.process_time() - begin
                motion = result.arm.motion
                clearance = result.motion.clearance
                assert motion is not None
                assert motion.position_error is not None
                row = {
                    "variant": variant,
                    "robot": robot,
                    "motion": name,
                    "seed": seed,
                    "seconds": seconds,
                } | {
                    "rms": float(np.sqrt(np.mean(motion.distance**2))),
                    "duration": float(motion.control_time[-1]),
                    "error_p95": float(np.percentile(motion.position_error, 95)) / tolerance,
                    "error_max": float(motion.position_error.max()) / tolerance,
                    "collides": float(clearance.share),
                }
                with open(file, "a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")


def rows(file: Path) -> list[dict[str, Any]]:
    """Return the measured rows."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.is_file() else []


def table(file: Path, base: str) -> None:
    """Print a Markdown table of every variant."""
    by: dict[str, dict[tuple[Any, ...], dict[str, Any]]] = {}
    for row in rows(file):
        by.setdefault(row["variant"], {})[row["robot"], row["motion"], row["seed"]] = row
    reference = by[base]
    spreads: dict[tuple[Any, ...], list[float]] = {}
    for key, row in reference.items():
        spreads.setdefault(key[:2], []).append(row["rms"])
    spread = np.median(
        [np.std(values) / np.mean(values) for values in spreads.values() if len(values) > 1]
        or [0.0]
    )
    print(
        f"Base: {base}; seed spread of its rms distance: {spread:.1%} (median standard deviation over the mean)\n"
    )
    print(
        "| variant | runs | rms | duration | worst position error / tolerance | collisions | computing time |"
    )
    print("|---|---|---|---|---|---|---|")
    for variant, measured in by.items():
        shared = [key for key in measured if key in reference]
        if not shared:
            continue
        rms, duration, seconds = (
            np.median([measured[key][name] / reference[key][name] for key in shared])
            for name in ("rms", "duration", "seconds")
        )
        error, collides = (
            max(measured[key][name] for key in shared) for name in ("error_max", "collides")
        )
        print(
            f"| {variant} | {len(shared)} | {rms - 1:+.1%} | {duration - 1:+.1%} | {error:.1f} | {collides:.1%} | "
            f"×{seconds:.2f} |"
        )


def main() -> None:
    """Parse and run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True, dest="verb")
    runner = verbs.add_parser("run")
    printer = verbs.add_parser("table")
    for verb in (runner, printer):
        verb.add_argument("file", type=Path)
    runner.add_argument("--variants", nargs="+", default=VARIANTS, choices=VARIANTS)
    runner.add_argument(
        "--robots", nargs="+", default=["Panda", *ROBOTS], choices=["Panda", *ROBOTS]
    )
    runner.add_argument("--motions", nargs="+", default=[])
    runner.add_argument("--seeds", type=int, default=5)
    printer.add_argument("--base", default="full")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.verb == "run":
        run(options.file, options.variants, options.robots, options.motions, options.seeds)
    else:
        table(options.file, options.base)


if __name__ == "__main__":
    main()
