"""Comparison of a fitted adapter with baselines by all metrics, on the same data."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.joint_space import Manipulable
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation.baselines import BASELINES, LOOKUP, baselines_for
from maniport.evaluation.metrics import distance_preservation, identity_test, moves, rmse, smoothness
from maniport.evaluation.summary import Evaluation, Gaps, Row
from maniport.feasibility import knowing
from maniport.motion import SeedBank, nearest_feasible
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, LengthField, name_of
from maniport.util.progress import Progress, Step
from maniport.util.subsample import evenly_spaced
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
    rows: Sequence[str] = BASELINES,
    fitted: Mapping[str, DomainAdapter] | None = None,
    bank: SeedBank | None = None,
    n_starts: int = 48,
    n_domain: int = 128,
    n_identity: int = 4096,
    random_state: Any = 0,
    n_jobs: int | None = None,
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
    rows : sequence of str
        The baselines: names of `maniport.transfer.METHODS`.
    fitted : mapping of str to DomainAdapter, optional
        Further baselines, fitted to these domains with the adapter's regularization and base_rotation.
    bank, n_starts, n_jobs
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
    _require_valid(adapter, robot, person, profile, truth)
    counts = [as_count(n_domain, "n_domain", minimum=0), as_count(n_identity, "n_identity", minimum=0)]
    teacher, student = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    if robot is not None:
        require_shape(student, "student_domain", ("m", spec.size, spec.size), f" for {robot.name!r}")
    as_points(adapter.student_side(student, "student_domain"), "student_domain")
    random = as_generator(random_state)
    data = _TestData(
        domains=(teacher, student),
        profile=as_finite(profile, "profile"),
        original=as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3),
        truth=None if truth is None else adapter.student_side(truth, "truth"),
        probes=_sampled(person, teacher, counts[0], spec, random),
        identity=_identity_sets(robot, student, counts[1], spec, random),
    )
    own, step = name or name_of(adapter), Step(progress, "Evaluate baselines")
    methods = {own: adapter, **baselines_for(adapter, own, rows, fitted)}
    measured, images = list[Row](), dict[str, Array]()
    for i, (row, method) in enumerate(methods.items()):
        step(i / len(methods))
        ready = row == own or row in (fitted or {})
        result, images[row] = _measured(row, method if ready else knowing(method, robot, spec, bank), data, ready)
        measured.append(result)
    measured[0] = replace(measured[0], note=_remark(adapter))
    if robot is not None:
        search = {"spec": spec, "bank": bank, "n_starts": n_starts, "n_jobs": n_jobs}
        gaps = _gaps(robot, images, len(data.profile), adapter.student_regularization, **search)
        measured = [replace(row, **gaps[row.name]) for row in measured]
    step.end(f"{len(methods) - 1} baselines")
    seed = random_state if isinstance(random_state, int) else "none"
    return Evaluation(tuple(measured), {**_settings(adapter, data, robot, person), "seed": seed})


@dataclass(frozen=True)
class _TestData:
    """Data on which all methods are measured."""

    domains: tuple[Array, Array]  # of teacher and student
    profile: Array  # (n, d, d), of the teacher
    original: Array  # the same, regularized and in the student's base frame
    truth: Array | None  # (n, d, d)
    probes: Array  # (m, d, d), further ellipsoids of the teacher
    identity: list[Array]  # two sets of the student; empty: no identity test


def _measured(name: str, adapter: DomainAdapter, data: _TestData, fitted: bool) -> tuple[Row, Array]:
    """Fit a method where needed, and measure all but the gaps; also return its images of the profile and the probes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ManiportWarning)
        if not fitted:
            adapter.fit(*data.domains)
        images = adapter.transform(np.concatenate([data.profile, data.probes]))
        mapped, moving = adapter.student_side(images[: len(data.profile)]), moves(data.original)
        row = Row(
            name,
            "returns samples of the student only: its gap is zero" if name == LOOKUP else "",
            name_of(adapter),
            rmse=None if data.truth is None else rmse(data.truth, mapped),
            smoothness=smoothness(mapped, data.original) if moving else None,
            preservation=distance_preservation(mapped, data.original) if moving else None,
            identity=identity_test(adapter, *data.identity) if data.identity else None,
            failures=tuple(adapter.report_.failures()) if isinstance(adapter, LengthField) else (),
        )
    return replace(row, warnings=tuple(dict.fromkeys(str(warning.message) for warning in caught))), images


def _gaps(
    robot: Arm, images: dict[str, Array], count: int, own: Regularization, **search: Any
) -> dict[str, dict[str, Any]]:
    """Search the feasibility gaps of the images of all methods at once: of `count` ellipsoids of a profile, and probes.

    A floor has no derivative: the search adds it to all eigenvalues instead, and the distance is measured with
    lifted eigenvalues. Both are upper bounds of the least distance.
    """
    along = evenly_spaced(count, GAP_POINTS)
    targets = np.concatenate([mapped[np.r_[along, count : len(mapped)]] for mapped in images.values()])
    ellipsoids, inverse = np.unique(targets, axis=0, return_inverse=True)
    damping = own if own.eigenvalue_floor is None else Regularization.absolute(own.eigenvalue_floor)
    nearest = nearest_feasible(robot, ellipsoids, damping=damping, **search)
    distances = nearest.distance
    if own.eigenvalue_floor is not None:
        distances = distance_unchecked(own.apply(ellipsoids), own.apply(nearest.ellipsoids))
    results = dict[str, dict[str, Any]]()
    for name, gaps in zip(images, distances[inverse.ravel()].reshape(len(images), -1), strict=True):
        profile, domain = np.split(gaps, [len(along)])
        results[name] = {"feasibility_gap": Gaps.of(profile, along)}
        if len(domain):
            results[name]["domain_feasibility_gap"] = Gaps.of(domain)
    return results


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


def _require_valid(adapter: Any, robot: Any, person: Any, profile: Any, truth: Any) -> None:
    for what, arm in (("robot", robot), ("person", person)):
        if arm is not None and not isinstance(arm, Manipulable):
            raise InvalidInputError(f"{what} must be an Arm, such as maniport.load_arm('panda'); found {arm!r}")
    if not isinstance(adapter, DomainAdapter):
        raise InvalidInputError(f"adapter must be a fitted DomainAdapter; found {adapter!r}")
    if truth is not None and np.shape(truth) != np.shape(profile):
        raise InvalidInputError(
            f"truth must have the shape of profile, {np.shape(profile)}; found shape {np.shape(truth)}"
        )


def _remark(adapter: DomainAdapter) -> str:
    """Return why a fit stopped and, if examined, whether the domains determine the rotation."""
    identifiability = getattr(adapter, "identifiability_", None)
    return "; ".join([str(adapter.stop_reason_), *([identifiability.in_words()] if identifiability else [])])


def _settings(adapter: DomainAdapter, data: _TestData, robot: Arm | None, person: Arm | None) -> dict[str, Any]:
    """Sizes, regularization and sources of samples, in words."""
    search = []
    if robot is not None and len(data.profile) > GAP_POINTS:
        search.append(f"searched at {GAP_POINTS} of the profile's {len(data.profile)} ellipsoids, evenly spread")
    if robot is not None and adapter.eigenvalue_floor is not None:
        search.append("the search adds the floor to all eigenvalues; distances are measured with lifted eigenvalues")
    held_out = "held out of the fit" if person is not None else "of the teacher's domain"
    tested = " and ".join(str(len(samples)) for samples in data.identity)
    return {
        "profile": f"{len(data.profile)} ellipsoids",
        "domains": f"{len(data.domains[0])} of the teacher, {len(data.domains[1])} of the student",
        "regularization": str(Regularization(adapter.damping, adapter.eigenvalue_floor)),
        GAP_SEARCH: "; ".join(search),
        "further samples": f"{len(data.probes)}, {held_out}",
        "identity test": f"{tested} ellipsoids" if tested else "not measured",
    }
