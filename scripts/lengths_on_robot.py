"""Plan robot motions for targets of scaled transport and of the length field, and compare them.

    python scripts/lengths_on_robot.py --robots Panda UR5 --motions H-Eval-1 ladder --seeds 0 1

Each target is placed and planned for itself, with the person's hand path as the tip's and without any path. A line for
each tells how far the robot's ellipsoids are from what was asked for, and from what the rigid map would have asked for.
Robots other than the Panda come from the package example-robot-data. A short motion takes about 15 s of one core for
each robot and seed, a recording about a minute.
"""

import argparse
import time as clock
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import maniport as mp
from evaluate_human_to_panda import EVALUATIONS, RECORDINGS
from lengths_table import FILES, ROBOTS
from maniport.arms import VELOCITY, Arm
from maniport.evaluation.comparison import with_feasible_set
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.motion import (
    MotionLimits,
    Planner,
    TargetTrajectory,
    nearest_feasible,
    place_path,
    plan_motion,
)
from maniport.studies.trajectories import human_arm, human_evaluation
from maniport.transfer import method_of
from maniport.util.defaults import DAMPING, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.sampling import evenly_spaced

EVALUATION_SECONDS = 5.0
"""Duration of H-Eval-1 to -4, for which the paper gives none."""
POINTS = 150
SLOWER = 4.0
"""Waypoints of a recording, and smallest duration relative to the person's."""
RIGID = "scaled-transport"
LENGTHS = "length-field"
PATHS = {True: "hand path", False: "no path"}


@dataclass(frozen=True)
class Motion:
    """A person's motion: arm, times and joint positions."""

    name: str
    person: Arm
    time: np.ndarray
    joint_positions: np.ndarray

    @property
    def hand(self) -> np.ndarray:
        """Return the path of the hand, shape (n, 3) [m]."""
        return self.person.forward(self.joint_positions)[:, :3, 3]


def motions(names: list[str]) -> Iterator[Motion]:
    """Return the requested motions of the paper and bundled recordings."""
    for name in names:
        if name in EVALUATIONS:
            joints = human_evaluation()[name]
            yield Motion(
                name, human_arm(), np.linspace(0.0, EVALUATION_SECONDS, len(joints)), joints
            )
        else:
            fit = fit_arm(read_recording(shipped_recording(name)))
            chosen = evenly_spaced(len(fit), POINTS)
            yield Motion(name, fit.arm, fit.time[chosen], fit.joint_angles[chosen])


def load(name: str) -> Arm:
    """Return the Panda or a robot of the package example-robot-data."""
    if name == "Panda":
        return mp.load_arm("panda")
    file, options = ROBOTS[name]
    return mp.load_arm(FILES / file, **options)


@dataclass(frozen=True)
class Line:
    """Result of one motion on one robot; distances are median and 95th percentile.

    Attributes
    ----------
    robot, motion, path, method : str
    seed : int
    gap : float
        Mean feasibility gap of the target.
    own, rigid : tuple of float
        Distances of what the robot makes to its own target, and to that of the rigid map.
    tip : float or None
        How far the tip is beside its path at 95 % [mm].
    seconds : float
        Of one core, to place and to plan.
    """

    robot: str
    motion: str
    path: str
    method: str
    seed: int
    gap: float
    own: tuple[float, float]
    rigid: tuple[float, float]
    tip: float | None
    seconds: float

    def __str__(self) -> str:
        tip = "–" if self.tip is None else f"{self.tip:.1f}"
        cells = (
            self.robot,
            self.motion,
            self.path,
            self.method,
            str(self.seed),
            f"{self.gap:.3f}",
            *(f"{low:.2f} / {high:.2f}" for low, high in (self.own, self.rigid)),
            tip,
            f"{self.seconds:.0f}",
        )
        return f"| {' | '.join(cells)} |"


HEAD = (
    "robot",
    "motion",
    "tip",
    "map",
    "seed",
    "gap",
    "d to its own target",
    "d to the rigid target",
    "tip [mm]",
    "s",
)


def compare(
    motion: Motion, name: str, robot: Arm, planner: Planner, student: np.ndarray, seed: int
) -> Iterator[Line]:
    """Transfer by both maps and plan with and without the path."""
    teacher = mp.sample_domain(motion.person, TEACHER_SAMPLES, seed)
    demonstrated = motion.person.manipulability(motion.joint_positions)
    targets = {}
    for method in (RIGID, LENGTHS):
        adapter = method_of(method, damping=DAMPING, base_rotation=np.eye(3))
        adapter = with_feasible_set(adapter, robot, VELOCITY, planner.arms[0].bank, seed).fit(
            teacher, student
        )
        targets[method] = adapter.transform(demonstrated)
    damping = adapter.student_regularization
    time = SLOWER * (motion.time - motion.time[0])
    for method, target in targets.items():
        gap = nearest_feasible(robot, target, damping=damping, bank=planner.arms[0].bank).distance
        for with_path, path_name in PATHS.items():
            begin = clock.process_time()
            asked = target
            rigid = targets[RIGID]
            path = None
            if with_path:
                demonstrated_target = TargetTrajectory.checked(
                    robot, time, target, positions=motion.hand, damping=damping
                )
                placed = place_path(robot, demonstrated_target, planner=planner, random_state=seed)[
                    0
                ]
                asked = placed.profile
                rigid = placed.turned(targets[RIGID])
                path = placed.path
            placed_target = TargetTrajectory.checked(
                robot, time, asked, positions=path, damping=damping
            )
            (plan,) = plan_motion(robot, placed_target, planner=planner, random_state=seed).arms
            made = damping.apply(robot.manipulability(plan.joint_positions))
            tip = None if path is None else 1e3 * float(np.percentile(plan.position_error, 95))
            spreads = spread(plan.distance), spread(mp.spd.distance(damping.apply(rigid), made))
            seconds = clock.process_time() - begin
            yield Line(
                name,
                motion.name,
                path_name,
                method,
                seed,
                float(gap.mean()),
                *spreads,
                tip,
                seconds,
            )


def spread(values: np.ndarray) -> tuple[float, float]:
    """Return median and 95th percentile."""
    return float(np.median(values)), float(np.percentile(values, 95))


def summary(lines: Sequence[Line]) -> str:
    """Return one row for each robot, with and without the path: means over motions and seeds."""
    rows = [
        "| robot | tip | gap, rigid → lengths | d to its own target: rigid | lengths | lengths, to the rigid target |",
        "|---|---|---|---|---|---|",
    ]
    for robot, path in dict.fromkeys((line.robot, line.path) for line in lines):
        sets = [
            [x for x in lines if (x.robot, x.path, x.method) == (robot, path, way)]
            for way in (RIGID, LENGTHS)
        ]
        gaps = " → ".join(f"{np.mean([x.gap for x in some]):.2f}" for some in sets)
        own = [np.mean([x.own for x in some], axis=0) for some in sets]
        spreads = (*own, np.mean([x.rigid for x in sets[1]], axis=0))
        rows.append(
            f"| {robot} | {path} | {gaps} | {' | '.join(f'{low:.2f} / {high:.2f}' for low, high in spreads)} |"
        )
    return "\n".join(rows)


def main() -> None:
    """Print a line for each motion, robot, path, map and seed, and their means."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    every = list(ROBOTS)
    parser.add_argument("--robots", nargs="+", default=every, choices=every)
    parser.add_argument("--motions", nargs="+", default=[*EVALUATIONS, *RECORDINGS])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1])
    options = parser.parse_args()
    print(f"| {' | '.join(HEAD)} |", f"|{'---|' * len(HEAD)}", sep="\n", flush=True)
    lines = []
    for seed in options.seeds:
        for name in options.robots:
            robot = load(name)
            planner = Planner.of(MotionLimits.of(robot), VELOCITY, random_state=seed)
            student = mp.sample_domain(robot, STUDENT_SAMPLES, seed + 1)
            for motion in motions(options.motions):
                for line in compare(motion, name, robot, planner, student, seed):
                    lines.append(line)
                    print(line, flush=True)
    print("", summary(lines), sep="\n")


if __name__ == "__main__":
    main()
