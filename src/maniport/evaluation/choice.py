"""Model selection where no method is named: the length field if it passes its checks, else parallel transport."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.evaluation.alternatives import Alternative, others_than
from maniport.evaluation.bench import Counts, Source
from maniport.evaluation.report import Evaluation, Judge, own_words
from maniport.evaluation.rows import RAW_COPY, RECENTRING, TRANSPORT, Row
from maniport.feasibility import knowing
from maniport.notebook import ShownInNotebooks
from maniport.steps import Progress
from maniport.tracking.search.start_bank import StartBank
from maniport.transfer import DomainAdapter, method_of
from maniport.validation import as_finite, as_generator, as_positive_semidefinite

FIELD = "lengths-field"
LARGEST = 3
"""Largest size of ellipsoids for which the length field is fitted: for 6×6 it takes half a minute and gains a tenth."""
STEP = "choose the method"
COUNTS = Counts(probes=64, identity=2048, identity_fit=256)
"""Fewer samples than in an evaluation, to save time."""


@dataclass(frozen=True)
class Choice(ShownInNotebooks):
    """The method that was chosen, and its comparison with baselines.

    Attributes
    ----------
    method : {"lengths-field", "parallel-transport"}
    failures : tuple of str
        Why the length field was rejected: the checks that it fails, or why it was not fitted. Empty where it is chosen.
    adapter : DomainAdapter
        Fitted.
    evaluation : Evaluation
        Measures of the chosen method and of the baselines; a rejected length field has a row with a note only.

    See Also
    --------
    choose : returns it.
    """

    method: str
    failures: tuple[str, ...]
    adapter: DomainAdapter
    evaluation: Evaluation

    def __repr__(self) -> str:
        return f"Choice({self.method!r}{', instead of ' + FIELD if self.failures else ''})"


def choose(
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm,
    person: Arm | None = None,
    spec: EllipsoidSpec = VELOCITY,
    bank: StartBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **shared: Any,
) -> Choice:
    """Choose the length field if it passes its checks on held-out samples of the teacher, else parallel transport.

    The checks and their limits are those of `maniport.transfer.lengths.report.FieldReport.failures`. The choice depends
    on the domains and the robot, not on the profile, to which only the evaluation applies.

    Parameters
    ----------
    teacher_domain, student_domain : array_like, shapes (N, d, d) and (M, d, d)
        Without regularization, each in its own base frame.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along the motion to transfer, in the order of time, n ≥ 3.
    robot : Arm
        The student.
    person : Arm, optional
        The teacher; with it, the gap is also measured at samples that no fit has seen, else at some of the domain.
    spec : EllipsoidSpec
    bank, random_state, progress
        As in `evaluate`.
    **shared
        Parameters such as damping and mounting that each method gets where it has them.

    Raises
    ------
    ManiportError
        When an input is invalid, or parallel transport cannot be fitted.

    See Also
    --------
    Choice : the result.
    """
    report = progress or (lambda step, fraction, found="": None)
    report(STEP, 0.0)
    domains = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    for domain, name in zip(domains, ("teacher_domain", "student_domain"), strict=True):
        as_positive_semidefinite(domain, name, spec.size)
    shared["random_state"] = random_state
    transport = method_of(TRANSPORT, **shared).fit(*domains)
    field = knowing(method_of(FIELD, **shared), robot, spec, bank)
    failures = _failures(field, domains, spec)
    adapter, method = (transport, TRANSPORT) if failures else (field, FIELD)
    report(STEP, 0.5)
    source, random = Source(person, robot, spec, *domains), as_generator(random_state)
    judge = Judge.of(adapter, source, profile, None, COUNTS, random, bank)
    baselines = others_than(adapter, method, (RAW_COPY, RECENTRING, TRANSPORT))
    rows = [judge.row(one) for one in (Alternative(method, adapter, own_words(adapter), fitted=True), *baselines)]
    if failures:
        rows.append(Row(FIELD, f"rejected: {'; '.join(failures)}"))
    report(STEP, 1.0, method)
    return Choice(method, failures, adapter, judge.evaluation(rows, adapter, random_state))


def _failures(field: DomainAdapter, domains: tuple[Any, Any], spec: EllipsoidSpec) -> tuple[str, ...]:
    """Fit the field; return why it is rejected, nothing where it passes."""
    if spec.size > LARGEST:
        return (f"it is fitted to ellipsoids of up to {LARGEST}×{LARGEST}",)
    try:
        return tuple(field.fit(*domains).report_.failures())  # type: ignore[attr-defined]
    except InvalidInputError as error:
        return (str(error),)
