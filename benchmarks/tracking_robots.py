"""The same chain on other robots: adapt, place, track, optimize; figures only."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from sysconfig import get_paths
from typing import Any

import numpy as np
from joblib import Parallel, delayed

import maniport as mp
from maniport.bodies import Arm
from maniport.tracking import StartBank, place_path, track
from maniport.tracking.offline.offline import optimize_trajectory

from .inputs import DAMPING, Array
from .measure import Row
from .tracking_motions import STUDENT_SAMPLES, TEACHER_SAMPLES, Motion
from .tracking_runs import spread

FILES = Path(get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
"""Where the package example-robot-data puts its robots."""

ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "xArm7": ("xarm_description/urdf/xarm7.urdf", {}),
    "Talos, left arm": (
        "talos_data/robots/talos_reduced.urdf",
        {"frame": "arm_left_7_link", "joints": [f"arm_left_{i}_joint" for i in range(1, 8)]},
    ),
    "Tiago, arm": (
        "tiago_description/robots/tiago_no_hand.urdf",
        {"frame": "arm_tool_link", "joints": [f"arm_{i}_joint" for i in range(1, 8)]},
    ),
}
"""File and tip of each. Bases are as the files have them: Talos' is its pelvis, Tiago's the floor under its wheels."""


MOTIONS, QUICK_MOTIONS = ("H-Eval-3", "H-Eval-4", "ladder 3.9–7.8 s", "freeform 3.7–7 s"), ("H-Eval-3",)


@dataclass(frozen=True)
class Chain:
    """What became of one motion on one robot, point by point.

    Attributes
    ----------
    tracked, offline, floor : ndarray, shape (n,)
        Distances of the tracked and of the optimized motion, and the least at each point by itself.
    position_error : ndarray, shape (n,)
        Of the tracked motion [m].
    """

    tracked: Array
    offline: Array
    floor: Array
    position_error: Array


def chain(name: str, motion: Motion) -> Chain:
    """Adapt a motion to a robot, place it, follow it."""
    robot = _load(name)
    student, bank = mp.sample_domain(robot, STUDENT_SAMPLES, 1), StartBank.build(robot, STUDENT_SAMPLES, 0)
    teacher = mp.sample_domain(motion.person, TEACHER_SAMPLES, 0)
    adapter = mp.ParallelTransport(damping=DAMPING, mounting=np.eye(3)).fit(teacher, student)
    damping, time = adapter.student_regularization, motion.robot_time
    placed = place_path(motion.hand, adapter.transform(motion.profile), robot, damping=damping, bank=bank)
    tracked = track(robot, placed.profile, time=time, path=placed.path, bank=bank, damping=damping)
    offline = optimize_trajectory(
        robot, placed.profile, time, path=placed.path, bank=bank, damping=damping, start=tracked.joint_positions
    )
    return Chain(tracked.distance, offline.distance, placed.distance, tracked.position_error)


def rows(motions: list[Motion], quick: bool) -> Iterator[Row]:
    """A row for each robot."""
    names = ["UR5"] if quick else list(ROBOTS)
    chosen = [motion for motion in motions if motion.name in (QUICK_MOTIONS if quick else MOTIONS)]
    there = [name for name in names if (FILES / ROBOTS[name][0]).is_file()]
    work = [(name, motion) for name in there for motion in chosen]
    done = Parallel(n_jobs=-1)(delayed(chain)(*one) for one in work)
    for name in names:
        what = f"{name}: {len(chosen)} adapted motions, placed, followed: d, median / 95 %"
        found = [one for (robot, _), one in zip(work, done, strict=True) if robot == name]
        if not found:
            yield Row(what, "–", "", "not measured", "–", None, "the package example-robot-data is not installed")
            continue
        tracked, offline, least, error = (
            np.concatenate([getattr(one, field.name) for one in found]) for field in fields(Chain)
        )
        yield Row(
            what,
            spread(tracked),
            "",
            spread(tracked),
            "–",
            None,
            f"{_load(name).dof} joints; offline {spread(offline)}; the least at each point by itself {spread(least)}; "
            f"hand beside its path {1e3 * np.percentile(error, 95):.2f} mm (95 %)",
        )


def _load(name: str) -> Arm:
    file, options = ROBOTS[name]
    return mp.load_arm(FILES / file, **options)
