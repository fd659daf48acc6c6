"""The experiments of the paper: toy data, two planar arms, and from the human arm to the Panda.

Tables I to III, §§ IV-B, V-A and V-B; Table III measures the distance to a naive baseline.
"""

import time as clock
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import Arm
from maniport.errors import ManiportWarning
from maniport.estimator import clone
from maniport.evaluation import RMSE, rmse
from maniport.spd import mean
from maniport.spd.matrix_functions import apply
from maniport.studies.paper import trajectories
from maniport.studies.paper.tables import (
    OURS,
    PAPER,
    RANDOM,
    TOY,
    TRAJECTORIES,
    PaperRow,
    our_adapter,
    paper_adapter,
    paper_table,
)
from maniport.transfer import DomainAdapter, IdentityMap, NearestNeighbor, ParallelTransport, RiemannianICP
from maniport.transfer.rigid_adapter import RigidMap
from maniport.transfer.rotation_group import random_rotation
from maniport.util.defaults import DAMPING, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, Step, counted, pieces
from maniport.util.validation import Array

DRAWS = 10  # Random sets over which errors are averaged
ALL = 400  # Ellipsoids of a whole training set of trajectories; smaller sets take every n-th
SEPARATE, SAME = "random, sampled separately for each arm", "random, the same joint samples for both arms"

Pairs = Mapping[str, tuple[Array, Array]]  # By evaluation set: ellipsoids (k, d, d) of the teacher, and the truth
Line = dict[str, Any]
"""Errors of one method on one evaluation set: means over draws, with the row of the paper where it prints the number.

Keys: ``table``, ``row``, ``paper_rmse`` and ``paper_iterations`` (None where the paper has none), ``data``,
``samples``, ``method``, ``evaluation``, ``settings`` (`PAPER` or `OURS`), ``adapter``, each form of `RMSE` with its
standard deviation (``_spread``), ``iterations``, ``seconds`` of a fit (median), ``draws``, ``seed`` of the first draw,
and ``warned``, the number of fits with warnings.
"""

TOY_NOTES = (
    "Student: 100 uniform joint samples of the Panda. Teacher: the same ellipsoids after a random rotation, change of "
    "dispersion and change of mean for each seed. Evaluated on 10 new ellipsoids; the correct error is 0.",
    "As in the paper, eigenvalues below 1e-4 are raised to it when the Panda is sampled; no adapter regularizes again.",
)

ARMS_NOTES = (
    "Trajectories: 20 of 20 points, the same for both arms; smaller sets take every n-th point. Evaluated on three "
    "more, where the student at the same joint angles is the truth: the correct error is 0.",
    "Random samples: 500 uniform ones, sampled separately for each arm as in the paper. Both domains are symmetric "
    "under rotations in the arm's plane: without the base rotation no method can find it, and errors depend on the "
    "samples. With the same joint samples the correct error is 0.",
    "Our defaults: damping 0.01 instead of a floor of 1e-4, and the base rotation (a quarter turn about y) is given. "
    "Numbers with different regularization must not be compared.",
)

HUMAN_NOTES = (
    "Trajectories: eight of 50 points; the person's from the authors' published code, the Panda's by following the "
    "same scaled hand paths. Random sets: uniform joint samples, every n-th of 400 for each arm.",
    "There is no ground truth. As in the paper, the error is the distance to a naive baseline: 5000 samples of the "
    "person's domain looked up among 5000 of the Panda's. 'Naive baseline, resampled' is its distance to itself with "
    "other samples: errors of this size and below are noise. A small error means similarity to the lookup.",
    "The authors' program divides by the mean squared distance (÷ c²).",
    "Our defaults: damping 0.01 instead of a floor of 1e-4, for the baseline too, and the base rotation is given (the "
    "same frame). Numbers with different regularization must not be compared.",
)


@dataclass(frozen=True)
class Draw:
    """The data of one fit and its evaluation."""

    seed: int
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
    data = [toy_draw(seed + k) for k in range(draws)]
    title, lines, rows = "Table I: toy data", list[Line](), paper_table("I")
    for row in counted(rows, len(rows), Step(progress, title)):
        lines += measure(paper_adapter(row), data, PAPER, row.data, row)
        lines += measure(our_adapter(row, damping=None), data, OURS, row.data, row)
    return Experiment("toy", title, TOY_NOTES, tuple(lines))


def toy_draw(seed: int, samples: int = 100, new: int = 10) -> Draw:
    """Sample the Panda's ellipsoids, and transform them rigidly for the teacher."""
    random, arm = np.random.default_rng(seed), trajectories.robot_arm()
    ellipsoids = arm.manipulability(arm.sample(samples + new, random, "uniform"))
    student, others = np.split(raised(ellipsoids), [samples])

    def factors(size: int | None = None) -> Array:
        return np.exp(random.uniform(-np.log(2.0), np.log(2.0), size))

    axes = random_rotation(3, random)
    center = np.asarray((axes * factors(3)) @ axes.T)
    transform = RigidMap(mean(student), center, random_rotation(3, random), float(factors()))
    return Draw(seed, transform.apply(student), student, {TOY[0]: (transform.apply(others), others)})


def two_dof(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment with two-joint arms; random sets begin with seed `seed`.

    Random rows come twice, with separate and with the same joint samples; the paper has only the first.
    """
    title, sizes, rows = "Table II: two-joint arms", (256, 1024, 4096), paper_table("II")
    jobs = [(row, TRAJECTORIES) for row in rows if row.data == TRAJECTORIES]
    jobs += [(row, data) for data in (SEPARATE, SAME) for row in rows if row.data == RANDOM]
    arms, lines, seeds = trajectories.two_dof_arms(), list[Line](), range(seed, seed + draws)
    training = trajectories.two_dof_training().reshape(-1, 2)
    truth = {name: _ellipsoids(arms, path, path) for name, path in trajectories.two_dof_evaluation().items()}
    tables, defaults = pieces(Step(progress, title), 0.8, 0.2)
    for row, data in counted(jobs, len(jobs), tables):
        sets = []
        for own in seeds if data != TRAJECTORIES else [seed]:
            first = second = training
            if data != TRAJECTORIES:
                random = np.random.default_rng(own)
                first = second = arms[0].sample(500, random, "uniform")
                if data == SEPARATE:
                    second = arms[1].sample(500, random, "uniform")
            paths = (trajectories.every(path, row.samples) for path in (first, second))
            sets.append((own, _ellipsoids(arms, *paths), truth))
        printed = None if data == SAME else row
        for settings, adapter in ((PAPER, paper_adapter(row)), (OURS, our_adapter(row, trajectories.MOUNTING))):
            chosen = [_draw(settings, *data_set) for data_set in sets]
            lines += measure(adapter, chosen, settings, data, printed, samples=row.label, method=row.method)
    for size in counted(sizes, len(sizes), defaults):
        sobol = []
        for own in seeds:
            random = np.random.default_rng(own)
            sobol.append(Draw(own, *_ellipsoids(arms, *(arm.sample(size, random) for arm in arms)), truth))
        data = "Sobol samples, sampled separately for each arm"
        lines += _measure_defaults(sobol, data, str(size), trajectories.MOUNTING)
    return Experiment("two-dof", title, ARMS_NOTES, tuple(lines))


def human_robot(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment from the human arm to the Panda; random sets begin with seed `seed`."""
    lines, samples, rows, same_frame = list[Line](), 5000, paper_table("III"), np.eye(3)
    title, arms = "Table III: human arm to Panda", (trajectories.human_arm(), trajectories.robot_arm())
    profiles = {name: arms[0].manipulability(path) for name, path in trajectories.human_evaluation().items()}
    remedies: dict[str, dict[str, Any]] = {PAPER: {}, OURS: {"damping": DAMPING}}
    for (settings, remedy), part in zip(remedies.items(), pieces(Step(progress, title), 1.0, 1.0), strict=True):
        draw = _draw(settings, seed, _uniform(arms, samples, seed), {name: (p, p) for name, p in profiles.items()})
        baseline = NearestNeighbor(**remedy, n_samples=samples).fit(draw.teacher, draw.student)
        truth = {name: (points, baseline.transform(points)) for name, (points, _) in draw.evaluation.items()}
        for row in counted(rows, len(rows), part):
            adapter = our_adapter(row, same_frame) if settings == OURS else paper_adapter(row)
            if row.data == TRAJECTORIES:
                paths = (trajectories.every(path, row.samples) for path in _training_paths())
                sets, data = [_draw(settings, seed, _ellipsoids(arms, *paths), truth)], row.data
            else:
                sets, data = [], SEPARATE
                for own in range(seed, seed + draws):
                    teacher, student = (trajectories.every(x, row.samples) for x in _uniform(arms, ALL, own))
                    sets.append(_draw(settings, own, (teacher, student), truth))
            lines += measure(adapter, sets, settings, data, row)
        resampled = [_draw(settings, seed + 1, _uniform(arms, samples, seed + 1), truth)]
        trained = [_draw(settings, seed, _ellipsoids(arms, *_training_paths()), truth)]
        for adapter, sets, count, method in (
            (clone(baseline), resampled, samples, "naive baseline, resampled"),
            (IdentityMap(**remedy), trained, 0, "identity"),
            (ParallelTransport(**remedy), trained, ALL, "PT only"),
        ):
            lines += measure(adapter, sets, settings, "baselines", None, str(count), method)
    large = _ellipsoids(arms, arms[0].sample(TEACHER_SAMPLES, seed), arms[1].sample(STUDENT_SAMPLES, seed + 1))
    sizes = f"{TEACHER_SAMPLES} and {STUDENT_SAMPLES}"
    lines += _measure_defaults([Draw(seed, *large, truth)], "Sobol samples", sizes, same_frame)
    return Experiment("human-robot", title, HUMAN_NOTES, tuple(lines))


def measure(
    adapter: DomainAdapter,
    draws: Sequence[Draw],
    settings: str,
    data: str,
    row: PaperRow | None = None,
    samples: str = "",
    method: str = "",
) -> list[Line]:
    """Fit an adapter to every draw; return a line for each evaluation set."""
    errors: dict[str, list[RMSE]] = {name: [] for name in draws[0].evaluation}
    iterations, seconds, warned = [], [], 0
    for draw in draws:
        fitted = clone(adapter)
        started = clock.perf_counter()
        warned += fit_quietly(fitted, draw)
        seconds.append(clock.perf_counter() - started)
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
        lines.append(
            {
                "table": row and row.table,
                "row": row and row.row,
                "data": data,
                "samples": row.label if row else samples,
                "method": row.method if row else method,
                "evaluation": name,
                "paper_rmse": row and row.rmse[name],
                "paper_iterations": row and row.iterations,
                "settings": settings,
                "adapter": repr(adapter),
                **forms,
                "iterations": float(np.mean(iterations)),
                "seconds": float(np.median(seconds)),
                "draws": len(draws),
                "seed": draws[0].seed,
                "warned": warned,
            }
        )
    return lines


def fit_quietly(adapter: DomainAdapter, draw: Draw) -> bool:
    """Fit an adapter to a draw; return whether the library warned."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        adapter.fit(draw.teacher, draw.student)
    return any(issubclass(warning.category, ManiportWarning) for warning in caught)


def raised(points: Array) -> Array:
    """Raise eigenvalues to at least 1e-4 (footnote 1 of the paper); maniport's own defaults have `DAMPING` instead."""
    return apply(points, lambda values: np.maximum(values, 1e-4))


def _measure_defaults(draws: Sequence[Draw], data: str, samples: str, base_rotation: ArrayLike) -> list[Line]:
    """Measure our defaults with the base rotation, without and with matching."""
    lines = list[Line]()
    for method, kind in (("PT only", ParallelTransport), ("PT + ICP", RiemannianICP)):
        adapter = kind(damping=DAMPING, base_rotation=base_rotation)
        lines += measure(adapter, draws, OURS, data, samples=samples, method=method)
    return lines


def _draw(settings: str, seed: int, domains: tuple[Array, Array], evaluation: Pairs) -> Draw:
    """Return the data of a fit, with raised eigenvalues where the settings are the paper's."""
    if settings == OURS:
        return Draw(seed, *domains, evaluation)
    pairs = {name: (raised(points), raised(truth)) for name, (points, truth) in evaluation.items()}
    return Draw(seed, raised(domains[0]), raised(domains[1]), pairs)


@cache
def _training_paths() -> tuple[Array, Array]:
    """Joint paths of the human arm and the Panda along their training trajectories, shapes (400, 7)."""
    person = trajectories.human_training()
    return np.concatenate(person), np.concatenate([trajectories.robot_path(path) for path in person])


def _uniform(arms: tuple[Arm, Arm], samples: int, seed: int) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    return _ellipsoids(arms, *(arm.sample(samples, random, "uniform") for arm in arms))


def _ellipsoids(arms: tuple[Arm, Arm], teacher_path: Array, student_path: Array) -> tuple[Array, Array]:
    return arms[0].manipulability(teacher_path), arms[1].manipulability(student_path)
