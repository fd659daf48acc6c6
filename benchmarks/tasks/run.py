"""Run the task study: each recording on each robot, resumed where an earlier run ended; statistics and tables."""

import itertools
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tasks.methods import motions, problem_of
from benchmarks.tasks.score import (
    LESS_IS_BETTER,
    SCORES,
    Scores,
    is_valid,
    read_motion,
    score,
    velocity_share,
)
from benchmarks.tasks.task import (
    HELD_OUT,
    ROBOTS,
    Demonstration,
    StudyRobot,
    Task,
    demonstrations,
    of_folder,
)
from maniport.errors import InvalidInputError, ManiportError
from maniport.report.render import write_report
from maniport.report.values import Report, Section, Table, software
from maniport.util.atomic_io import claim, write_text
from maniport.util.optional import mujoco
from maniport.util.progress import Progress, Step
from maniport.util.validation import Array, as_choice, as_count
from maniport.version import __version__

QUICK = (
    "freeform 1",
    "ladder 1",
    "H-Eval-2",
    "reach 1",
)  # Recordings of the quick set, for the first robot

RATIOS = {
    "push": "direct-force",
    "speed": "direct-speed",
    "react": "direct-speed",
    "resist": "direct-force",
    "carry": "direct-force",
}
"""Scores that are compared by ratios, and the direct optimization that they are compared with."""

CORRELATIONS = "resemblance_force", "resemblance_speed"
"""Methods of the summary."""

CAPTION = (
    "Median over recordings, relative to the position-only motion: above 1 is better, also for the time of react and "
    "the displacement of resist. In parentheses: 95 % interval of the median by bootstrap; wins: share of the "
    "recordings above 1. Of direct: median ratio to the optimization that knows the direction. r: correlation with the "
    "person's capability over 64 directions. A motion that leaves the path or exceeds a limit counts as 0; random "
    "ones are the median of the valid ones of 20."
)

Row = Mapping[str, Any]
"""Scores of a method on a unit: ``method``, ``valid``, and those of `benchmarks.tasks.score`."""


@dataclass(frozen=True)
class Unit:
    """One recording on one robot."""

    recording: str
    robot: str
    held_out: bool = False  # whether recording or robot were never used while methods were tuned
    duration_ratio: float = 0.0  # of the motions and the person
    rows: tuple[Row, ...] = ()
    failure: str = ""

    def row(self, method: str) -> Row:
        """Return the row of a method."""
        return next(row for row in self.rows if row["method"] == method)

    def merit(self, method: str, score: str) -> float:
        """Return a score of which more is better; 0 for a motion that is not valid."""
        row = self.row(method)
        value = float(row[score]) if row["valid"] else 0.0
        if score in LESS_IS_BETTER:
            return 1.0 / value if value > 0.0 and np.isfinite(value) else 0.0
        return value

    def ratio(
        self, method: str, score: str, reference: str = "position-only", largest: float = 1000.0
    ) -> float:
        """Return the ratio of merits, at most `largest`; 1 where both are 0."""
        own, other = self.merit(method, score), self.merit(reference, score)
        return min(own / other, largest) if other > 0.0 else (largest if own > 0.0 else 1.0)


def study_tasks(
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    *,
    quick: bool = False,
    robots: Sequence[str] = (),
    recordings: str | os.PathLike[str] | None = None,
) -> Report:
    """Run the task study and write tasks, motions, scores and tables to a folder.

    In the folder of an earlier run with the same seed and version, pairs are not computed again. `quick` is a set of
    four recordings on one robot; `recordings` is a folder of BVH files that are used in addition.
    """
    first, folder = as_count(seed, "seed", minimum=0), Path(output)
    mujoco()  # raises MissingPackageError
    names = robots or list(ROBOTS)[: 1 if quick else None]
    selected = [ROBOTS[as_choice(name, "robot", ROBOTS)] for name in names]
    claim(folder, "study.json", {"maniport": __version__, "seed": first}, ("maniport", "seed"))
    step = Step(progress, "Read recordings")
    motions = [own for own in demonstrations() if not quick or own.name in QUICK]
    motions += [] if recordings is None else list(of_folder(recordings))
    step.end(f"{len(motions)} motions")
    pairs = [(robot, motion) for robot in selected for motion in motions]
    units = list[Unit]()
    for i, (robot, motion) in enumerate(pairs, 1):
        step = Step(progress, f"{motion.name} → {robot.name}")
        units.append(
            _unit(
                folder / "pairs" / robot.name / motion.name.replace(" ", "-"), robot, motion, first
            )
        )
        step.end(f"{i} of {len(pairs)}{units[-1].failure and ', failed'}")
    report = study_report(units, first)
    for suffix in (".md", ".json"):
        write_report(folder / f"tasks{suffix}", report)
    return report


def score_file(motion: str | os.PathLike[str], task: str | os.PathLike[str]) -> Report:
    """Score a file of joint positions, see `benchmarks.tasks.score.read_motion`, on the task of a file."""
    own = Task.load(task)
    scores = score(own, read_motion(motion, own))
    section, good = Section("Scores"), is_valid(scores)
    for name, value in scores.items():
        section.add(
            name.replace("_", " "), name, value, f"{value:.4g} {SCORES.get(name, '')}".strip()
        )
    section.add("valid", "valid", good, "yes" if good else "no", "Path within 5 mm, limits kept.")
    return Report(f"{own.recording} on {own.robot}", "", (section,))


def _unit(folder: Path, robot: StudyRobot, motion: Demonstration, seed: int) -> Unit:
    """Read the scores of a pair, or compute and write them; failures are units, too."""
    file = folder / "scores.json"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        try:
            unit = _computed(folder, robot, motion, seed)
        except ManiportError as error:
            unit = Unit(motion.name, robot.name, failure=str(error))
        write_text(file, json.dumps(asdict(unit), indent=1) + "\n")
    content = json.loads(file.read_text(encoding="utf-8"))
    return Unit(**content | {"rows": tuple(content["rows"])})


def _computed(folder: Path, robot: StudyRobot, demonstration: Demonstration, seed: int) -> Unit:
    """Compute the motions of all methods, give all the same time, and score them."""
    problem = problem_of(robot, demonstration, seed)
    results, task = [(name, np.round(q, 9)) for name, q in motions(problem)], problem.task
    shares = [velocity_share(task.arm, task.time, q) for name, q in results if name != "random"]
    task = replace(task, time=max(1.0, 1.000001 * max(shares)) * task.time)
    task.save(folder / "task.json")
    for name, q in results:
        if name != "random":
            rows = [",".join(map(repr, row)) for row in np.column_stack([task.time, q]).tolist()]
            write_text(
                folder / f"{name.replace(', ', '-')}.csv",
                "\n".join([",".join(task.columns), *rows, ""]),
            )
    scores = [(name, score(task, q)) for name, q in results]
    if not is_valid(scores[0][1]):
        raise InvalidInputError("the position-only motion leaves the path or exceeds a limit")
    ratio = float(task.time[-1] / demonstration.time[-1])
    held_out = not HELD_OUT.isdisjoint((demonstration.name, robot.name))
    return Unit(demonstration.name, robot.name, held_out, ratio, tuple(rows_of(scores)))


def rows_of(scores: Sequence[tuple[str, Scores]]) -> Iterator[Row]:
    """Yield a row for each method; that of the random motions has medians over the valid ones, and their share."""
    random = [own for name, own in scores if name == "random"]
    valid = [own for own in random if is_valid(own)]
    for name, own in scores:
        if name != "random":
            yield {"method": name, "valid": is_valid(own), **own}
        elif own is random[0]:
            median = {
                key: float(np.median([other[key] for other in valid or random])) for key in own
            }
            yield {
                "method": name,
                "valid": bool(valid),
                "valid_share": len(valid) / len(random),
                **median,
            }


def median_interval(values: Sequence[float] | Array, draws: int = 2000) -> dict[str, float]:
    """Return the median with the ends of its 95 % interval by bootstrap."""
    array = np.asarray(values, dtype=np.float64)
    samples = np.random.default_rng(0).choice(array, (draws, len(array)))
    low, high = np.percentile(np.median(samples, axis=1), [2.5, 97.5])
    return {"median": float(np.median(array)), "low": float(low), "high": float(high)}


def statistics(units: Sequence[Unit], method: str) -> dict[str, Any]:
    """Return median, interval, win rate and share of the direct optimization by score, and the count of failures."""
    result = dict[str, Any]()
    for name, direct in RATIOS.items():
        ratios = np.array([unit.ratio(method, name) for unit in units])
        shares = [unit.ratio(method, name, direct) for unit in units]
        wins = {"wins": float(np.mean(ratios > 1.0)), "of_direct": float(np.median(shares))}
        result[name] = median_interval(ratios) | wins
    for name in CORRELATIONS:
        result[name] = median_interval([unit.merit(method, name) for unit in units])
    return result | {"failed": sum(not unit.row(method)["valid"] for unit in units)}


def study_report(units: Sequence[Unit], seed: int) -> Report:
    """Return a summary, and a table of all methods for each robot."""
    done = [unit for unit in units if not unit.failure]
    robots = list(dict.fromkeys(unit.robot for unit in done))
    run = Section("Run")
    run.add("Pairs", "pairs", len(done), f"{len(done)} of {len(units)}")
    for i, unit in enumerate(unit for unit in units if unit.failure):
        run.add(f"{unit.recording}, {unit.robot}", f"failed_{i}", unit.failure)
    run.metrics += tuple(software(seed))
    sections = [
        _robot_section(robot, [unit for unit in done if unit.robot == robot]) for robot in robots
    ]
    return Report("Task study", "Tasks with a hidden direction: methods of redundancy resolution on equal paths.",
                  (_summary(done), *sections, run))  # fmt: skip


def _summary(units: Sequence[Unit]) -> Section:
    """Length field on each robot: motions that methods were tuned with, and held-out ones."""
    rows, values = [], []
    for robot in dict.fromkeys(unit.robot for unit in units):
        for held_out in (False, True):
            own = [unit for unit in units if unit.robot == robot and unit.held_out == held_out]
            if not own:
                continue
            force, speed = (
                statistics(own, method)
                for method in ("length-field, force", "length-field, velocity")
            )
            r = (
                values["median"]
                for values in (force["resemblance_force"], speed["resemblance_speed"])
            )
            gains = (
                (_interval(gain), f"{gain['of_direct']:.2f}")
                for gain in (force["push"], speed["speed"])
            )
            label = f"{robot}, held out" if held_out else robot
            rows.append(
                (label, str(len(own)), *itertools.chain(*gains), *(f"{value:.2f}" for value in r))
            )
            numbers = {"recordings": len(own), "force": force, "speed": speed}
            values.append({"robot": robot, "held_out": held_out, **numbers})
    columns = (
        "robot",
        "recordings",
        "push",
        "of direct",
        "speed",
        "of direct",
        "r force",
        "r speed",
    )
    return Section(
        "Length field", (), (Table(columns, tuple(rows), CAPTION, "rows", values),), "summary"
    )


def _robot_section(robot: str, units: Sequence[Unit]) -> Section:
    """Return the table of all methods on one robot."""
    rows, values = [], dict[str, Any]()
    for method in (row["method"] for row in units[0].rows):
        values[method] = own = statistics(units, method)
        ratios = (_interval(own[score]) for score in RATIOS)
        correlations = (f"{own[score]['median']:.2f}" for score in CORRELATIONS)
        wins = (f"{100 * own[score]['wins']:.0f} %" for score in ("push", "speed"))
        rows.append((method, *ratios, *correlations, *wins, str(own["failed"])))
    columns = ("method", *RATIOS, "r force", "r speed", "push wins", "speed wins", "failed")
    ratio = np.median([unit.duration_ratio for unit in units])
    text = f"{len(units)} recordings; motions take {ratio:.1f} times as long as the person's."
    return Section(robot, (), (Table(columns, tuple(rows), "", "methods", values),), robot, text)


def _interval(values: Mapping[str, float]) -> str:
    return f"{values['median']:.2f} ({values['low']:.2f}–{values['high']:.2f})"
