"""Comparison of a fitted adapter with baselines by all metrics, and selection of a method."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError, collected_warnings
from maniport.evaluation import metrics
from maniport.evaluation.metrics import BASELINES, STILL, TRANSPORTS, Evaluation, Gaps, Row
from maniport.motion import FeasibleProjector, SeedBank, nearest_feasible
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, method_of, name_of
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import (
    Array,
    RandomState,
    as_finite,
    as_points,
    as_positive_semidefinite,
)

GAP_POINTS = 64  # Most ellipsoids of a profile whose feasibility gap is searched, evenly spread


def with_feasible_set(
    adapter: DomainAdapter,
    robot: Arm | None,
    spec: EllipsoidSpec = VELOCITY,
    bank: SeedBank | None = None,
    random_state: RandomState = 0,
) -> DomainAdapter:
    """Return an adapter that uses the feasible set of a robot, where its method does and none is set."""
    if robot is None:
        return adapter
    return adapter.with_projector(
        lambda: FeasibleProjector(robot, spec, bank=bank, random_state=random_state)
    )


def baselines_for(
    adapter: DomainAdapter, rows: Sequence[str | DomainAdapter] = BASELINES
) -> dict[str, DomainAdapter]:
    """Make unfitted baselines with the adapter's regularization and base_rotation, without the adapter's own method."""
    parameters = adapter.get_params()
    baselines = {}
    for row in rows:
        baseline = method_of(
            row, damping=parameters["damping"], base_rotation=parameters["base_rotation"]
        )
        if baseline.get_params()["damping"] != parameters["damping"]:
            raise InvalidInputError(f"rows must have the adapter's damping; found {row!r}")
        if not isinstance(baseline, type(adapter)):
            baselines[name_of(baseline)] = baseline
    return baselines


def evaluate(
    adapter: DomainAdapter,
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm | None = None,
    truth: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    rows: Sequence[str | DomainAdapter] = BASELINES,
    bank: SeedBank | None = None,
    n_starts: int = 48,
    random_state: RandomState = 0,
    progress: Progress | None = None,
) -> Evaluation:
    """Compare a fitted adapter with baselines.

    Parameters
    ----------
    adapter : DomainAdapter
        Fitted to these domains.
    teacher_domain, student_domain : array_like, shapes (N, d, d) and (M, d, d)
        The domains of the fit, without regularization, each in its own base frame.
    profile : array_like, shape (n, d, d)
        The teacher's ellipsoids along a motion, in the order of time, n ≥ 3.
    robot : Arm, optional
        The student, for the distance of at most 64 ellipsoids of the profile to its feasible set.
    truth : array_like, shape (n, d, d), optional
        Ground truth of the mapped profile.
    spec : EllipsoidSpec
    rows : sequence of str or DomainAdapter
        The baselines: names of `maniport.transfer.METHODS`, or adapters with the regularization of `adapter`, of which
        clones are fitted.
    bank, n_starts
        As in `maniport.motion.nearest_feasible`, for the gap search.
    random_state, progress
        Random seed; called with each step and the fraction done.
    """
    if not isinstance(robot, Arm | None):
        raise InvalidInputError(
            f"robot must be an Arm, such as maniport.load_arm('panda'); found {robot!r}"
        )
    size = None if robot is None else spec.size
    data = _checked_data(adapter, teacher_domain, student_domain, profile, truth, size)

    step = Step(progress, "Evaluate baselines")
    methods = {name_of(adapter): adapter, **baselines_for(adapter, rows)}
    measured = list[Row]()
    images = list[Array]()
    for i, (name, baseline) in enumerate(methods.items()):
        step(i / len(methods))
        method = baseline
        if method is not adapter:
            method = with_feasible_set(baseline, robot, spec, bank, random_state)
        with collected_warnings() as texts:
            if method is not adapter:
                method.fit(data.teacher, data.student)
            mapped = method.transform(data.profile)
            row = _measured(name, method, mapped, data)
        images.append(mapped)
        measured.append(replace(row, warnings=tuple(texts)))
    measured[0] = replace(measured[0], note=str(adapter.stop_reason_))

    if robot is not None:
        along = evenly_spaced(len(data.profile), GAP_POINTS)
        searched = np.concatenate([mapped[along] for mapped in images])
        nearest = nearest_feasible(
            robot,
            searched,
            spec=spec,
            bank=bank,
            n_starts=n_starts,
            random_state=random_state,
            damping=adapter.student_regularization,
        )
        distances = nearest.distance.reshape(len(images), -1)
        for i in range(len(measured)):
            measured[i] = replace(measured[i], feasibility_gap=Gaps.of(distances[i]))
    step.end(f"{len(methods) - 1} baselines")

    settings: dict[str, str | int] = {
        "profile": f"{len(data.profile)} ellipsoids",
        "domains": f"{len(data.teacher)} of the teacher, {len(data.student)} of the student",
        "regularization": str(Regularization(adapter.damping)),
        "seed": random_state if isinstance(random_state, int) else "none",
    }
    return Evaluation(tuple(measured), settings)


class _Data(NamedTuple):
    """Ellipsoids by which methods are compared; without regularization unless noted."""

    teacher: Array  # (N, d, d), domain
    student: Array  # (M, d, d), domain
    profile: Array  # (n, d, d), of the teacher
    original: Array  # (n, d, d), the profile with the teacher's regularization
    truth: Array | None  # (n, d, d), with the student's regularization
    teacher_subset: Array  # (k, d, d), of the teacher's domain
    student_subset: Array  # (k, d, d), of the student's domain, with its regularization
    moves: bool  # whether the ellipsoids of the profile differ


def _checked_data(
    adapter: DomainAdapter,
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    truth: ArrayLike | None,
    size: int | None,
) -> _Data:
    """Check the arguments of `evaluate`; ellipsoids of the student have `size` rows, unless it is None."""
    if not isinstance(adapter, DomainAdapter):
        raise InvalidInputError(f"adapter must be a fitted DomainAdapter; found {adapter!r}")
    if truth is not None and np.shape(truth) != np.shape(profile):
        raise InvalidInputError(
            f"truth must have the shape of profile, {np.shape(profile)}; found {np.shape(truth)}"
        )
    teacher = as_finite(teacher_domain, "teacher_domain")
    student = as_finite(student_domain, "student_domain")
    as_points(adapter.student_side(student, "student_domain"), "student_domain", size)
    demonstrated = as_finite(profile, "profile")
    original = as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3)
    target = None if truth is None else adapter.student_side(truth, "truth")
    return _Data(
        teacher,
        student,
        demonstrated,
        original,
        target,
        metrics.subset_of_domain(teacher),
        metrics.subset_of_domain(adapter.student_side(student)),
        bool(np.max(distance_unchecked(original[:1], original)) > STILL),
    )


def _measured(name: str, method: DomainAdapter, profile: Array, data: _Data) -> Row:
    """Return the metrics of a fitted method and of the profile that it mapped, all but the gap."""
    mapped = method.student_side(profile)
    mapped_domain = method.student_side(method.transform(data.teacher_subset))
    note = ""
    if name == "nearest-neighbor":
        note = "returns samples of the student only: its gap is zero"
    row = Row(
        name,
        note,
        rmse=None if data.truth is None else metrics.rmse(data.truth, mapped),
        domain_distance=metrics.domain_distance(mapped_domain, data.student_subset),
        failures=method.failures(),
    )
    if not data.moves:
        return row
    return replace(
        row,
        step_ratio=metrics.step_ratio(mapped, data.original),
        preservation=metrics.distance_preservation(mapped, data.original),
    )


def select_method(
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm,
    spec: EllipsoidSpec = VELOCITY,
    bank: SeedBank | None = None,
    random_state: RandomState = 0,
    progress: Progress | None = None,
    **shared: Any,
) -> tuple[DomainAdapter, Evaluation]:
    """Fit the length field if it passes its checks on held-out samples of the teacher, else a transport.

    `maniport.transfer.length_field.fit.FieldReport.failures` has the checks and their limits. Of the transports, scaled
    transport is taken if it reduces the `domain_distance` of parallel transport by more than 5 %. The choice depends on
    the domains and the robot; the profile is used for the comparison with baselines only. `Evaluation.recommended` has
    the same criterion.

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

    Returns
    -------
    adapter : DomainAdapter
        Fitted.
    evaluation : Evaluation
        Its comparison with baselines, with the reasons if the length field is rejected.
    """
    step = Step(progress, "Fit transfer")
    domains = (
        as_finite(teacher_domain, "teacher_domain"),
        as_finite(student_domain, "student_domain"),
    )
    for domain, name in zip(domains, ("teacher_domain", "student_domain"), strict=True):
        as_positive_semidefinite(domain, name, spec.size)
    shared["random_state"] = random_state
    adapter = with_feasible_set(method_of("length-field", **shared), robot, spec, bank)
    failures: tuple[str, ...] = (
        "it is fitted to ellipsoids of up to 3×3",
    )  # a fit to 6×6 takes half a minute
    if spec.size <= 3:
        try:
            failures = adapter.fit(*domains).failures()
        except InvalidInputError as error:
            failures = (str(error),)
    step(0.7)
    if failures:
        adapter = nearest_transport(*domains, **shared)
    evaluation = evaluate(
        adapter,
        *domains,
        profile,
        robot=robot,
        spec=spec,
        bank=bank,
        random_state=random_state,
        n_starts=16,  # with 48 starts the mean gaps are at most 3 % less
    )
    step.end(name_of(adapter))
    return adapter, replace(evaluation, rejected=failures)


def nearest_transport(teacher: Array, student: Array, **parameters: object) -> DomainAdapter:
    """Fit the transports, and return the first whose domain distance no other undercuts by more than 5 %."""
    domain = metrics.subset_of_domain(teacher)
    adapters = {}
    distances = {}
    for name in TRANSPORTS:
        adapter = method_of(name, **parameters).fit(teacher, student)
        mapped_domain = adapter.student_side(adapter.transform(domain))
        student_subset = metrics.subset_of_domain(adapter.student_side(student))
        adapters[name] = adapter
        distances[name] = metrics.domain_distance(mapped_domain, student_subset)
    return adapters[metrics.first_of_least(distances)]
