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

# How a row is fitted and measured
PAPER = "ours, paper's settings"
OURS = "ours, defaults"
SEPARATE = "random, sampled separately for each arm"
SAME = "random, the same joint samples for both arms"
OWN_MEANS = "means of the evaluation trajectory"
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
    "Parallel transport alone uses no pairs. With the means of each evaluation trajectory its errors are nearer to the "
    "paper's, but do not reach them.",
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
        if self.most_singular:
            return f"{self.most_singular} most singular of {self.samples}"
        return str(self.samples)


TOY = "10 new points"
EVALUATIONS = {
    "I": [TOY],
    "II": ["M-Eval-1", "M-Eval-2", "M-Eval-3"],
    "III": ["H-Eval-1", "H-Eval-2", "H-Eval-3", "H-Eval-4"],
}
"""Sets that the maps of each table are evaluated on, in the order of its columns."""


def paper_table(number: str) -> list[PaperRow]:
    """Rows of Table I, II or III, from the top, as in `printed.csv` next to this module."""
    lines = (files(__package__) / "printed.csv").read_text(encoding="utf-8").splitlines()
    rows = list[PaperRow]()
    for row in csv.DictReader(lines[1:]):
        if row["table"] != number:
            continue
        errors = map(float, row["errors"].split())
        exponent = None
        if row["exponent"]:
            exponent = float(row["exponent"])
        printed = PaperRow(
            table=number,
            row=len(rows) + 1,
            data=row["data"],
            samples=int(row["samples"]),
            method=row["method"],
            rmse=dict(zip(EVALUATIONS[number], errors, strict=True)),
            start=row["start"],
            exponent=exponent,
            most_singular=_integer(row["most_singular"]),
            iterations=_integer(row["iterations"]),
        )
        rows.append(printed)
    return rows


def _integer(text: str) -> int | None:
    """Return the number of a cell; None of an empty one."""
    if not text:
        return None
    return int(text)


def adapter_of(
    row: PaperRow, settings: str, base_rotation: ArrayLike | None, damping: float | None
) -> DomainAdapter:
    """Return the adapter of a row: by the paper's text, or the same method with maniport's defaults."""
    options: dict[str, Any] = {}  # passed on
    if settings != PAPER:
        options = {"damping": damping, "base_rotation": base_rotation}
    if row.exponent is None:
        return ParallelTransport(**options)
    if settings == PAPER:
        matching = EllipsoidCorrespondence(row.exponent)
        options |= {
            "correspondence": matching,
            "start": row.start,
            "require_improvement": False,
            "criterion": "correspondence",
        }
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
    title = "Table I: toy data"
    lines = list[Line]()
    rows = paper_table("I")
    for row in counted(rows, len(rows), Step(progress, title)):
        for settings in (PAPER, OURS):
            lines += measure(adapter_of(row, settings, None, None), data, settings, row.data, row)
    return Experiment("toy", title, TOY_NOTES, tuple(lines))


def _toy_draw(seed: int, samples: int = 100, new: int = 10) -> Draw:
    """Sample the Panda's ellipsoids, and transform them rigidly for the teacher."""
    random = np.random.default_rng(seed)
    arm = trajectories.robot_arm()
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
    title = "Table II: two-joint arms"
    rows = paper_table("II")
    arms = trajectories.two_dof_arms()
    jobs = []
    for wanted, data in (("trajectories", "trajectories"), ("random", SEPARATE), ("random", SAME)):
        jobs += [(row, data) for row in rows if row.data == wanted]
    truth = {}
    for name, path in trajectories.two_dof_evaluation().items():
        truth[name] = _ellipsoids(arms, path, path)

    training = trajectories.two_dof_training().reshape(-1, 2)
    domains: dict[str, list[Domains]] = {
        "trajectories": [_ellipsoids(arms, training, training)],
        SEPARATE: [],
        SAME: [],
    }
    for k in range(draws):
        domains[SEPARATE].append(_uniform(arms, 500, seed + k))
    for k in range(draws):
        path = arms[0].sample(500, np.random.default_rng(seed + k), "uniform")
        domains[SAME].append(_ellipsoids(arms, path, path))
    lines = list[Line]()
    for row, data in counted(jobs, len(jobs), Step(progress, title)):
        for settings in (PAPER, OURS):
            sets = [_draw(settings, pair, truth, row.samples) for pair in domains[data]]
            adapter = adapter_of(row, settings, trajectories.MOUNTING, DAMPING)
            lines += measure(adapter, sets, settings, data, row, printed=data != SAME)
    lines += _own_means(truth, rows[0])
    return Experiment("two-dof", title, ARMS_NOTES, tuple(lines))


def _own_means(truth: Pairs, row: PaperRow) -> list[Line]:
    """Errors of parallel transport with the means of each evaluation trajectory instead of those of the domains."""
    lines = list[Line]()
    for name, (points, images) in truth.items():
        teacher = _raised(points)
        student = _raised(images)
        draw = Draw(teacher, student, {name: (teacher, student)})
        for line in measure(ParallelTransport(), [draw], PAPER, OWN_MEANS, row, printed=False):
            lines.append(line | {"samples": str(len(points))})
    return lines


def human_robot(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment from the human arm to the Panda; random sets begin with seed `seed`."""
    title = "Table III: human arm to Panda"
    samples = 5000
    rows = paper_table("III")
    lines = list[Line]()
    arms = trajectories.human_arm(), trajectories.robot_arm()
    profiles = {}
    for name, path in trajectories.human_evaluation().items():
        profile = arms[0].manipulability(path)
        profiles[name] = (profile, profile)
    paths = trajectories.human_training()
    robot_paths = []
    for path in paths:
        robot_paths.append(trajectories.robot_path(path))
    training = _ellipsoids(arms, np.concatenate(paths), np.concatenate(robot_paths))
    random = [_uniform(arms, 400, seed + k) for k in range(draws)]
    parts = pieces(Step(progress, title), 1.0, 1.0)
    for settings, damping, part in zip((PAPER, OURS), (None, DAMPING), parts, strict=True):
        draw = _draw(settings, _uniform(arms, samples, seed), profiles)
        unfitted = NearestNeighbor(damping=damping, n_samples=samples)
        baseline = unfitted.fit(draw.teacher, draw.student)
        truth = {}
        for name, (points, _) in draw.evaluation.items():
            truth[name] = (points, baseline.transform(points))
        for row in counted(rows, len(rows), part):
            data = row.data
            domains = [training]
            if data == "random":
                data = SEPARATE
                domains = random
            sets = [_draw(settings, pair, truth, row.samples) for pair in domains]
            adapter = adapter_of(row, settings, np.eye(3), DAMPING)
            lines += measure(adapter, sets, settings, data, row)
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
    errors: dict[str, list[RMSE]] = {}
    iterations = []
    warned = 0
    for draw in draws:
        with collected_warnings() as texts:
            fitted = clone(adapter).fit(draw.teacher, draw.student)
        warned += bool(texts)
        iterations.append(fitted.n_iter_)
        for name, (points, truth) in draw.evaluation.items():
            mapped, target = fitted._compared(points, truth)  # with the damping of the fit
            errors.setdefault(name, []).append(rmse(target, mapped))
    lines = []
    for name, of_draws in errors.items():
        forms: dict[str, float] = {}
        for field in fields(RMSE):
            values = [getattr(error, field.name) for error in of_draws]
            forms[field.name] = float(np.mean(values))
            forms[f"{field.name}_spread"] = float(np.std(values))
        line: Line = dict.fromkeys(PRINTED)
        if printed:
            paper = row.table, row.row, row.rmse[name], row.iterations
            line = dict(zip(PRINTED, paper, strict=True))
        line |= {
            "data": data,
            "samples": row.label,
            "method": row.method,
            "evaluation": name,
            "settings": settings,
        }
        counts = {
            "iterations": float(np.mean(iterations)),
            "draws": len(draws),
            "warned": warned,
        }
        lines.append(line | forms | counts)
    return lines


def _raised(points: Array) -> Array:
    """Raise eigenvalues to at least 1e-4 (footnote 1 of the paper); maniport's own defaults have `DAMPING` instead."""
    return apply(points, lambda values: np.maximum(values, 1e-4))


def _draw(settings: str, domains: Domains, evaluation: Pairs, samples: int | None = None) -> Draw:
    """Take every n-th ellipsoid of the domains (§ V-A); the paper's settings raise eigenvalues."""
    teacher, student = domains
    if samples is not None:
        teacher = teacher[:: len(teacher) // samples]
        student = student[:: len(student) // samples]
    if settings == OURS:
        return Draw(teacher, student, evaluation)
    raised = {}
    for name, (points, truth) in evaluation.items():
        raised[name] = (_raised(points), _raised(truth))
    return Draw(_raised(teacher), _raised(student), raised)


def _uniform(arms: tuple[Arm, Arm], samples: int, seed: int) -> Domains:
    random = np.random.default_rng(seed)
    teacher_path = arms[0].sample(samples, random, "uniform")
    student_path = arms[1].sample(samples, random, "uniform")
    return _ellipsoids(arms, teacher_path, student_path)


def _ellipsoids(arms: tuple[Arm, Arm], teacher_path: Array, student_path: Array) -> Domains:
    return arms[0].manipulability(teacher_path), arms[1].manipulability(student_path)
