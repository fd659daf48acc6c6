"""Comparison of a fitted adapter with baselines by all metrics, on the same data."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.joint_space import Manipulable
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation.baselines import BASELINES, LOOKUP, baselines_for
from maniport.evaluation.metrics import STILL, distance_preservation, identity_test, rmse, smoothness
from maniport.evaluation.summary import Evaluation, Gaps, Row
from maniport.feasibility import with_feasible_set
from maniport.motion import SeedBank, nearest_feasible
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, LengthField, name_of
from maniport.util.progress import Progress, Step
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_count, as_finite, as_generator, as_points, require_shape

GAP_SEARCH = "feasibility gap"
"""Setting that describes the search of the gap; empty for every ellipsoid of the profile without a floor."""

GAP_POINTS = 64  # Most ellipsoids of a profile whose feasibility gap is searched, evenly spread


def evaluate(
    adapter: DomainAdapter,
    teacher_domain: ArrayLike,
    student_domain: ArrayLike,
    profile: ArrayLike,
    *,
    robot: Arm | None = None,
    person: Arm | None = None,
    truth: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    name: str | None = None,
    rows: Sequence[str | DomainAdapter] = BASELINES,
    bank: SeedBank | None = None,
    n_starts: int = 48,
    n_domain: int = 128,
    n_identity: int = 4096,
    random_state: Any = 0,
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
    robot, person : Arm, optional
        The student and the teacher. With the student: the distance to the feasible set, of at most 64 ellipsoids of
        the profile, and fresh samples instead of parts of its domain.
    truth : array_like, shape (n, d, d), optional
        Ground truth of the mapped profile.
    spec : EllipsoidSpec
    name : str, optional
        Name of the adapter's row. Default: its method's name, or its class.
    rows : sequence of str or DomainAdapter
        The baselines: names of `maniport.transfer.METHODS`, or adapters with the regularization and base_rotation of
        `adapter`, of which clones are fitted.
    bank, n_starts
        As in `maniport.motion.nearest_feasible`, for the gap search.
    n_domain, n_identity : int
        Ellipsoids of the teacher's domain for a second gap search; samples of each set of the identity test. 0 skips
        it.
    random_state, progress
        Random seed; called with each step and the fraction done.

    Raises
    ------
    ManiportError
        When the adapter is not fitted, or an input cannot be used.
    """
    for what, arm in (("robot", robot), ("person", person)):
        if arm is not None and not isinstance(arm, Manipulable):
            raise InvalidInputError(f"{what} must be an Arm, such as maniport.load_arm('panda'); found {arm!r}")
    if not isinstance(adapter, DomainAdapter):
        raise InvalidInputError(f"adapter must be a fitted DomainAdapter; found {adapter!r}")
    if truth is not None and np.shape(truth) != np.shape(profile):
        raise InvalidInputError(f"truth must have the shape of profile, {np.shape(profile)}; found {np.shape(truth)}")
    as_count(n_domain, "n_domain", minimum=0), as_count(n_identity, "n_identity", minimum=0)
    teacher, student = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    if robot is not None:
        require_shape(student, "student_domain", ("m", spec.size, spec.size), f" for {robot.name!r}")
    as_points(adapter.student_side(student, "student_domain"), "student_domain")
    random, demonstrated = as_generator(random_state), as_finite(profile, "profile")
    original = as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3)
    wanted = None if truth is None else adapter.student_side(truth, "truth")
    probes = _sampled(person, teacher, n_domain, spec, random)
    same = _identity_sets(robot, student, n_identity, spec, random)

    own, step = name or name_of(adapter), Step(progress, "Evaluate baselines")
    methods = {own: adapter, **baselines_for(adapter, own, rows)}
    measured, images = list[Row](), list[Array]()
    moves = np.max(distance_unchecked(original[:1], original)) > STILL
    for i, (row, baseline) in enumerate(methods.items()):
        step(i / len(methods))
        method = adapter if row == own else with_feasible_set(baseline, robot, spec, bank)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            if method is not adapter:
                method.fit(teacher, student)
            images.append(method.transform(np.concatenate([demonstrated, probes])))
            mapped = method.student_side(images[-1][: len(demonstrated)])
            result = Row(
                row,
                "returns samples of the student only: its gap is zero" if row == LOOKUP else "",
                name_of(method),
                rmse=None if wanted is None else rmse(wanted, mapped),
                smoothness=smoothness(mapped, original) if moves else None,
                preservation=distance_preservation(mapped, original) if moves else None,
                identity=identity_test(method, *same) if same else None,
                failures=tuple(method.report_.failures()) if isinstance(method, LengthField) else (),
            )
        measured.append(replace(result, warnings=tuple(dict.fromkeys(str(warning.message) for warning in caught))))
    measured[0] = replace(measured[0], note=str(adapter.stop_reason_))
    if robot is not None:
        search = {"spec": spec, "bank": bank, "n_starts": n_starts}
        measured = _with_gaps(measured, images, robot, len(demonstrated), adapter.student_regularization, **search)
    step.end(f"{len(methods) - 1} baselines")
    held_out = "of the teacher's domain" if person is None else "held out of the fit"
    sizes = " and ".join(str(len(samples)) for samples in same)
    settings = {
        "profile": f"{len(demonstrated)} ellipsoids",
        "domains": f"{len(teacher)} of the teacher, {len(student)} of the student",
        "regularization": str(Regularization(adapter.damping)),
        GAP_SEARCH: "" if robot is None else _gap_search(len(demonstrated)),
        "further samples": f"{len(probes)}, {held_out}",
        "identity test": f"{sizes} ellipsoids" if sizes else "not measured",
        "seed": random_state if isinstance(random_state, int) else "none",
    }
    return Evaluation(tuple(measured), settings)


def _with_gaps(
    rows: Sequence[Row], images: Sequence[Array], robot: Arm, count: int, own: Regularization, **search: Any
) -> list[Row]:
    """Search the feasibility gaps of the images of all methods: of `count` ellipsoids of a profile, and probes."""
    along = evenly_spaced(count, GAP_POINTS)
    targets = np.concatenate([mapped[np.r_[along, count : len(mapped)]] for mapped in images])
    ellipsoids, inverse = np.unique(targets, axis=0, return_inverse=True)
    distances = nearest_feasible(robot, ellipsoids, damping=own, **search).distance
    results = []
    for row, gaps in zip(rows, distances[inverse.ravel()].reshape(len(rows), -1), strict=True):
        profile, domain = np.split(gaps, [len(along)])
        held_out = Gaps.of(domain) if len(domain) else None
        results.append(replace(row, feasibility_gap=Gaps.of(profile), domain_feasibility_gap=held_out))
    return results


def _gap_search(count: int) -> str:
    """Describe the search of the gaps of `count` ellipsoids."""
    return f"searched at {GAP_POINTS} of the profile's {count} ellipsoids, evenly spread" if count > GAP_POINTS else ""


def _sampled(arm: Arm | None, domain: Array, n: int, spec: EllipsoidSpec, random: np.random.Generator) -> Array:
    """Sample an arm, or its domain without an arm."""
    if arm is None or not n:
        return domain[np.sort(random.permutation(len(domain))[:n])]
    return sample_domain(arm, n, random, spec=spec)


def _identity_sets(
    robot: Arm | None, domain: Array, n: int, spec: EllipsoidSpec, random: np.random.Generator, fewest: int = 8
) -> list[Array]:
    """Draw two disjoint sets of samples of the student."""
    if not n:
        return []
    if robot is not None:
        return [_sampled(robot, domain, min(n, len(domain)), spec, random) for _ in range(2)]
    if len(domain) < fewest:
        raise InvalidInputError(
            f"student_domain must hold at least {fewest} ellipsoids to be split into 2 parts; found {len(domain)}"
        )
    return [domain[np.sort(part)] for part in np.array_split(random.permutation(len(domain)), 2)]
