"""Table II: two planar arms of two joints, one horizontal and one vertical (§ V-A)."""

from collections.abc import Iterator

import numpy as np

from maniport.steps import Progress
from maniport.studies.paper import trajectories
from maniport.studies.paper.outcome import DRAWS, Draw, Experiment, Outcome, measure
from maniport.studies.paper.settings import DAMPING, OURS, PAPER, our_adapter, paper_adapter
from maniport.studies.paper.tables import RANDOM, TRAJECTORIES, PaperRow, paper_table
from maniport.transfer import ParallelTransport, RiemannianICP
from maniport.validation import Array

RANDOM_SAMPLES = 500
SIZES = (256, 1024, 4096)
STEP = "Table II: two-joint arms"

SEPARATE, SAME = "random, drawn separately for each arm", "random, the same joint samples for both arms"
SOBOL = "Sobol samples, drawn separately for each arm"

NOTES = (
    "Trajectories: 20 of 20 points, the same for both arms; smaller sets take every n-th point. Evaluated on three "
    "more, where the truth is known: the student at the same joint angles. The right error is 0, and every method "
    "reaches it but parallel transport alone without the mounting, which cannot see a quarter turn.",
    "Random samples: 500 uniform ones, drawn separately for each arm as in the paper; smaller sets take every n-th. "
    "Drawn separately, the two sets are no rotated copies of each other, and both domains are symmetric under any turn "
    "in the arm's plane: without the mounting, no method can find that turn, and its errors are accidents of sampling. "
    "With the same joint samples for both arms the truth lies in the model class, and the right error is 0.",
    "Our defaults: damping 0.01 instead of a floor of 1e-4, and the mounting (a quarter turn about y) is known. The "
    "numbers of the two settings have different regularisations, and compare with their own right error, 0, only.",
)


def two_dof(
    seed: int = 0, tell: Progress | None = None, draws: int = DRAWS, sizes: tuple[int, ...] = SIZES
) -> Experiment:
    """Run the experiment with two-joint arms; random sets begin with seed `seed`."""
    jobs = list(_jobs(seed, draws))
    outcomes: list[Outcome] = []
    for i, (row, data, sets) in enumerate(jobs):
        both = {PAPER: paper_adapter(row), OURS: our_adapter(row, trajectories.MOUNTING)}
        printed = None if data == SAME else row  # the paper has no such data
        for settings, adapter in both.items():
            outcomes += measure(adapter, sets, settings, data, printed, samples=row.label, method=row.method)
        if tell is not None:
            tell(STEP, 0.8 * (i + 1) / len(jobs))
    for i, size in enumerate(sizes):
        outcomes += _at_size(size, seed, draws)
        if tell is not None:
            tell(STEP, 0.8 + 0.19 * (i + 1) / len(sizes))
    return Experiment("two-dof", STEP, NOTES, tuple(outcomes))


def evaluation() -> dict[str, tuple[Array, Array]]:
    """M-Eval-1 to -3: the teacher's ellipsoids and the student's at the same joint angles, shapes (20, 3, 3)."""
    return {name: _ellipsoids(path, path) for name, path in trajectories.two_dof_evaluation().items()}


def training(samples: int) -> tuple[Array, Array]:
    """Ellipsoids of both arms along the training trajectories, every n-th of 400; shapes (samples, 3, 3)."""
    path = _every(trajectories.two_dof_training().reshape(-1, 2), samples)
    return _ellipsoids(path, path)


def _jobs(seed: int, draws: int) -> Iterator[tuple[PaperRow, str, list[Draw]]]:
    """Rows of the table with their data; random rows come twice, with separate and with the same joint samples."""
    known, rows = evaluation(), paper_table("II")
    for row in rows:
        if row.data == TRAJECTORIES:
            yield row, TRAJECTORIES, [Draw(seed, *training(row.samples), known)]
    for name in (SEPARATE, SAME):
        for row in rows:
            if row.data == RANDOM:
                yield row, name, [Draw(s, *_random(row.samples, s, name), known) for s in range(seed, seed + draws)]


def _random(samples: int, seed: int, how: str) -> tuple[Array, Array]:
    """Ellipsoids of both arms at uniform joint samples, every n-th of 500."""
    teacher, student = trajectories.two_dof_arms()
    random = np.random.default_rng(seed)
    first = teacher.sample(RANDOM_SAMPLES, random, "uniform")
    second = first if how == SAME else student.sample(RANDOM_SAMPLES, random, "uniform")
    return _ellipsoids(_every(first, samples), _every(second, samples))


def _at_size(size: int, seed: int, draws: int) -> list[Outcome]:
    """What the paper did not try: even samples, more of them, and a known mounting."""
    teacher, student = trajectories.two_dof_arms()
    sets = []
    for s in range(seed, seed + draws):
        random = np.random.default_rng(s)
        sets.append(Draw(s, *_ellipsoids(teacher.sample(size, random), student.sample(size, random)), evaluation()))

    adapters = {
        "PT only": ParallelTransport(damping=DAMPING, mounting=trajectories.MOUNTING),
        "PT + ICP": RiemannianICP(damping=DAMPING, mounting=trajectories.MOUNTING),
    }
    return [
        outcome
        for method, adapter in adapters.items()
        for outcome in measure(adapter, sets, OURS, SOBOL, samples=str(size), method=method)
    ]


def _ellipsoids(teacher_path: Array, student_path: Array) -> tuple[Array, Array]:
    teacher, student = trajectories.two_dof_arms()
    return teacher.manipulability(teacher_path), student.manipulability(student_path)


def _every(points: Array, samples: int) -> Array:
    """Every n-th point, so many that `samples` remain (§ V-A)."""
    return points[:: len(points) // samples]
