"""All measures together, of a fitted adapter and of the cheap alternatives: the judge, and what it finds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import unknown_name
from maniport.evaluation.alternatives import ROWS, Alternative, others_than
from maniport.evaluation.bench import Bench, Source
from maniport.evaluation.verdict import Gaps, Row, Verdict, verdict
from maniport.notebook import ShownInNotebooks
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.regularization import Regularization
from maniport.steps import Progress
from maniport.thinning import evenly
from maniport.tracking.search.feasible import nearest_feasible
from maniport.tracking.search.start_bank import StartBank
from maniport.transfer import DomainAdapter, name_of
from maniport.validation import Array, as_count, as_finite, as_generator


@dataclass(frozen=True)
class Evaluation(ShownInNotebooks):
    """All measures of an adapter beside those of the cheap alternatives.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the alternatives.
    student_noise : Row
        The same measures where they make sense of fresh samples of the student itself: what sampling alone costs.
    settings : dict
        Sizes, regularisation, seed, and where draws came from; ready for JSON.
    """

    rows: tuple[Row, ...]
    student_noise: Row
    settings: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        best = self.verdict.best
        return (
            f"Evaluation({self.adapter.name!r} beside {len(self.rows) - 1} alternatives{best and f'; best: {best!r}'})"
        )

    @property
    def adapter(self) -> Row:
        """The row of the adapter that was evaluated."""
        return self.rows[0]

    @property
    def verdict(self) -> Verdict:
        """Whether the adapter is better than doing nothing, and what to take instead."""
        return verdict(self.rows)

    def row(self, name: str) -> Row:
        """Return the row of that name; `UnknownNameError` where there is none."""
        named = {row.name: row for row in self.rows}
        if name not in named:
            raise unknown_name("row", str(name), named)
        return named[name]


DRAWS = 5
"""Independent draws that stability is measured over."""

POINTS = 128
"""Ellipsoids of a profile whose feasibility gap is searched for at most, evenly spread."""

GAP_SEARCH = "feasibility gap"
"""The setting that says how the feasibility gap was searched; empty where at every ellipsoid, without a floor."""


def evaluate(
    adapter: DomainAdapter,
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm | None = None,
    person: Arm | None = None,
    truth: ArrayLike | None = None,
    pairs: Any = None,
    spec: EllipsoidSpec = VELOCITY,
    name: str | None = None,
    rows: Sequence[str] = ROWS,
    fitted: Mapping[str, DomainAdapter] | None = None,
    bank: StartBank | None = None,
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
        What it was fitted to, without regularisation, each in its own base frame.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along a motion, in the order of time, n ≥ 3.
    robot : Arm, optional
        The student. With it: fresh draws instead of parts of the given domain, and the feasibility gap, of at most 128
        ellipsoids of the profile. Both sides are regularised as the fit did the student's; a floor, which has no
        derivative, is added to all eigenvalues while searching.
    person : Arm, optional
        The teacher; with `robot`, stability is measured over fresh draws of both.
    truth : array_like, shape (n, d, d), optional
        What the profile should become, where that is known.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Known pairs of the teacher's and the student's ellipsoids, if the adapter's `fit` was given any. Its refits get
        them too, and Procrustes analysis needs them to turn anything.
    spec : EllipsoidSpec
        Which ellipsoids of the arms.
    name : str, optional
        What to call the adapter. Default: its method's name, or its class.
    rows : sequence of str
        The alternatives beside it: "raw-copy", "recentring", "parallel-transport", "nearest-neighbor", "procrustes".
    fitted : mapping of str to DomainAdapter, optional
        Alternatives that are fitted to these domains already, with the adapter's regularisation and mounting.
    bank : StartBank, optional
        Starts for the search of the feasibility gap, made for this robot and these ellipsoids. Default: a new one.
    n_domain : int
        Ellipsoids of the teacher's domain whose feasibility gap is measured too; 0 leaves it out.
    draws : int
        Independent draws that stability is measured over; 0 leaves it out. Without both arms the given domains are
        split into four disjoint parts instead.
    random_state, n_jobs, progress
        Seed of all that is drawn; processes for the feasibility gap; called with each step and the fraction done.

    Raises
    ------
    ManiportError
        When the adapter is not fitted, or an input cannot be used.
    """
    tell = progress or (lambda step, fraction, found="": None)
    domains = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    counts = as_count(n_domain, "n_domain", minimum=0), as_count(draws, "draws", minimum=0)
    source = Source(person, robot, spec, *domains)
    bench = Bench.of(adapter, source, profile, truth, counts, as_generator(random_state))
    tested = Alternative(name or name_of(adapter), adapter, _own_words(adapter), fitted=True)
    contestants = (tested, *others_than(adapter, tested.name, rows, pairs, fitted))
    takes_pairs = pairs is not None and "pairs" in signature(adapter.fit).parameters
    found, images = _measured(bench, contestants, {"pairs": pairs} if takes_pairs else {}, tell)
    if robot is not None:
        own, search = adapter.student_regularization, {"bank": bank, "n_jobs": n_jobs, "spec": spec}
        tell("find what the robot can make", 0.0)
        found = _with_feasibility_gaps(found, images, len(bench.profile), lambda at: _gaps(at, robot, own, search))
        tell("find what the robot can make", 1.0)
    return Evaluation(tuple(found), bench.noise(), _settings(adapter, bench, robot is not None, random_state))


def _measured(
    bench: Bench, contestants: Sequence[Alternative], options: dict[str, Any], tell: Progress
) -> tuple[list[Row], list[Array]]:
    """Measure all but feasibility; the first contestant is the adapter, whose refits get `options`."""
    found, images = [], list[Array]()
    for index, one in enumerate(contestants):
        tell("measure", index / len(contestants))
        row, mapped = bench.measure(one, {} if index else options)
        found.append(row)
        images.append(mapped)
    tell("measure", 1.0, f"{len(contestants) - 1} alternatives")
    return found, images


def _with_feasibility_gaps(rows: list[Row], images: list[Array], n: int, gaps: Callable[[Array], Array]) -> list[Row]:
    """Search for all images in one go, which shares the preparation; of each the first `n` are the profile, thinned."""
    along = evenly(n, POINTS)
    asked = [np.concatenate([mapped[along], mapped[n:]]) if len(mapped) else mapped for mapped in images]
    ends = np.cumsum([len(mapped) for mapped in asked])
    different, which = np.unique(
        np.concatenate(asked), axis=0, return_inverse=True
    )  # methods that keep their start map alike
    distances = np.split(gaps(different)[which], ends[:-1])
    return [
        replace(
            row,
            feasibility_gap=Gaps.of(found[: len(along)]) if len(found) else None,
            domain_feasibility_gap=Gaps.of(found[len(along) :]) if len(found) > len(along) else None,
        )
        for row, found in zip(rows, distances, strict=True)
    ]


def _gaps(targets: Array, robot: Arm, own: Regularization, search: dict[str, Any]) -> Array:
    """Distances to the nearest ellipsoids of the robot that the search finds, both regularised as the student was.

    A floor has no derivative where it sets in: the search adds it to all eigenvalues instead, and what it finds is
    measured with eigenvalues below the floor lifted to it, on both sides. Both are upper bounds of the least distance.
    """
    if own.floor is None:
        return nearest_feasible(robot, targets, damping=own, **search).distance
    found = nearest_feasible(robot, targets, damping=Regularization.absolute(own.floor), **search)
    made = robot.ellipsoids(found.joint_positions, search["spec"])
    return distance_unchecked(own.apply(targets), own.apply(made))


def _own_words(adapter: DomainAdapter) -> str:
    """What a fit says of itself: why it ended and, where it looked, what the clouds determine."""
    found = getattr(adapter, "identifiability_", None)
    return "; ".join([str(adapter.stop_reason_), *([found.in_words()] if found is not None else [])])


def _settings(adapter: DomainAdapter, bench: Bench, searched: bool, random_state: Any) -> dict[str, Any]:
    n, search = len(bench.profile), []
    if searched and n > POINTS:
        search.append(f"searched at {POINTS} of the profile's {n} ellipsoids, evenly spread")
    if searched and adapter.floor is not None:
        search.append("the floor is added to all eigenvalues in the search, and lifts those below it in what is told")
    return {
        "profile": f"{len(bench.profile)} ellipsoids",
        "domains": f"{len(bench.source.teacher)} of the teacher, {len(bench.source.student)} of the student",
        "regularisation": str(Regularization(adapter.damping, adapter.floor)),
        GAP_SEARCH: "; ".join(search),
        "identity test": f"{len(bench.identity[0])} and {len(bench.identity[1])} ellipsoids",
        "stability": "not measured" if bench.draws is None else f"{bench.draws[2]} of both domains",
        "seed": random_state if isinstance(random_state, int) else "none",
    }
