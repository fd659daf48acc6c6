"""Model selection where no method is named: the length field if it passes its checks, else parallel transport."""

from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.evaluation.baselines import TRANSPORT
from maniport.evaluation.comparison import evaluate
from maniport.evaluation.summary import Evaluation, Row
from maniport.feasibility import with_feasible_set
from maniport.motion import SeedBank
from maniport.transfer import DomainAdapter, method_of
from maniport.util.notebook import NotebookDisplay
from maniport.util.progress import Progress, no_progress
from maniport.util.validation import as_finite, as_positive_semidefinite

FIELD = "length-field"


@dataclass(frozen=True)
class Choice(NotebookDisplay):
    """The chosen method, and its comparison with baselines.

    Attributes
    ----------
    method : {"length-field", "parallel-transport"}
    failures : tuple of str
        Why the length field was rejected: the checks that it fails, or why it was not fitted. Empty where it is chosen.
    adapter : DomainAdapter
        Fitted.
    evaluation : Evaluation
        Metrics of the chosen method and of the baselines; a rejected length field has a row with a note only.
    """

    method: str
    failures: tuple[str, ...]
    adapter: DomainAdapter
    evaluation: Evaluation

    def __repr__(self) -> str:
        return f"Choice({self.method!r}{', instead of ' + FIELD if self.failures else ''})"


def select_method(
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm,
    spec: EllipsoidSpec = VELOCITY,
    bank: SeedBank | None = None,
    random_state: Any = 0,
    progress: Progress | None = None,
    **shared: Any,
) -> Choice:
    """Choose the length field if it passes its checks on held-out samples of the teacher, else parallel transport.

    `maniport.transfer.length_field.fit.FieldReport.failures` has the checks and their limits. The choice depends
    on the domains and the robot; the profile is used for the comparison with baselines only.

    Parameters
    ----------
    teacher_domain, student_domain : array_like, shapes (N, d, d) and (M, d, d)
        Without regularization, each in its own base frame.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along the motion to transfer, in the order of time, n ≥ 3.
    robot : Arm
        The student.
    spec, bank, random_state, progress
        As in `evaluate`.
    **shared
        Parameters such as damping and base_rotation, for each method that has them.

    Raises
    ------
    ManiportError
        When an input is invalid, or neither method can be fitted.
    """
    step, report = "Fit transfer", progress or no_progress
    report(step, 0.0)
    domains = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    for domain, name in zip(domains, ("teacher_domain", "student_domain"), strict=True):
        as_positive_semidefinite(domain, name, spec.size)
    shared["random_state"] = random_state
    adapter: Any = with_feasible_set(method_of(FIELD, **shared), robot, spec, bank)
    if spec.size > 3:  # a fit to 6×6 takes half a minute
        failures: tuple[str, ...] = ("it is fitted to ellipsoids of up to 3×3",)
    else:
        try:
            failures = tuple(adapter.fit(*domains).report_.failures())
        except InvalidInputError as error:
            failures = (str(error),)
    report(step, 0.7)
    method = TRANSPORT if failures else FIELD
    if failures:
        adapter = method_of(TRANSPORT, **shared).fit(*domains)
    evaluation = evaluate(
        adapter,
        *domains,
        profile,
        robot=robot,
        spec=spec,
        name=method,
        bank=bank,
        n_starts=16,  # with 48 the mean gaps are at most 3 % less
        n_domain=0,
        n_identity=0,
        random_state=random_state,
    )
    if failures:
        rejected = Row(FIELD, f"rejected: {'; '.join(failures)}")
        evaluation = replace(evaluation, rows=(*evaluation.rows, rejected))
    report(step, 1.0, method)
    return Choice(method, failures, adapter, evaluation)
