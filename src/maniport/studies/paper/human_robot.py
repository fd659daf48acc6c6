"""Table III: from the human arm to the Panda, measured against the naive baseline (§ V-B)."""

import time as clock
from functools import cache
from typing import Any, Self

import numpy as np
from scipy.spatial import cKDTree

from maniport.arms import Arm
from maniport.estimator import clone
from maniport.spd import exp, log, logm, to_vector, transport
from maniport.spd.regularization import Regularization
from maniport.studies.paper import trajectories
from maniport.studies.paper.outcome import DRAWS, Draw, Experiment, Line, measure, measure_defaults
from maniport.studies.paper.tables import (
    AUTHORS,
    FLOOR,
    OURS,
    PAPER,
    TRAJECTORIES,
    PaperRow,
    our_adapter,
    paper_adapter,
    paper_table,
)
from maniport.transfer import IdentityMap, NearestNeighbor, ParallelTransport
from maniport.util.defaults import DAMPING, STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.progress import Progress, Step, counted, pieces
from maniport.util.validation import Array

ALL = 400  # Ellipsoids of the whole training set, of trajectories as of random samples; smaller sets take every n-th
SAME_FRAME = np.eye(3)  # Base rotation from the person to the Panda
REMEDIES: dict[str, dict[str, Any]] = {PAPER: {"eigenvalue_floor": FLOOR}, OURS: {"damping": DAMPING}}

Truth = dict[str, tuple[Array, Array]]

NOTES = (
    "Trajectories: eight of 50 points; the person's from the authors' published code, the Panda's by following the "
    "same scaled hand paths. Random sets: uniform joint samples, every n-th of 400 for each arm.",
    "There is no ground truth. As in the paper, the error is the distance to a naive baseline: 5000 samples of the "
    "person's domain looked up among 5000 of the Panda's. 'Naive baseline, resampled' is its distance to itself with "
    "other samples: errors of this size and below are noise. A small error means similarity to the lookup.",
    "The authors' program divides by the mean squared distance (÷ c²). Its baseline scales ellipsoids to one volume, "
    "transports the tangent vector from the nearest sample of the person to that sample's nearest of the Panda, and "
    "restores the volume: rows 'ours, authors' baseline'.",
    "Our defaults: damping 0.01 instead of a floor of 1e-4, for the baseline too, and the base rotation is given (the "
    "same frame). Numbers with different regularization must not be compared.",
)


class AuthorsBaseline:
    """Transfer ellipsoids by a lookup of volume-normalized samples and transported tangent vectors."""

    def __init__(self, eigenvalue_floor: float) -> None:
        self._regularization = Regularization(eigenvalue_floor=eigenvalue_floor)

    def fit(self, teacher: Array, student: Array) -> Self:
        """Pair the samples of both domains, shapes (n, 3, 3) and (m, 3, 3)."""
        samples, _ = self._normalized(teacher)
        candidates, _ = self._normalized(student)
        _, nearest = cKDTree(_coordinates(candidates)).query(_coordinates(samples))
        self._samples, self._tangents = samples, log(samples, candidates[nearest])
        self._index = cKDTree(_coordinates(samples))
        return self

    def transform(self, points: Array) -> Array:
        """Return the student's ellipsoids for the teacher's, shapes (n, 3, 3)."""
        normalized, scale = self._normalized(points)
        _, nearest = self._index.query(_coordinates(normalized))
        tangents = transport(self._tangents[nearest], self._samples[nearest], normalized)
        return np.asarray(scale * exp(normalized, tangents))

    def _normalized(self, points: Array) -> tuple[Array, Array]:
        """Scale ellipsoids to determinant 1; also return the factors that restore them, shape (n, 1, 1)."""
        raised = self._regularization.apply(points, "ellipsoids")
        scale = np.linalg.det(raised)[:, None, None] ** (1.0 / points.shape[-1])
        return raised / scale, scale


def _coordinates(points: Array) -> Array:
    """Vectors whose Euclidean distance is the log-Euclidean distance of the ellipsoids."""
    return to_vector(logm(points))


def human_robot(seed: int, progress: Progress | None = None, draws: int = DRAWS) -> Experiment:
    """Run the experiment from the human arm to the Panda; random sets begin with seed `seed`."""
    lines, samples, rows = list[Line](), 5000, paper_table("III")
    title, facts = "Table III: human arm to Panda", dict[str, Any]({"naive baseline, samples of each domain": samples})
    authors_truth = evaluation(AuthorsBaseline(FLOOR).fit(*_uniform(samples, seed)))
    parts = pieces(Step(progress, title), *(1.0 for _ in REMEDIES))
    for (settings, remedy), part in zip(REMEDIES.items(), parts, strict=True):
        started = clock.perf_counter()
        baseline = naive_baseline(remedy, seed, samples)
        facts[f"naive baseline, seconds to build, {settings}"] = clock.perf_counter() - started
        truths = [(settings, evaluation(baseline))] + [(AUTHORS, authors_truth)] * (settings == PAPER)
        for row in counted(rows, len(rows), part):
            for name, truth in truths:
                lines += _row(row, name, seed, draws, truth)
        truth = truths[0][1]
        resampled = [Draw(seed + 1, *_uniform(samples, seed + 1), truth)]
        trained = [Draw(seed, *training(ALL), truth)]
        for adapter, sets, count, method in (
            (clone(baseline), resampled, samples, "naive baseline, resampled"),
            (IdentityMap(**remedy), trained, 0, "identity"),
            (ParallelTransport(**remedy), trained, ALL, "PT only"),
        ):
            lines += measure(adapter, sets, settings, "baselines", None, str(count), method)
    teacher, student = _arms()
    large = _ellipsoids(teacher.sample(TEACHER_SAMPLES, seed), student.sample(STUDENT_SAMPLES, seed + 1))
    sizes = f"{TEACHER_SAMPLES} and {STUDENT_SAMPLES}"
    lines += measure_defaults([Draw(seed, *large, truth)], "Sobol samples", sizes, SAME_FRAME)
    return Experiment("human-robot", title, NOTES, tuple(lines), facts)


def naive_baseline(remedy: dict[str, Any], seed: int, samples: int = 5000) -> NearestNeighbor:
    """Build the table of the naive baseline from uniform samples of both arms."""
    return NearestNeighbor(**remedy, n_samples=samples).fit(*_uniform(samples, seed))


def evaluation(baseline: NearestNeighbor | AuthorsBaseline) -> Truth:
    """H-Eval-1 to -4: the person's ellipsoids and the baseline's answers, shapes (50, 3, 3)."""
    arm = trajectories.human_arm()
    profiles = {name: arm.manipulability(path) for name, path in trajectories.human_evaluation().items()}
    return {name: (profile, baseline.transform(profile)) for name, profile in profiles.items()}


def training(samples: int) -> tuple[Array, Array]:
    """Ellipsoids of both arms along their training trajectories, every n-th of 400; shapes (samples, 3, 3)."""
    return _ellipsoids(*(trajectories.every(path, samples) for path in _training_paths()))


@cache
def _training_paths() -> tuple[Array, Array]:
    """Joint paths of both arms along their training trajectories, shapes (400, 7)."""
    person = trajectories.human_training()
    return np.concatenate(person), np.concatenate([trajectories.robot_path(path) for path in person])


def _row(row: PaperRow, settings: str, seed: int, draws: int, truth: Truth) -> list[Line]:
    adapter = our_adapter(row, SAME_FRAME) if settings == OURS else paper_adapter(row)
    exact, sets = settings == AUTHORS, []
    if row.data == TRAJECTORIES:
        return measure(adapter, [Draw(seed, *training(row.samples), truth, exact)], settings, row.data, row)
    for s in range(seed, seed + draws):
        teacher, student = (trajectories.every(points, row.samples) for points in _uniform(ALL, s))
        sets.append(Draw(s, teacher, student, truth, exact))
    return measure(adapter, sets, settings, "random, sampled separately for each arm", row)


def _uniform(samples: int, seed: int) -> tuple[Array, Array]:
    random = np.random.default_rng(seed)
    return _ellipsoids(*(arm.sample(samples, random, "uniform") for arm in _arms()))


def _ellipsoids(teacher_path: Array, student_path: Array) -> tuple[Array, Array]:
    teacher, student = _arms()
    return teacher.manipulability(teacher_path), student.manipulability(student_path)


def _arms() -> tuple[Arm, Arm]:
    return trajectories.human_arm(), trajectories.robot_arm()
