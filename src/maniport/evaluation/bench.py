"""What every contestant is measured on, where independent draws of the domains come from, and the measuring."""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.bodies import Arm, EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError, ManiportWarning
from maniport.evaluation.alternatives import Alternative
from maniport.evaluation.measures import moves, rmse, smoothness, structure
from maniport.evaluation.reliability import identity_test, stability
from maniport.evaluation.rows import Row
from maniport.spd.cloud import energy_between, log_vectors, mean_distance
from maniport.spd.mean import mean
from maniport.transfer import DomainAdapter, LengthsField, name_of
from maniport.validation import Array, as_finite, as_points

OWN_SAMPLES = "student's own fresh samples"

FRESH_SAMPLES = 1024
ENERGY_SAMPLES = 2048, 4096
"""Ellipsoids of the teacher's and the student's domain that energy distances are taken between; all pairs count."""

PARTS = 4
"""Disjoint parts that given domains are split into."""

FEWEST = 8
"""Ellipsoids that each domain must have to be split."""


@dataclass(frozen=True)
class Counts:
    """How much is drawn.

    Attributes
    ----------
    probes : int
        Held-out samples of the teacher.
    draws : int
        Of both domains, for the stability.
    identity : int
        Size of the two draws of the identity test, where the robot is known and its domain is not smaller.
    identity_fit : int or None
        Of these a method with a parameter `n_samples` takes at most so many, where it would take more.
    """

    probes: int
    draws: int = 0
    identity: int = 4096
    identity_fit: int | None = None


@dataclass(frozen=True)
class Source:
    """Where independent draws of the domains come from: the arms where they are known, else parts of what was given.

    Attributes
    ----------
    person, robot : Arm or None
    spec : EllipsoidSpec
    teacher, student : ndarray, shapes (N, d, d) and (M, d, d)
        The domains, as they were given.
    """

    person: Arm | None
    robot: Arm | None
    spec: EllipsoidSpec
    teacher: Array
    student: Array

    def identity(self, random: np.random.Generator, most: int) -> tuple[Array, Array]:
        """Two disjoint draws of the student's domain, each of at most so many where the robot is known."""
        if self.robot is None:
            first, second = _parts(self.student, 2, random, "student_domain")
            return first, second
        n, d = min(most, len(self.student)), self.spec.size
        if self.student.shape[1:] != (d, d):
            raise InvalidInputError(
                f"student_domain must hold the ellipsoids of {self.robot.name!r} with these options, shape "
                f"(m, {d}, {d}); found shape {self.student.shape}"
            )
        first, second = (sample_domain(self.robot, n, random, spec=self.spec) for _ in range(2))
        return first, second

    def held_out(self, n: int, random: np.random.Generator) -> Array:
        """Samples of the teacher that no fit has seen; without its arm some of its domain."""
        if self.person is not None and n:
            return sample_domain(self.person, n, random, spec=self.spec)
        return self.teacher[np.sort(random.permutation(len(self.teacher))[:n])]

    def fresh(self, random: np.random.Generator) -> Array:
        """Fresh samples of the student; without its arm a part of its domain."""
        if self.robot is not None:
            return sample_domain(self.robot, min(FRESH_SAMPLES, len(self.student)), random, spec=self.spec)
        return self.student[random.permutation(len(self.student))[: max(1, min(FRESH_SAMPLES, len(self.student) // 8))]]

    def both(self, count: int, random: np.random.Generator) -> tuple[tuple[Array, ...], tuple[Array, ...], str]:
        """Draw both domains `count` times in their sizes, or split them where an arm is not known; and say which."""
        if count < 2:
            raise InvalidInputError(f"draws must be 0 or at least 2; found {count}")
        if self.person is None or self.robot is None:
            teacher = tuple(_parts(self.teacher, PARTS, random, "teacher_domain"))
            return teacher, tuple(_parts(self.student, PARTS, random, "student_domain")), f"{PARTS} disjoint parts"
        teacher, student = (
            tuple(sample_domain(arm, len(cloud), random, spec=self.spec) for _ in range(count))
            for arm, cloud in ((self.person, self.teacher), (self.robot, self.student))
        )
        return teacher, student, f"{count} fresh draws"


def _parts(cloud: Array, count: int, random: np.random.Generator, name: str) -> list[Array]:
    if len(cloud) < max(FEWEST, 2 * count):
        raise InvalidInputError(
            f"{name} must hold at least {FEWEST} ellipsoids to be split into {count} parts; found {len(cloud)}"
        )
    return [cloud[np.sort(part)] for part in np.array_split(random.permutation(len(cloud)), count)]


@dataclass(frozen=True)
class StudentCloud:
    """The student's regularised domain and what every comparison with it needs: its mean, log-vectors and spread."""

    center: Array
    vectors: Array
    within: float

    @classmethod
    def of(cls, points: Array) -> "StudentCloud":
        """Prepare regularised points, shape (m, d, d)."""
        center = mean(points)
        vectors = log_vectors(points, center)
        return cls(center, vectors, mean_distance(vectors))

    def energy_distance(self, points: Array) -> float:
        """Energy distance of other points (n, d, d) to this cloud, about its mean."""
        return energy_between(log_vectors(points, self.center), self.vectors, self.within)


@dataclass(frozen=True)
class Bench:
    """What every contestant is measured on.

    Attributes
    ----------
    source : Source
        Domains of teacher and student, as they were given, and fresh draws of them.
    profile, probes : ndarray, shapes (n, d, d) and (k, d, d)
        The teacher's motion, and held-out samples of its domain; images are taken of both.
    original : ndarray, shape (n, d, d)
        The profile as the fit sees it: regularised, in the student's frame.
    truth : ndarray, shape (n, d, d), or None
        What it should become, with the student's regularisation.
    student : StudentCloud
        Of a part of its domain; `of_teacher` are the places of a part of the teacher's.
    of_teacher : ndarray
    fresh : ndarray
        Fresh samples of the student, with its regularisation.
    identity : (ndarray, ndarray)
        Two draws for the identity test; `identity_fit` as in `Counts`.
    draws : (tuple of ndarray, tuple of ndarray, str), or None
        Draws of both domains for the stability, and where they came from.
    """

    source: Source
    profile: Array
    probes: Array
    original: Array
    truth: Array | None
    student: StudentCloud
    of_teacher: NDArray[np.intp]
    fresh: Array
    identity: tuple[Array, Array]
    draws: tuple[tuple[Array, ...], tuple[Array, ...], str] | None
    identity_fit: int | None = None

    @classmethod
    def of(
        cls,
        adapter: DomainAdapter,
        source: Source,
        profile: ArrayLike,
        truth: ArrayLike | None,
        counts: "Counts",
        random: np.random.Generator,
    ) -> "Bench":
        """Check what was given and draw what is missing."""
        cloud = as_points(adapter.student_side(source.student, "student_domain"), "student_domain")
        identity, fresh = source.identity(random, counts.identity), source.fresh(random)
        some, others = (
            np.sort(random.permutation(len(domain))[:most])
            for domain, most in zip((source.teacher, cloud), ENERGY_SAMPLES, strict=True)
        )
        return cls(
            source=source,
            profile=as_finite(profile, "profile"),
            probes=source.held_out(counts.probes, random),
            original=as_points(adapter.teacher_side(profile, "profile"), "profile", minimum=3),
            truth=None if truth is None else adapter.student_side(truth, "truth"),
            student=StudentCloud.of(cloud[others]),
            of_teacher=some,
            fresh=adapter.student_side(fresh, "fresh"),
            identity=identity,
            draws=source.both(counts.draws, random) if counts.draws else None,
            identity_fit=counts.identity_fit,
        )

    @cached_property
    def moves(self) -> bool:
        """Whether the teacher's ellipsoids change at all."""
        return moves(self.original)

    def measure(self, one: Alternative, adapter: DomainAdapter, options: dict[str, Any]) -> tuple[Row, Array]:
        """Fit where that is to be done, and measure all but identity and gap; also return the images of the profile."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            if not one.fitted:
                adapter.fit(self.source.teacher, self.source.student)
            images = [adapter.transform(points) for points in (self.profile, self.probes) if len(points)]
            mapped = adapter.student_side(images[0])
            domain = adapter.student_side(adapter.transform(self.source.teacher[self.of_teacher]))
            row = Row(
                one.name,
                one.note,
                name_of(adapter),
                rmse=None if self.truth is None else rmse(self.truth, mapped),
                smoothness=smoothness(mapped, self.original) if self.moves else None,
                structure=structure(mapped, self.original) if self.moves else None,
                energy_distance=self.student.energy_distance(domain),
                stability=None if self.draws is None else stability(adapter, *self.draws[:2], self.profile, **options),
            )
        texts = dict.fromkeys(str(warning.message) for warning in caught)
        failures = adapter.report_.failures() if isinstance(adapter, LengthsField) else ()
        return replace(row, failures=failures, warnings=tuple(texts)), np.concatenate(images)

    def identified(self, adapter: DomainAdapter) -> Row:
        """What the identity test of a clone says, and what it warned of, as a row without a name."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ManiportWarning)
            found = identity_test(adapter, *self.identity, self.identity_fit)
        return Row("", identity=found, warnings=tuple(dict.fromkeys(str(one.message) for one in caught)))

    def noise(self) -> Row:
        """What fresh samples of the student score against its own domain."""
        return Row(OWN_SAMPLES, energy_distance=self.student.energy_distance(self.fresh))
