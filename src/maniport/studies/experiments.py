"""The experiments of the paper: toy data, two planar arms, and from the human arm to the Panda.

Tables I to III, §§ IV-B, V-A and V-B. Each row is fitted with the paper's settings and with maniport's defaults.
"""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm
from maniport.errors import collected_warnings
from maniport.estimator import clone
from maniport.evaluation import RMSE, rmse
from maniport.spd import mean
from maniport.spd.matrix_functions import apply
from maniport.studies import trajectories
from maniport.transfer import (
    DomainAdapter,
    EllipsoidCorrespondence,
    NearestNeighbor,
    ParallelTransport,
    RiemannianICP,
)
from maniport.transfer.rigid_adapter import RigidMap
from maniport.transfer.rotation_group import random_rotation
from maniport.util.defaults import DAMPING
from maniport.util.progress import Progress, Step, counted, pieces
from maniport.util.validation import Array

PAPER, OURS = "ours, paper's settings", "ours, defaults"  # How a row is fitted and measured
SEPARATE, SAME = (
    "random, sampled separately for each arm",
    "random, the same joint samples for both arms",
)
DRAWS = 10  # Random sets over which errors are averaged
PRINTED = (
    "table",
    "row",
    "paper_rmse",
    "paper_iterations",
)  # Keys of a line with numbers of the paper

Domains = tuple[Array, Array]  # Ellipsoids of the teacher and of the student
Pairs = Mapping[
    str, Domains
]  # By evaluation set: ellipsoids (k, d, d) of the teacher, and the truth
Line = dict[str, Any]
"""Errors of one method on one evaluation set: means over draws, with the row of the paper where it prints the number.

Keys: ``table``, ``row``, ``paper_rmse`` and ``paper_iterations`` (None where the paper has none), ``data``,
``samples``, ``method``, ``evaluation``, ``settings`` (`PAPER` or `OURS`), each form of `RMSE` with its standard
deviation (``_spread``), ``iterations``, ``draws``, and ``warned``, the number of fits with warnings.
"""

DEFAULTS = (
    "Our defaults: damping 0.01 instead of a floor of 1e-4, and the known base rotation. Numbers with different "
    "regularization must not be compared."
)
TOY_NOTES = (
    "Student: 100 uniform joint samples of the Panda, with eigenvalues of at least 1e-4. Teacher: the same ellipsoids "
    "after a random rotation, change of dispersion and change of mean for each seed. Evaluated on 10 new ellipsoids; "
    "the correct error is 0.",
)
ARMS_NOTES = (
    "Trajectories: 20 of 20 points, the same for both arms; smaller sets take every n-th point. Evaluated on three "
    "more, where the student at the same joint angles is the truth: the correct error is 0.",
    "Random samples: 500 uniform ones, sampled separately for each arm as in the paper. Both domains are symmetric "
    "under rotations in the arm's plane: without the base rotation no method can find it. With the same joint samples "
    "the correct error is 0.",
    DEFAULTS,
)
HUMAN_NOTES = (
    "Trajectories: eight of 50 points; the person's from the authors' published code, the Panda's by following the "
    "same scaled hand paths. Random sets: uniform joint samples, every n-th of 400 for each arm.",
    "There is no ground truth. As in the paper, the error is the distance to a naive baseline: 5000 samples of the "
    "person's domain looked up among 5000 of the Panda's. 'Naive baseline, resampled' is its distance to itself with "
    "other samples: errors of this size and below are noise.",
    DEFAULTS,
)


@dataclass(frozen=True)
class PaperRow:
    """One row of a table of the paper."""

    table: str  # Roman number
    row: int  # counted from the top, beginning with 1
    data: str  # the domains of the fit: trajectories or random samples
    samples: int  # of each domain
    method: str  # as printed
    rmse: Mapping[
        str, float
    ]  # by evaluation set; divided by the dispersion of the mapped set (eq. 19)
    start: str  # of ICP, see `maniport.RiemannianICP`
    exponent: float | None  # k of the weights w^k; None for parallel transport without ICP
    most_singular: int | None  # samples that are matched, when not all
    iterations: int | None  # until convergence, where printed

    @property
    def label(self) -> str:
        """Number of samples, as the paper writes it."""
        return (
            f"{self.most_singular} most singular of {self.samples}"
            if self.most_singular
            else str(self.samples)
        )


TOY = "10 new points"
EVALUATIONS = {
    "I": [TOY],
    "II": [f"M-Eval-{i}" for i in (1, 2, 3)],
    "III": [f"H-Eval-{i}" for i in (1, 2, 3, 4)],
}
"""Sets that the maps of each table are evaluated on, in the order of its columns."""


def paper_table(number: str) -> list[PaperRow]:
    """Rows of Table I, II or III, from the top, as in `printed.csv` next to this module."""
    lines, rows = (
        (files(__package__) / "printed.csv").read_text(encoding="utf-8").splitlines(),
        list[PaperRow](),
    )
    for row in csv.DictReader(lines[1:]):
        if row["table"] == number:
            errors = dict(zip(EVALUATIONS[number], map(float, row["errors"].split()), strict=True))
            exponent = float(row["exponent"]) if row["exponent"] else None
            most, iterations = (
                int(row[key]) if row[key] else None for key in ("most_singular", "iterations")
            )
            own = (
                row["data"],
                int(row["samples"]),
                row["method"],
                errors,
                row["start"],
                exponent,
                most,
                iterations,
            )
            rows.append(PaperRow(number, len(rows) + 1, *own))
    return rows


def adapter_of(
    row: PaperRow, settings: str, base_rotation: ArrayLike | None, damping: float | None
) -> DomainAdapter:
    """Return the adapter of a row: by the paper's text, or the same method with maniport's defaults."""
    options: dict[str, Any] = (
        {} if settings == PAPER else {"damping": damping, "base_rotation": base_rotation}
    )
    if row.exponent is None:
        return ParallelTransport(**options)
    if settings == PAPER:
        matching = EllipsoidCorrespondence(row.exponent)
        options |= {"correspondence": matching, "start": row.start, "require_improvement": False}
    return RiemannianICP(**options, most_singular=row.most_singular)


@dataclass(frozen=True)
class Draw:
    """The data of one fit and its evaluation."""

    teacher: Array  # (n, d, d), a domain
    student: Array  # (m, d, d), a domain
    evaluation: Pairs


@dataclass(frozen=True)
class Experiment:
    """One experiment of the paper, repeated."""

    name: str
    title: str
    notes: tuple[str, ...]
    lines: tuple[Line, ...]


def toy(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the toy experiment on several draws, beginning with seed `seed`."""
    data = [_toy_draw(seed + k) for k in range(draws)]
    title, lines, rows = "Table I: toy data", list[Line](), paper_table("I")
    for row in counted(rows, len(rows), Step(progress, title)):
        for settings in (PAPER, OURS):
            lines += measure(adapter_of(row, settings, None, None), data, settings, row.data, row)
    return Experiment("toy", title, TOY_NOTES, tuple(lines))


def _toy_draw(seed: int, samples: int = 100, new: int = 10) -> Draw:
    """Sample the Panda's ellipsoids, and transform them rigidly for the teacher."""
    random, arm = np.random.default_rng(seed), trajectories.robot_arm()
    ellipsoids = arm.manipulability(arm.sample(samples + new, random, "uniform"))
    student, others = np.split(_raised(ellipsoids), [samples])

    def factors(size: int | None = None) -> Array:
        return np.exp(random.uniform(-np.log(2.0), np.log(2.0), size))

    axes = random_rotation(3, random)
    center = np.asarray((axes * factors(3)) @ axes.T)
    transform = RigidMap(mean(student), center, random_rotation(3, random), float(factors()))
    return Draw(transform.apply(student), student, {TOY: (transform.apply(others), others)})


def two_dof(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment with two-joint arms; random sets begin with seed `seed`.

    Random rows come twice, with separate and with the same joint samples; the paper has only the first.
    """
    title, rows, arms = "Table II: two-joint arms", paper_table("II"), trajectories.two_dof_arms()
    jobs = [(row, "trajectories") for row in rows if row.data == "trajectories"]
    jobs += [(row, data) for data in (SEPARATE, SAME) for row in rows if row.data == "random"]
    truth = {
        name: _ellipsoids(arms, path, path)
        for name, path in trajectories.two_dof_evaluation().items()
    }
    domains = {
        "trajectories": [_ellipsoids(arms, *2 * [trajectories.two_dof_training().reshape(-1, 2)])]
    }
    domains[SEPARATE] = [_uniform(arms, 500, seed + k) for k in range(draws)]
    same = (arms[0].sample(500, np.random.default_rng(seed + k), "uniform") for k in range(draws))
    domains[SAME] = [_ellipsoids(arms, path, path) for path in same]
    lines = list[Line]()
    for row, data in counted(jobs, len(jobs), Step(progress, title)):
        for settings in (PAPER, OURS):
            sets = [_draw(settings, pair, truth, row.samples) for pair in domains[data]]
            adapter = adapter_of(row, settings, trajectories.MOUNTING, DAMPING)
            lines += measure(adapter, sets, settings, data, row, printed=data != SAME)
    return Experiment("two-dof", title, ARMS_NOTES, tuple(lines))


def human_robot(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment from the human arm to the Panda; random sets begin with seed `seed`."""
    title, samples, rows, lines = (
        "Table III: human arm to Panda",
        5000,
        paper_table("III"),
        list[Line](),
    )
    arms = trajectories.human_arm(), trajectories.robot_arm()
    profiles = {
        name: arms[0].manipulability(path) for name, path in trajectories.human_evaluation().items()
    }
    person = trajectories.human_training()
    paths = (
        np.concatenate(person),
        np.concatenate([trajectories.robot_path(path) for path in person]),
    )
    domains = {"trajectories": [_ellipsoids(arms, *paths)]}
    domains["random"] = [_uniform(arms, 400, seed + k) for k in range(draws)]
    parts = pieces(Step(progress, title), 1.0, 1.0)
    for settings, damping, part in zip((PAPER, OURS), (None, DAMPING), parts, strict=True):
        draw = _draw(
            settings, _uniform(arms, samples, seed), {name: (p, p) for name, p in profiles.items()}
        )
        baseline = NearestNeighbor(damping=damping, n_samples=samples).fit(
            draw.teacher, draw.student
        )
        truth = {
            name: (points, baseline.transform(points))
            for name, (points, _) in draw.evaluation.items()
        }
        for row in counted(rows, len(rows), part):
            sets = [_draw(settings, pair, truth, row.samples) for pair in domains[row.data]]
            data = SEPARATE if row.data == "random" else row.data
            lines += measure(
                adapter_of(row, settings, np.eye(3), DAMPING), sets, settings, data, row
            )
        resampled = _draw(settings, _uniform(arms, samples, seed + 1), truth)
        for line in measure(baseline, [resampled], settings, "baselines", rows[0], printed=False):
            lines.append(line | {"samples": str(samples), "method": "naive baseline, resampled"})
    return Experiment("human-robot", title, HUMAN_NOTES, tuple(lines))


def measure(
    adapter: DomainAdapter,
    draws: Sequence[Draw],
    settings: str,
    data: str,
    row: PaperRow,
    printed: bool = True,
) -> list[Line]:
    """Fit an adapter to every draw; return a line for each evaluation set, with the paper's numbers if `printed`."""
    errors: dict[str, list[RMSE]] = {name: [] for name in draws[0].evaluation}
    iterations, warned = [], 0
    for draw in draws:
        with collected_warnings() as texts:
            fitted = clone(adapter).fit(draw.teacher, draw.student)
        warned += bool(texts)
        iterations.append(fitted.n_iter_)
        for name, (points, truth) in draw.evaluation.items():
            mapped, target = fitted._compared(points, truth)  # with the damping of the fit
            errors[name].append(rmse(target, mapped))
    lines = []
    for name, own in errors.items():
        forms: dict[str, float] = {}
        for form in (form.name for form in fields(RMSE)):
            values = [getattr(error, form) for error in own]
            forms |= {form: float(np.mean(values)), f"{form}_spread": float(np.std(values))}
        paper = row.table, row.row, row.rmse[name], row.iterations
        line: Line = dict(zip(PRINTED, paper if printed else [None] * 4, strict=True))
        line |= {
            "data": data,
            "samples": row.label,
            "method": row.method,
            "evaluation": name,
            "settings": settings,
        }
        counts = {"iterations": float(np.mean(iterations)), "draws": len(draws), "warned": warned}
        lines.append(line | forms | counts)
    return lines


def _raised(points: Array) -> Array:
    """Raise eigenvalues to at least 1e-4 (footnote 1 of the paper); maniport's own defaults have `DAMPING` instead."""
    return apply(points, lambda values: np.maximum(values, 1e-4))


def _draw(settings: str, domains: Domains, evaluation: Pairs, samples: int | None = None) -> Draw:
    """Take every n-th ellipsoid of the domains (§ V-A); the paper's settings raise eigenvalues."""
    raised = (lambda points: points) if settings == OURS else _raised
    teacher, student = (
        raised(points[:: len(points) // (samples or len(points))]) for points in domains
    )
    return Draw(
        teacher,
        student,
        {name: (raised(own), raised(truth)) for name, (own, truth) in evaluation.items()},
    )


def _uniform(arms: tuple[Arm, Arm], samples: int, seed: int) -> Domains:
    random = np.random.default_rng(seed)
    return _ellipsoids(arms, *(arm.sample(samples, random, "uniform") for arm in arms))


def _ellipsoids(arms: tuple[Arm, Arm], teacher_path: Array, student_path: Array) -> Domains:
    return arms[0].manipulability(teacher_path), arms[1].manipulability(student_path)
