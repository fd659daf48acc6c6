"""The method that is taken where none is named: the least that does the job, by `maniport.evaluation.rule`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.evaluation.alternatives import Alternative
from maniport.evaluation.bench import Counts, Source
from maniport.evaluation.report import Evaluation, Judge, joined, own_words
from maniport.evaluation.rows import Row
from maniport.evaluation.rule import does_the_job
from maniport.evaluation.verdict import verdict
from maniport.feasibility import knowing
from maniport.notebook import ShownInNotebooks
from maniport.steps import Progress
from maniport.tracking.search.start_bank import StartBank
from maniport.transfer import METHODS, DomainAdapter, method_of
from maniport.validation import as_choice, as_finite, as_generator

CANDIDATES = ("raw-copy", "recentring", "parallel-transport", "icp", "lengths-field")
"""Methods that are chosen among, in the order of how much they change."""

LARGEST = {"lengths-field": 3}
"""Size of ellipsoids up to which a method is chosen: for 6×6 the field takes half a minute and gains a tenth."""

COSTLY = "lengths-field"
"""Takes longer than all others together: where somebody else can do it, it is measured while they are."""

STEP = "choose the method"

COUNTS = Counts(probes=64, identity=2048, identity_fit=256)
"""Less than an evaluation takes, since five methods are fitted and measured."""


@dataclass(frozen=True)
class Choice(ShownInNotebooks):
    """The method that was chosen, beside the others that were tried.

    Attributes
    ----------
    method : str
        Its name in `maniport.transfer.METHODS`.
    reason : {"does-the-job", "least-gap"}
        The rule that took it, see `maniport.evaluation.rule`.
    adapter : DomainAdapter
        Fitted.
    evaluation : Evaluation
        Every candidate's measures, those of the chosen one first. Of what was not tried or could not be fitted the row
        has a note and no measures.

    See Also
    --------
    choose : makes it.
    """

    method: str
    reason: str
    adapter: DomainAdapter
    evaluation: Evaluation

    def __repr__(self) -> str:
        return f"Choice({self.method!r}: {self.reason}, of {len(self.evaluation.rows)} candidates)"


def choose(
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm,
    person: Arm | None = None,
    spec: EllipsoidSpec = VELOCITY,
    methods: Sequence[str] = CANDIDATES,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **shared: Any,
) -> Choice:
    """Fit and measure methods one after the other, the one that changes least first, and take the first that will do.

    Parameters
    ----------
    teacher_domain, student_domain : array_like, shapes (N, d, d) and (M, d, d)
        Without regularisation, each in its own base frame.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along the motion that shall be transferred, in the order of time, n ≥ 3.
    robot : Arm
        The student: what it can make decides.
    person : Arm, optional
        The teacher; with it, the gap is also measured at samples that no fit has seen, else at some of the domain.
    spec : EllipsoidSpec
    methods : sequence of str
        Names in `maniport.transfer.METHODS`.
    bank, random_state, progress
        As in `evaluate`; methods that draw get the same seed.
    **shared
        Parameters such as damping and mounting that each method gets where it has them.

    Raises
    ------
    ManiportError
        When an input cannot be used, or no method can be fitted.

    See Also
    --------
    Choice : what comes out.
    """
    tell = progress or (lambda step, fraction, found="": None)
    names = [as_choice(name, "method", tuple(METHODS)) for name in methods]
    domains = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    shared["random_state"] = random_state
    adapters = {name: knowing(method_of(name, **shared), robot, spec, bank) for name in names}
    first = adapters[names[0]].fit(*domains)
    random = as_generator(random_state)
    judge = Judge.of(first, Source(person, robot, spec, *domains), profile, None, COUNTS, random, bank)
    meant = COSTLY in names[1:] and spec.size <= LARGEST[COSTLY]
    later = partial(judge.fitted, Alternative(COSTLY, None), adapters[COSTLY]) if meant else None
    rows, enough = list[Row](), ""
    for index, (name, adapter) in enumerate(adapters.items()):
        if enough:
            rows.append(Row(name, f"not tried, since {enough} does the job"))
            continue
        if spec.size > LARGEST.get(name, spec.size):
            rows.append(Row(name, f"left out: it is chosen for ellipsoids of up to {LARGEST[name]}×{LARGEST[name]}"))
            continue
        tell(STEP, index / len(names))
        try:
            if name == COSTLY and later is not None:
                row, adapters[name] = _joined(later, judge, adapter)
            else:
                row = judge.row(Alternative(name, adapter, fitted=adapter is first))
            rows.append(row)
        except InvalidInputError as error:
            if adapter is first:
                raise
            rows.append(Row(name, f"left out: {error}"))
        enough = name if does_the_job(rows[-1]) else ""
    found = verdict(rows)
    taken = next(row for row in rows if row.name == found.recommended)
    adapter = adapters[taken.name]
    rest = (row for row in rows if row is not taken)
    evaluation = judge.evaluation([replace(taken, note=own_words(adapter)), *rest], adapter, random_state)
    tell(STEP, 1.0, taken.name)
    return Choice(taken.name, found.reason, adapter, evaluation)


def _joined(
    later: Callable[[], tuple[Row, DomainAdapter]], judge: Judge, adapter: DomainAdapter
) -> tuple[Row, DomainAdapter]:
    """The row of an adapter that is fitted elsewhere, and the fitted one; its identity test is done here meanwhile."""
    try:
        identified = judge.bench.identified(adapter)
    except InvalidInputError:
        later()  # what is wrong with the domains is told first
        raise
    row, fitted = later()
    return joined(row, identified), fitted
