"""Robots with two arms follow the shipped recording of both hands: each arm beside its motion alone, in a table.

    python scripts/both_arms.py [--robots pandas baxter talos-held talos] [--planning-effort full] [--tips placed]

Alone means the arm without the other one, along the same path, with the joints that the two share to itself.
Processor time is that of one thread; that of an arm alone is the mean of both, and counts its planner, as that of both
does.
"""

import argparse
import time as clock
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import maniport as mp
from maniport.arms import ArmGroup
from maniport.mocap import HumanMotion, fit_arms, read_recording
from maniport.motion import ArmMotion, RobotMotion, place_path, plan_motion

RECORDING = Path(mp.mocap.__file__).parent / "data" / "both_arms.c3d"
SAMPLES = 5000
ROBOTS = {
    "pandas": ("two Pandas", {"robot": "panda", "bases": [(0.0, 0.3, 0.0), (0.0, -0.3, 0.0)]}),
    "baxter": ("Baxter", {"robot": "baxter"}),
    "talos": ("Talos", {"robot": "talos"}),
    "talos-held": ("Talos, its torso held", {"robot": "talos", "lock": {"torso_1_joint": 0.0, "torso_2_joint": 0.0}}),
    "g1": ("G1", {"robot": "g1"}),
}
DIFFERENT = 1.1
"""How many times more than alone the distances may be."""


@dataclass(frozen=True)
class Task:
    """What arms are asked for: target ellipsoids of each (n, d, d), and where its tip shall be (n, 3) [m]."""

    profiles: tuple
    paths: tuple
    time: np.ndarray
    placing: float
    """Processor time [s]."""


def task_of(fits: HumanMotion, arms: ArmGroup, planning_effort: str) -> Task:
    """Both hands' paths in one place, with target ellipsoids by parallel transport."""
    profiles = []
    for fit, arm in zip(fits.arms, arms.arms, strict=True):
        teacher, student = (mp.sample_domain(one, SAMPLES, random_state=0) for one in (fit.arm, arm))
        adapter = mp.ParallelTransport().fit(teacher, student)
        profiles.append(adapter.transform(fit.arm.manipulability(fit.joint_angles)))
    began = clock.process_time()
    placed = place_path(fits.hands, profiles, arms, time=fits.time, planning_effort=planning_effort)
    spent = clock.process_time() - began
    print("   ", placed[0], placed[1], sep="\n    ", flush=True)
    return Task(tuple(one.profile for one in placed), tuple(one.path for one in placed), fits.time, spent)


def alone(arms: ArmGroup, task: Task, planning_effort: str) -> tuple[list[ArmMotion], float]:
    """Each arm by itself, and the mean processor time [s]."""
    began = clock.process_time()
    motions = [
        plan_motion(arm, profile, time=task.time, paths=path, planning_effort=planning_effort).arms[0]
        for arm, profile, path in zip(arms.arms, task.profiles, task.paths, strict=True)
    ]
    return motions, 0.5 * (clock.process_time() - began)


def together(arms: ArmGroup, task: Task, planning_effort: str, tips: str) -> tuple[RobotMotion, float]:
    """Both, and the processor time [s]."""
    began = clock.process_time()
    found = plan_motion(
        arms, task.profiles, time=task.time, paths=task.paths, planning_effort=planning_effort, tips=tips
    )
    return found, clock.process_time() - began


def beside(metres: np.ndarray | None) -> str:
    """How far something is beside what it shall be."""
    if metres is None:
        return "free"
    return f"{1e3 * np.percentile(metres, 95):.1f} mm (95 %), {1e3 * metres.max():.1f} mm (largest)"


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def told(name: str, fits: HumanMotion, arms: ArmGroup, planning_effort: str, tips: str) -> list[str]:
    """Lines about one robot."""
    task = task_of(fits, arms, planning_effort)
    (single, one), (both, two) = alone(arms, task, planning_effort), together(arms, task, planning_effort, tips)
    lines = [f"{name}: {arms.dof} joints, shared: {', '.join(arms.shared) or 'none'}"]
    for side, mine, motion in zip(("left", "right"), single, both.arms, strict=True):
        ratio = rms(motion.distance) / rms(mine.distance)
        lines.append(
            f"  {side:5}  rms d {rms(motion.distance):.3f}, alone {rms(mine.distance):.3f}: {ratio:.3f} times"
            f"{'' if ratio <= DIFFERENT else ' (!)'}; tip {beside(motion.position_error)}; alone "
            f"{np.percentile(1e3 * mine.position_error, 95):.1f} mm; pointwise_ratio "
            f"{motion.pointwise_ratio:.3f}, alone {mine.pointwise_ratio:.3f}"
        )
    clearance, use = both.clearance, both.limit_use
    lines += [] if both.relative_error is None else [f"  way    from tip to tip {beside(both.relative_error)}"]
    lines += [
        f"  pair   {'refined together' if both.coupled else 'each as alone'}; ratio {both.pointwise_ratio:.3f}; "
        f"{both.trajectory.time[-1]:.1f} s, alone {', '.join(f'{m.time[-1]:.1f}' for m in single)} s, the person "
        f"{np.ptp(task.time):.1f} s",
        f"  limits {', '.join(f'{what} {share:.3f} ({joint})' for what, (joint, share, _) in use.largest.items())}",
        f"  clearance   {1e3 * clearance.distance:.1f} mm between {clearance.pair[0]} and {clearance.pair[1]}, "
        f"{clearance.share:.2%} of steps collide{'' if clearance.known else '; not known: ' + clearance.why}",
        f"  time   plan {two:.1f} s, one arm {one:.1f} s: {two / one:.2f} times; place {task.placing:.1f} s",
    ]
    return lines


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=["pandas", "baxter", "talos-held", "talos"])
    parser.add_argument("--planning-effort", choices=("full", "quick"), default="full")
    parser.add_argument("--tips", choices=("placed", "relative"), default="placed")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    fits = fit_arms(read_recording(RECORDING))
    print(f"{RECORDING.name}: {len(fits)} frames, {np.ptp(fits.time):.1f} s")
    for robot in given.robots:
        name, asked = ROBOTS[robot]
        print("\n".join(told(name, fits, mp.load_arms(**asked), given.planning_effort, given.tips)), flush=True)


if __name__ == "__main__":
    main()
