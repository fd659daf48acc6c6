"""All measures together, of a fitted adapter and of the cheap alternatives: the judge, and what it finds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, unknown_name
from maniport.evaluation.alternatives import ROWS, Alternative, others_than
from maniport.evaluation.bench import Bench, Counts, Source
from maniport.evaluation.gap_search import GapSearch
from maniport.evaluation.rows import Row
from maniport.evaluation.verdict import Verdict, verdict
from maniport.feasibility import knowing
from maniport.notebook import ShownInNotebooks
from maniport.spd.regularization import Regularization
from maniport.steps import Progress, Step
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

    See Also
    --------
    evaluate : makes it.
    Row : the measures of one adapter.
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
    robot, person : Arm, optional
        The student and the teacher. With the student: fresh draws instead of parts of its domain, and the feasibility
        gap, of at most 128 ellipsoids of the profile (`maniport.evaluation.gap_search`); both sides are regularised as
        the student's. With both arms stability is measured over fresh draws of both.
    truth : array_like, shape (n, d, d), optional
        What the profile should become, where that is known.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Those that the adapter's `fit` was given, if any: for its refits, and for Procrustes analysis to turn anything.
    spec : EllipsoidSpec
        Which ellipsoids of the arms.
    name : str, optional
        What to call the adapter. Default: its method's name, or its class.
    rows : sequence of str
        The alternatives: names of `maniport.transfer.METHODS`, and "procrustes".
    fitted : mapping of str to DomainAdapter, optional
        Alternatives that are fitted to these domains already, regularised and mounted as the adapter; others come last.
    bank : StartBank, optional
        Starts for the search of the feasibility gap, made for this robot and these ellipsoids. Default: a new one.
    n_domain, draws : int
        Ellipsoids of the teacher's domain whose feasibility gap is measured, too; draws that stability is measured
        over (without both arms: four disjoint parts of the domains). 0 leaves it out.
    random_state, n_jobs, progress
        Seed of all that is drawn; processes for the feasibility gap; called with each step and the fraction done.

    Raises
    ------
    ManiportError
        When the adapter is not fitted, or an input cannot be used.

    See Also
    --------
    Evaluation : what comes out.
    """
    _require_kinds(adapter, robot, person, profile, truth)
    source = Source(person, robot, spec, *_domains(teacher_domain, student_domain))
    counts = Counts(as_count(n_domain, "n_domain", minimum=0), as_count(draws, "draws", minimum=0))
    judge = Judge.of(adapter, source, profile, truth, counts, as_generator(random_state), bank, n_jobs)
    tested = Alternative(name or name_of(adapter), adapter, own_words(adapter), fitted=True)
    contestants = (tested, *others_than(adapter, tested.name, rows, pairs, fitted))
    takes_pairs = pairs is not None and "pairs" in signature(adapter.fit).parameters
    found = judge.rows(contestants, {"pairs": pairs} if takes_pairs else {}, progress)
    return judge.evaluation(found, adapter, random_state)


@dataclass(frozen=True)
class Judge:
    """Measures one contestant after the other on the same bench."""

    bench: Bench
    gaps: GapSearch | None

    @classmethod
    def of(
        cls,
        adapter: DomainAdapter,
        source: Source,
        profile: ArrayLike,
        truth: ArrayLike | None,
        counts: Counts,
        random: np.random.Generator,
        bank: StartBank | None,
        n_jobs: int | None = None,
    ) -> "Judge":
        """Check what was given and draw what is missing; regularisation and mounting are those of a fitted adapter."""
        bench = Bench.of(adapter, source, profile, truth, counts, random)
        if source.robot is None:
            return cls(bench, None)
        own = adapter.student_regularization
        return cls(bench, GapSearch(source.robot, source.spec, own, len(bench.profile), bank, n_jobs))

    def row(self, one: Alternative, options: dict[str, Any] | None = None) -> Row:
        """Measure a contestant, which is fitted where that is to be done; `options` as in `Bench.measure`."""
        if one.adapter is None:
            return Row(one.name, one.note)
        row, adapter = self.fitted(one, one.adapter, options)
        return joined(row, self.bench.identified(adapter))

    def fitted(
        self, one: Alternative, adapter: DomainAdapter, options: dict[str, Any] | None = None
    ) -> tuple[Row, DomainAdapter]:
        """Fit a contestant where that is to be done, and measure it but for the identity test; return it as well."""
        adapter = knowing(adapter, self.bench.source.robot, self.bench.source.spec)
        row, images = self.bench.measure(one, adapter, options or {})
        if self.gaps is None:
            return row, adapter
        profile, domain = self.gaps(images)
        return replace(row, feasibility_gap=profile, domain_feasibility_gap=domain), adapter

    def rows(self, every: Sequence[Alternative], options: dict[str, Any], progress: Progress | None) -> Sequence[Row]:
        """Measure contestants one after the other; the `options` are for the first."""
        step, found = Step(progress, "measure"), list[Row]()
        for index, one in enumerate(every):
            step(index / len(every))
            found.append(self.row(one, {} if index else options))
        step.end(f"{len(every) - 1} alternatives")
        return found

    def evaluation(self, rows: Sequence[Row], adapter: DomainAdapter, random_state: Any) -> Evaluation:
        """Put the rows together, that of the adapter first."""
        settings = _settings(adapter, self.bench, self.gaps, random_state)
        return Evaluation(tuple(rows), self.bench.noise(), settings)


def joined(row: Row, identified: Row) -> Row:
    """A row with what `Bench.identified` says."""
    said = dict.fromkeys((*row.warnings, *identified.warnings))
    return replace(row, identity=identified.identity, warnings=tuple(said))


def _require_kinds(adapter: Any, robot: Any, person: Any, profile: Any, truth: Any) -> None:
    for what, arm in (("robot", robot), ("person", person)):
        if arm is not None and not isinstance(arm, Arm):
            raise InvalidInputError(f"{what} must be an Arm, such as maniport.load_arm('panda'); found {arm!r}")
    if not isinstance(adapter, DomainAdapter):
        raise InvalidInputError(f"adapter must be a fitted DomainAdapter; found {adapter!r}")
    if truth is not None and np.shape(truth) != np.shape(profile):
        raise InvalidInputError(
            f"truth must have the shape of profile, {np.shape(profile)}; found shape {np.shape(truth)}"
        )


def _domains(teacher: ArrayLike, student: ArrayLike) -> tuple[Array, Array]:
    return as_finite(teacher, "teacher_domain"), as_finite(student, "student_domain")


def own_words(adapter: DomainAdapter) -> str:
    """What a fit says of itself: why it ended and, where it looked, what the domains determine."""
    found = getattr(adapter, "identifiability_", None)
    return "; ".join([str(adapter.stop_reason_), *([found.in_words()] if found is not None else [])])


def _settings(adapter: DomainAdapter, bench: Bench, gaps: GapSearch | None, random_state: Any) -> dict[str, Any]:
    held_out = "held out of the fit" if bench.source.person is not None else "of the teacher's domain"
    return {
        "profile": f"{len(bench.profile)} ellipsoids",
        "domains": f"{len(bench.source.teacher)} of the teacher, {len(bench.source.student)} of the student",
        "regularisation": str(Regularization(adapter.damping, adapter.floor)),
        GAP_SEARCH: "" if gaps is None else gaps.in_words(),
        "further samples": f"{len(bench.probes)}, {held_out}",
        "identity test": f"{len(bench.identity[0])} and {len(bench.identity[1])} ellipsoids",
        "stability": "not measured" if bench.draws is None else f"{bench.draws[2]} of both domains",
        "seed": random_state if isinstance(random_state, int) else "none",
    }
