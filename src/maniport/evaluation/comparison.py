"""Comparison of a fitted adapter with baselines by all metrics, on the same data."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.arms.joint_space import Manipulable
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation.baselines import ROWS, Baseline, baselines_for
from maniport.evaluation.metrics import distance_preservation, identity_test, moves, rmse, smoothness
from maniport.evaluation.summary import Evaluation, Gaps, Row
from maniport.feasibility import knowing
from maniport.motion import SeedBank, nearest_feasible
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.cloud import energy_between, log_vectors, mean_distance
from maniport.spd.mean import mean
from maniport.spd.regularization import Regularization
from maniport.transfer import DomainAdapter, LengthField, name_of
from maniport.util.progress import Progress, Step
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array, as_count, as_finite, as_generator, as_points, require_shape

GAP_SEARCH = "feasibility gap"
"""Setting that describes the search of the gap; empty for every ellipsoid of the profile without a floor."""

GAP_POINTS = 128  # Most ellipsoids of a profile whose feasibility gap is searched, evenly spread


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
        The student and the teacher. With the student: fresh samples instead of parts of its domain, and the distance
        to the feasible set, of at most 128 ellipsoids of the profile.
    truth : array_like, shape (n, d, d), optional
        Ground truth of the mapped profile.
    pairs : tuple of array_like, shapes (k, d, d) and (k, d, d), optional
        Known pairs of the adapter's fit, if any: for the rotation of Procrustes analysis.
    spec : EllipsoidSpec
    name : str, optional
        Name of the adapter's row. Default: its method's name, or its class.
    rows : sequence of str
        The baselines: names of `maniport.transfer.METHODS`, and "procrustes".
    fitted : mapping of str to DomainAdapter, optional
        Baselines that are fitted to these domains already, with the adapter's regularization and base_rotation.
    bank, n_starts, n_jobs
        As in `maniport.motion.nearest_feasible`, for the gap search.
    n_domain, n_identity : int
        Ellipsoids of the teacher's domain for a second gap search; samples of each set of the identity test. 0 skips
        it.
    random_state, progress
        Seed of all random samples; called with each step and the fraction done.

    Raises
    ------
    ManiportError
        When the adapter is not fitted, or an input cannot be used.
    """
    _require_valid(adapter, robot, person, profile, truth)
    counts = {"n_domain": n_domain, "n_identity": n_identity}
    counts = {argument: as_count(count, argument, minimum=0) for argument, count in counts.items()}
    domains = as_finite(teacher_domain, "teacher_domain"), as_finite(student_domain, "student_domain")
    if robot is not None:
        require_shape(domains[1], "student_domain", ("m", spec.size, spec.size), f" for {robot.name!r}")
    random = as_generator(random_state)
    bench = _Bench(adapter, (person, robot), spec, domains, profile, truth, random, **counts)
    own = Baseline(name or name_of(adapter), adapter, _remark(adapter), fitted=True)
    methods = [own, *baselines_for(adapter, own.name, rows, pairs, fitted)]
    search = {"bank": bank, "n_starts": n_starts, "n_jobs": n_jobs}
    step = Step(progress, "Evaluate baselines")
    measured = bench.compare(methods, adapter.student_regularization, search, step)
    noise = Row("student's own fresh samples", energy_distance=bench.energy_distance(bench.fresh))
    seed = random_state if isinstance(random_state, int) else "none"
    return Evaluation(measured, noise, {**_settings(adapter, bench), "seed": seed})


class _Bench:
    """Test data of all methods: independent samples of the arms, or parts of the domains."""

    def __init__(
        self,
        adapter: DomainAdapter,
        arms: tuple[Arm | None, Arm | None],
        spec: EllipsoidSpec,
        domains: tuple[Array, Array],
        profile: ArrayLike,
        truth: ArrayLike | None,
        random: np.random.Generator,
        n_domain: int,
        n_identity: int,
    ) -> None:
        """Check the input and sample what is missing."""
        self.person, self.robot = arms
        self.spec, self.domains, self.random = spec, domains, random
        student = as_points(adapter.student_side(domains[1], "student_domain"), "student_domain")
        self.identity: list[Array] = []
        if n_identity and self.robot is None:
            self.identity = self._split(domains[1], 2, "student_domain")
        elif n_identity:
            size = min(n_identity, len(student))
            self.identity = [self._sampled(self.robot, domains[1], size) for _ in range(2)]
        size = min(1024, len(student) if self.robot is not None else max(1, len(student) // 8))
        self.fresh = adapter.student_side(self._sampled(self.robot, domains[1], size), "fresh")
        self.teacher_part, part = (self._part(points, most) for points, most in ((domains[0], 2048), (student, 4096)))
        self.center = mean(part)
        self.cloud = log_vectors(part, self.center)
        self.within = mean_distance(self.cloud)
        self.profile = as_finite(profile, "profile")
        self.probes = self._sampled(self.person, domains[0], n_domain)
        self.original = as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3)
        self.truth = None if truth is None else adapter.student_side(truth, "truth")

    def _sampled(self, arm: Arm | None, domain: Array, n: int) -> Array:
        """Sample an arm, or its domain without an arm."""
        return self._part(domain, n) if arm is None or not n else sample_domain(arm, n, self.random, spec=self.spec)

    def _part(self, points: Array, most: int) -> Array:
        return points[np.sort(self.random.permutation(len(points))[:most])]

    def _split(self, points: Array, count: int, name: str, fewest: int = 8) -> list[Array]:
        if len(points) < fewest:
            raise InvalidInputError(
                f"{name} must hold at least {fewest} ellipsoids to be split into {count} parts; found {len(points)}"
            )
        return [points[np.sort(part)] for part in np.array_split(self.random.permutation(len(points)), count)]

    def compare(
        self,
        methods: Sequence[Baseline],
        regularization: Regularization,
        search: dict[str, Any],
        step: Step,
    ) -> tuple[Row, ...]:
        """Measure every method; `search` has the options of the gap search."""
        rows, images = list[Row](), dict[str, Array]()
        for index, method in enumerate(methods):
            step(index / len(methods))
            if method.adapter is None:
                rows.append(Row(method.name, method.note))
                continue
            adapter = knowing(method.adapter, self.robot, self.spec)
            row, images[method.name] = self.measure(method, adapter)
            rows.append(row)
        if self.robot is not None:
            gaps = self.gaps(images, regularization, **search)
            rows = [replace(row, **gaps.get(row.name, {})) for row in rows]
        step.end(f"{len(methods) - 1} baselines")
        return tuple(rows)

    def measure(self, method: Baseline, adapter: DomainAdapter) -> tuple[Row, Array]:
        """Fit where needed, and measure all but the gaps; also return the images of the profile and the probes."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            if not method.fitted:
                adapter.fit(*self.domains)
            images = [adapter.transform(points) for points in (self.profile, self.probes) if len(points)]
            mapped, moving = adapter.student_side(images[0]), moves(self.original)
            row = Row(
                method.name,
                method.note,
                name_of(adapter),
                rmse=None if self.truth is None else rmse(self.truth, mapped),
                smoothness=smoothness(mapped, self.original) if moving else None,
                preservation=distance_preservation(mapped, self.original) if moving else None,
                energy_distance=self.energy_distance(adapter.student_side(adapter.transform(self.teacher_part))),
                identity=None if not self.identity else identity_test(adapter, *self.identity),
            )
        texts = tuple(dict.fromkeys(str(warning.message) for warning in caught))
        failures = adapter.report_.failures() if isinstance(adapter, LengthField) else ()
        return replace(row, failures=failures, warnings=texts), np.concatenate(images)

    def gaps(self, images: dict[str, Array], own: Regularization, **search: Any) -> dict[str, dict[str, Any]]:
        """Search the feasibility gaps of all methods' images at once, each ellipsoid only once.

        A floor has no derivative: the search adds it to all eigenvalues instead, and the distance is measured with
        lifted eigenvalues. Both are upper bounds of the least distance.
        """
        robot, spec, along = self.robot, self.spec, evenly_spaced(len(self.profile), GAP_POINTS)
        assert robot is not None
        targets = np.concatenate([[*mapped[along], *mapped[len(self.profile) :]] for mapped in images.values()])
        unique, inverse = np.unique(targets.reshape(len(targets), -1), axis=0, return_inverse=True)
        damping = own if own.eigenvalue_floor is None else Regularization.absolute(own.eigenvalue_floor)
        ellipsoids = unique.reshape(-1, *targets.shape[1:])
        found = nearest_feasible(robot, ellipsoids, spec=spec, damping=damping, **search)
        distances = found.distance
        if own.eigenvalue_floor is not None:
            distances = distance_unchecked(own.apply(ellipsoids), own.apply(found.ellipsoids))
        results: dict[str, dict[str, Any]] = {}
        for name, gaps in zip(images, distances[inverse].reshape(len(images), -1), strict=True):
            profile, domain = np.split(gaps, [len(along)])
            results[name] = {"feasibility_gap": Gaps.of(profile, along)}
            results[name] |= {"domain_feasibility_gap": Gaps.of(domain)} if len(domain) else {}
        return results

    def energy_distance(self, points: Array) -> float:
        return energy_between(log_vectors(points, self.center), self.cloud, self.within)


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


def _settings(adapter: DomainAdapter, bench: _Bench) -> dict[str, Any]:
    """Sizes, regularization and sources of samples, in words."""
    search = []
    if bench.robot is not None and len(bench.profile) > GAP_POINTS:
        search.append(f"searched at {GAP_POINTS} of the profile's {len(bench.profile)} ellipsoids, evenly spread")
    if bench.robot is not None and adapter.eigenvalue_floor is not None:
        search.append("the search adds the floor to all eigenvalues; distances are measured with lifted eigenvalues")
    held_out = "held out of the fit" if bench.person is not None else "of the teacher's domain"
    tested = " and ".join(str(len(samples)) for samples in bench.identity)
    return {
        "profile": f"{len(bench.profile)} ellipsoids",
        "domains": f"{len(bench.domains[0])} of the teacher, {len(bench.domains[1])} of the student",
        "regularization": str(Regularization(adapter.damping, adapter.eigenvalue_floor)),
        GAP_SEARCH: "; ".join(search),
        "further samples": f"{len(bench.probes)}, {held_out}",
        "identity test": f"{tested} ellipsoids" if tested else "not measured",
    }
