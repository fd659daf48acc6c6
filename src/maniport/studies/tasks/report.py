"""Statistics of the task study: ratios to the position-only motion over recordings, and tables of them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.report.values import Metric, Report, Section, Table, describe, software
from maniport.studies.tasks.methods import DIRECT_FORCE, DIRECT_SPEED, POSITION_ONLY
from maniport.studies.tasks.score import LESS_IS_BETTER
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import Array

RATIOS = {
    "push": DIRECT_FORCE, "speed": DIRECT_SPEED, "react": DIRECT_SPEED, "resist": DIRECT_FORCE, "carry": DIRECT_FORCE,
}  # fmt: skip
"""Scores that are compared by ratios, and the direct optimization that they are compared with."""

CORRELATIONS = "resemblance_force", "resemblance_speed"
MAIN = {"push": "length-field, force", "speed": "length-field, velocity"}
"""Methods of the summary."""

CAPTION = (
    "Median over recordings, relative to the position-only motion: above 1 is better, also for the time of react and "
    "the displacement of resist. In parentheses: 95 % interval of the median by bootstrap; wins: share of the "
    "recordings above 1. Of direct: median ratio to the optimization that knows the direction. r: correlation with the "
    "person's capability over 64 directions. A motion that leaves the path or exceeds a limit counts as 0; random "
    "ones are the median of the valid ones of 20."
)

Row = Mapping[str, Any]
"""Scores of a method on a unit: ``method``, ``valid``, and those of `maniport.studies.tasks.score`."""


@dataclass(frozen=True)
class Unit:
    """One recording on one robot."""

    recording: str
    robot: str
    held_out: bool  # whether recording or robot were never used while methods were tuned
    duration_ratio: float  # of the motions and the person
    rows: tuple[Row, ...]
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

    def ratio(self, method: str, score: str, reference: str = POSITION_ONLY, largest: float = 1000.0) -> float:
        """Return the ratio of merits, at most `largest`; 1 where both are 0."""
        own, other = self.merit(method, score), self.merit(reference, score)
        return min(own / other, largest) if other > 0.0 else (largest if own > 0.0 else 1.0)


@dataclass(frozen=True, repr=False)
class TaskStudy(NotebookDisplay):
    """Result of the task study."""

    units: tuple[Unit, ...]
    seed: int

    def __repr__(self) -> str:
        return f"TaskStudy({len(self.units)} pairs, seed {self.seed})"


def median_interval(values: Sequence[float] | Array, draws: int = 2000) -> tuple[float, float, float]:
    """Return the median with its 95 % interval by bootstrap."""
    array = np.asarray(values, dtype=np.float64)
    samples = np.random.default_rng(0).choice(array, (draws, len(array)))
    low, high = np.percentile(np.median(samples, axis=1), [2.5, 97.5])
    return float(np.median(array)), float(low), float(high)


def statistics(units: Iterable[Unit], method: str) -> dict[str, Any]:
    """Return median, interval, win rate and share of the direct optimization by score, and the count of failures."""
    own, result = list(units), dict[str, Any]()
    for score, direct in RATIOS.items():
        ratios = np.array([unit.ratio(method, score) for unit in own])
        result[score] = dict(zip(("median", "low", "high"), median_interval(ratios), strict=True))
        result[score]["wins"] = float(np.mean(ratios > 1.0))
        result[score]["of_direct"] = float(np.median([unit.ratio(method, score, direct) for unit in own]))
    for score in CORRELATIONS:
        values = [unit.merit(method, score) for unit in own]
        result[score] = dict(zip(("median", "low", "high"), median_interval(values), strict=True))
    return result | {"failed": sum(not unit.row(method)["valid"] for unit in own)}


@describe.register
def study_report(study: TaskStudy) -> Report:
    """Return a summary, and a table of all methods for each robot."""
    done = [unit for unit in study.units if not unit.failure]
    robots = list(dict.fromkeys(unit.robot for unit in done))
    failed = tuple(
        Metric(f"{unit.recording}, {unit.robot}", unit.failure, key=f"failed_{i}", value=unit.failure)
        for i, unit in enumerate(unit for unit in study.units if unit.failure)
    )
    run = Section("Run", (Metric("Pairs", f"{len(done)} of {len(study.units)}", key="pairs", value=len(done)),
                          *failed, *software(study.seed)))  # fmt: skip
    sections = [_robot_section(robot, [unit for unit in done if unit.robot == robot]) for robot in robots]
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
            force, speed = (statistics(own, method) for method in MAIN.values())
            r_force, r_speed = force["resemblance_force"], speed["resemblance_speed"]
            label = f"{robot}, held out" if held_out else robot
            cells = (
                *(_interval(force["push"]), f"{force['push']['of_direct']:.2f}"),
                *(_interval(speed["speed"]), f"{speed['speed']['of_direct']:.2f}"),
                *(f"{r_force['median']:.2f}", f"{r_speed['median']:.2f}"),
            )
            rows.append((label, str(len(own)), *cells))
            numbers = {"recordings": len(own), "force": force, "speed": speed}
            values.append({"robot": robot, "held_out": held_out, **numbers})
    columns = ("robot", "recordings", "push", "of direct", "speed", "of direct", "r force", "r speed")
    return Section("Length field", (), (Table(columns, tuple(rows), CAPTION, "rows", values),), "summary")


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
