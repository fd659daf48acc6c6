"""All measures together, of a fitted adapter and of the cheap alternatives."""

from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.evaluation.alternatives import Alternative, others_than
from maniport.evaluation.bench import Bench, StudentCloud
from maniport.evaluation.draws import fresh_samples, identity_draws, stability_draws
from maniport.evaluation.result import Evaluation
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.transfer import DomainAdapter, name_of
from maniport.validation import Array, as_count, as_finite, as_generator, as_points

DRAWS = 5
"""Independent draws that stability is measured over."""

OWN_SAMPLES = "student's own fresh samples"


def evaluate(
    adapter: DomainAdapter,
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm | None = None,
    person: Arm | None = None,
    truth: ArrayLike | None = None,
    fresh: ArrayLike | None = None,
    pairs: Any = None,
    kind: str = "velocity",
    part: str = "translation",
    joint_weights: ArrayLike | str | None = None,
    name: str | None = None,
    n_domain: int = 128,
    draws: int = DRAWS,
    random_state: Any = 0,
    n_jobs: int | None = None,
    progress: Progress | None = None,
) -> Evaluation:
    """Measure a fitted adapter beside doing nothing and other cheap alternatives.

    Parameters
    ----------
    adapter : DomainAdapter
        Fitted to these domains; it is not changed.
    teacher_domain, student_domain : array_like, shapes (N, d, d) and (M, d, d)
        What it was fitted to, without regularisation.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along a motion, in the order of time, n ≥ 3.
    robot : Arm, optional
        The student. With it: the feasibility gap, and fresh draws instead of parts of the given domain.
    person : Arm, optional
        The teacher; with `robot`, stability is measured over fresh draws of both.
    truth : array_like, shape (n, d, d), optional
        What the profile should become, where that is known.
    fresh : array_like, shape (k, d, d), optional
        Fresh samples of the student, for its sampling noise. Default: drawn from `robot`, else kept out of its domain.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Known pairs of the teacher's and the student's ellipsoids, if the adapter's `fit` was given any. Its refits get
        them too, and Procrustes analysis needs them to turn anything.
    kind, part, joint_weights
        Which ellipsoids of the arms, as in `Arm.manipulability`.
    name : str, optional
        What to call the adapter. Default: its method's name, or its class.
    n_domain : int
        Ellipsoids of the teacher's domain whose feasibility gap is measured too; 0 leaves it out.
    draws : int
        Independent draws that stability is measured over; 0 leaves it out. Without both arms the given domains are
        split into four disjoint parts instead.
    random_state : None, int or numpy.random.Generator
        For everything that is drawn.
    n_jobs : int, optional
        Processes for the feasibility gap, as in joblib.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Returns
    -------
    Evaluation

    Raises
    ------
    NotFittedError
        When the adapter is not fitted.
    ManiportError
        When an input cannot be used.
    """
    tell = progress or (lambda step, fraction, found="": None)
    options = {"kind": kind, "part": part, "joint_weights": joint_weights}
    numbers = {"n_domain": n_domain, "draws": draws, "random_state": random_state}
    bench = _bench(adapter, (teacher_domain, student_domain), profile, truth, fresh, (person, robot), options, numbers)
    tested = Alternative(name or name_of(adapter), adapter, _own_words(adapter))
    contestants = (tested, *others_than(adapter, name, pairs))
    rows, images = [], list[Array]()
    for index, one in enumerate(contestants):
        tell("measure", index / len(contestants))
        takes_pairs = index == 0 and pairs is not None and "pairs" in signature(adapter.fit).parameters
        row, mapped = bench.measure(one, index == 0, {"pairs": pairs} if takes_pairs else {})
        rows.append(row)
        images.append(mapped)
    tell("measure", 1.0, f"{len(contestants) - 1} alternatives")
    if robot is not None:
        tell("find what the robot can make", 0.0)
        lift = adapter.student_damping_ if adapter.floor is None else adapter.floor
        rows = bench.with_feasibility_gaps(rows, images, robot, {"floor": float(lift), "n_jobs": n_jobs, **options})
        tell("find what the robot can make", 1.0)
    return Evaluation(tuple(rows), bench.noise(), _settings(adapter, bench, random_state))


def _own_words(adapter: DomainAdapter) -> str:
    """What a fit says of itself: why it ended and, where it looked, what the clouds determine."""
    found = getattr(adapter, "identifiability_", None)
    return "; ".join([str(adapter.stop_reason_), *([found.in_words()] if found is not None else [])])


def _bench(
    adapter: DomainAdapter,
    domains: tuple[ArrayLike, ArrayLike],
    profile: ArrayLike,
    truth: ArrayLike | None,
    fresh: ArrayLike | None,
    arms: tuple[Arm | None, Arm | None],
    options: dict[str, Any],
    numbers: dict[str, Any],
) -> Bench:
    """Check what was given and draw what is missing."""
    random = as_generator(numbers["random_state"])
    n_domain, draws = as_count(numbers["n_domain"], "n_domain", minimum=0), as_count(numbers["draws"], "draws", 0)
    cloud = as_points(adapter.student_side(domains[1], "student_domain"), "student_domain")
    teacher, student = as_finite(domains[0], "teacher_domain"), as_finite(domains[1], "student_domain")
    person, robot = arms
    identity = identity_draws(robot, options, student, random)
    kept = fresh_samples(robot, options, student, random) if fresh is None else as_finite(fresh, "fresh")
    return Bench(
        clouds=(teacher, student),
        profile=as_finite(profile, "profile"),
        original=as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3),
        truth=None if truth is None else adapter.student_side(truth, "truth"),
        probes=teacher[np.sort(random.permutation(len(teacher))[:n_domain])],
        student=StudentCloud.of(cloud),
        fresh=adapter.student_side(kept, "fresh"),
        identity=identity,
        draws=stability_draws(person, robot, options, (teacher, student), draws, random) if draws else None,
    )


def _settings(adapter: DomainAdapter, bench: Bench, random_state: Any) -> dict[str, Any]:
    return {
        "profile": f"{len(bench.profile)} ellipsoids",
        "domains": f"{len(bench.clouds[0])} of the teacher, {len(bench.clouds[1])} of the student",
        "regularisation": str(Regularization(adapter.damping, adapter.floor)),
        "identity test": f"{len(bench.identity[0])} and {len(bench.identity[1])} ellipsoids",
        "stability": "not measured" if bench.draws is None else bench.draws.words,
        "seed": random_state if isinstance(random_state, int) else "none",
    }
