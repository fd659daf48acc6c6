"""Run the task study: each recording on each robot, resumed where an earlier run ended."""

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from maniport.arms import load_arm
from maniport.arms.collisions import as_collisions, free_configurations
from maniport.errors import InvalidInputError, ManiportError, OutputError
from maniport.motion import MotionLimits
from maniport.report.renderings import write_report
from maniport.report.values import Metric, Report, Section, report_of
from maniport.studies.tasks.demonstrations import (
    ROBOTS,
    Demonstration,
    StudyRobot,
    demonstrations,
    of_folder,
    place,
    robot_of,
)
from maniport.studies.tasks.methods import POSITION_ONLY, RANDOM, Problem, motions
from maniport.studies.tasks.report import Row, TaskStudy, Unit
from maniport.studies.tasks.score import (
    SCORES,
    Scores,
    is_valid,
    read_motion,
    score,
    velocity_share,
)
from maniport.studies.tasks.task import Task
from maniport.util.atomic_io import written_whole
from maniport.util.optional import mujoco
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import Array, as_count
from maniport.version import __version__

QUICK = "freeform 1", "ladder 1", "H-Eval-2", "reach 1"
"""Recordings of the quick set, for the first robot."""


def study_tasks(
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    *,
    quick: bool = False,
    robots: Sequence[str] = (),
    recordings: str | os.PathLike[str] | None = None,
) -> TaskStudy:
    """Run the task study and write tasks, motions, scores and tables to a folder.

    Parameters
    ----------
    output : str or path
        A new folder, or that of an earlier run with the same seed and version, whose pairs are not computed again.
    seed : int
    progress : callable, optional
    quick : bool
        A small set: four recordings on one robot.
    robots : sequence of str
        Names of robots. Default: all of `maniport.studies.tasks.demonstrations.ROBOTS`.
    recordings : str or path, optional
        Folder of BVH files that are used in addition.

    Returns
    -------
    TaskStudy

    Raises
    ------
    ManiportError
        When an argument is not allowed, MuJoCo is missing, or the folder holds other things.
    """
    tell, first, folder = progress or no_progress, as_count(seed, "seed", minimum=0), Path(output)
    mujoco()  # raises MissingPackageError
    selected = [robot_of(name) for name in robots] if robots else list(ROBOTS[:1] if quick else ROBOTS)
    _claim(folder, {"maniport": __version__, "seed": first})
    tell("Read recordings", 0.0)
    motions = [own for own in demonstrations() if not quick or own.name in QUICK]
    motions += [] if recordings is None else list(of_folder(recordings))
    tell("Read recordings", 1.0, f"{len(motions)} motions")
    pairs = [(robot, motion) for robot in selected for motion in motions]
    units = list[Unit]()
    for i, (robot, motion) in enumerate(pairs):
        tell(f"{motion.name} → {robot.name}", 0.0)
        units.append(_unit(folder / "pairs" / robot.name / motion.name.replace(" ", "-"), robot, motion, first))
        tell(f"{motion.name} → {robot.name}", 1.0, f"{i + 1} of {len(pairs)}{units[-1].failure and ', failed'}")
    study = TaskStudy(tuple(units), first)
    for suffix in (".md", ".json"):
        write_report(folder / f"tasks{suffix}", report_of(study))
    return study


def score_file(motion: str | os.PathLike[str], task: str | os.PathLike[str]) -> Report:
    """Score a file of joint positions, see `maniport.studies.tasks.score.read_motion`, on the task of a file."""
    own = Task.load(task)
    scores = score(own, read_motion(motion, own))
    metrics = [
        Metric(name.replace("_", " "), f"{value:.4g} {SCORES.get(name, '')}".strip(), "", name, value)
        for name, value in scores.items()
    ]
    valid = Metric(
        "valid", "yes" if is_valid(scores) else "no", "Path within 5 mm, limits kept.", "valid", is_valid(scores)
    )
    return Report(f"{own.recording} on {own.robot}", "", (Section("Scores", (*metrics, valid)),))


def _claim(folder: Path, settings: dict[str, Any]) -> None:
    """Mark a new folder, or require that an earlier run had the same settings."""
    about = folder / "study.json"
    if about.is_file():
        if json.loads(about.read_text(encoding="utf-8")) != settings:
            raise OutputError(f"{str(folder)!r} holds a study of another seed or version; give a new folder with -o")
        return
    if folder.exists() and any(folder.iterdir()):
        raise OutputError(f"{str(folder)!r} holds other things; give a new folder with -o")
    (folder / "pairs").mkdir(parents=True, exist_ok=True)
    with written_whole(about) as temporary:
        temporary.write_text(json.dumps(settings) + "\n", encoding="utf-8")


def _unit(folder: Path, robot: StudyRobot, motion: Demonstration, seed: int) -> Unit:
    """Read the scores of a pair, or compute and write them; failures are units, too."""
    file = folder / "scores.json"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        try:
            unit = _computed(folder, robot, motion, seed)
        except ManiportError as error:
            unit = Unit(motion.name, robot.name, motion.held_out or robot.held_out, 0.0, (), str(error))
        with written_whole(file) as temporary:
            temporary.write_text(json.dumps(asdict(unit), indent=1) + "\n", encoding="utf-8")
    content = json.loads(file.read_text(encoding="utf-8"))
    return Unit(**content | {"rows": tuple(content["rows"])})


def _computed(folder: Path, robot: StudyRobot, demonstration: Demonstration, seed: int) -> Unit:
    """Compute the motions of all methods, give all the same time, and score them."""
    problem = problem_of(robot, demonstration, seed)
    results = [(name, np.round(q, 9)) for name, q in motions(problem)]
    task = problem.task
    shares = [velocity_share(task.arm, task.time, q) for name, q in results if name != RANDOM]
    factor = max(1.0, 1.000001 * max(shares))
    task = task.slower(factor)
    task.save(folder / "task.json")
    for name, q in results:
        if name != RANDOM:
            _write_motion(folder / f"{name.replace(', ', '-')}.csv", task, q)
    scores = [(name, score(task, q)) for name, q in results]
    if not is_valid(scores[0][1]):
        raise InvalidInputError(f"the {POSITION_ONLY} motion leaves the path or exceeds a limit")
    rows = tuple(rows_of(scores))
    ratio = float(task.time[-1] / demonstration.time[-1])
    return Unit(demonstration.name, robot.name, demonstration.held_out or robot.held_out, ratio, rows)


def problem_of(robot: StudyRobot, demonstration: Demonstration, seed: int = 0, slower: float = 4.0) -> Problem:
    """Place a demonstrated path, to be passed in `slower` times the person's time, and sample the robot."""
    samples = _samples(robot.name, seed)
    hand = demonstration.arm.forward(demonstration.joint_angles)[:, :3, 3]
    path, time = place(robot, hand, samples), slower * demonstration.time
    task = Task.of(demonstration.name, robot.name, time, path, demonstration.arm, demonstration.joint_angles)
    return Problem(task, demonstration, robot, samples, seed)


@lru_cache(1)
def _samples(robot: str, seed: int) -> Array:
    """Collision-free configurations of a robot."""
    arm, generator = MotionLimits.of(load_arm(robot)).arm, np.random.default_rng(seed)
    return np.asarray(free_configurations(arm, 60_000, generator, collisions=as_collisions(True, arm)))


def rows_of(scores: Sequence[tuple[str, Scores]]) -> Iterator[Row]:
    """Yield a row for each method; that of the random motions has medians over the valid ones, and their share."""
    random = [own for name, own in scores if name == RANDOM]
    valid = [own for own in random if is_valid(own)]
    for name, own in scores:
        if name != RANDOM:
            yield {"method": name, "valid": is_valid(own), **own}
        elif own is random[0]:
            median = {key: float(np.median([other[key] for other in valid or random])) for key in own}
            yield {"method": name, "valid": bool(valid), "valid_share": len(valid) / len(random), **median}


def _write_motion(file: Path, task: Task, q: Array) -> None:
    """Write joint positions in the format that `read_motion` reads, without loss."""
    names = [f"{name}_{unit}" for name, unit in zip(task.arm.joint_names, task.arm.joint_units, strict=True)]
    lines = [",".join(map(repr, row)) for row in np.column_stack([task.time, q]).tolist()]
    with written_whole(file) as temporary:
        temporary.write_text("\n".join([",".join(["time_s", *names]), *lines]) + "\n", encoding="utf-8")
