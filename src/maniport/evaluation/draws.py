"""Where independent draws of the domains come from: the arms where they are known, else parts of what was given."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.domain import sample_domain
from maniport.errors import InvalidInputError
from maniport.validation import Array

IDENTITY_SAMPLES = 4096
"""Size of the two draws of the identity test, where the robot is known and its domain is not smaller."""

FRESH_SAMPLES = 1024
PARTS = 4
"""Disjoint parts that given domains are split into."""

FEWEST = 8
"""Ellipsoids that each domain must have to be split."""


@dataclass(frozen=True)
class Draws:
    """Independent draws of the teacher's and the student's domain, and where they came from."""

    teacher: tuple[Array, ...]
    student: tuple[Array, ...]
    words: str

    @property
    def both(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """As `stability` takes them."""
        return self.teacher, self.student


def identity_draws(
    robot: Arm | None, options: Mapping[str, Any], student: Array, random: np.random.Generator
) -> tuple[Array, Array]:
    """Two disjoint draws of the student's domain."""
    if robot is None:
        first, second = _parts(student, 2, random, "student_domain")
        return first, second
    n = min(IDENTITY_SAMPLES, len(student))
    first, second = (sample_domain(robot, n, random, spec=EllipsoidSpec(**options)) for _ in range(2))
    d = first.shape[-1]
    if student.shape[1:] != (d, d):
        raise InvalidInputError(
            f"student_domain must hold the ellipsoids of {robot.name!r} with these options, shape (m, {d}, {d}); "
            f"found shape {student.shape}"
        )
    return first, second


def stability_draws(
    person: Arm | None,
    robot: Arm | None,
    options: Mapping[str, Any],
    clouds: tuple[Array, Array],
    count: int,
    random: np.random.Generator,
) -> Draws:
    """Draw both domains `count` times in their sizes, or split them into four where an arm is not known."""
    if count < 2:
        raise InvalidInputError(f"draws must be 0 or at least 2; found {count}")
    if person is None or robot is None:
        teacher, student = (
            tuple(_parts(cloud, PARTS, random, name))
            for cloud, name in zip(clouds, ("teacher_domain", "student_domain"), strict=True)
        )
        return Draws(teacher, student, f"{PARTS} disjoint parts of the domains")
    teacher, student = (
        tuple(sample_domain(arm, len(cloud), random, spec=EllipsoidSpec(**options)) for _ in range(count))
        for arm, cloud in zip((person, robot), clouds, strict=True)
    )
    return Draws(teacher, student, f"{count} fresh draws of both domains")


def fresh_samples(robot: Arm | None, options: Mapping[str, Any], student: Array, random: np.random.Generator) -> Array:
    """Fresh samples of the student; without its arm a part of its domain."""
    if robot is not None:
        return sample_domain(robot, min(FRESH_SAMPLES, len(student)), random, spec=EllipsoidSpec(**options))
    return student[random.permutation(len(student))[: max(1, min(FRESH_SAMPLES, len(student) // 8))]]


def _parts(cloud: Array, count: int, random: np.random.Generator, name: str) -> list[Array]:
    if len(cloud) < max(FEWEST, 2 * count):
        raise InvalidInputError(
            f"{name} must hold at least {FEWEST} ellipsoids to be split into {count} parts; found {len(cloud)}"
        )
    return [cloud[np.sort(part)] for part in np.array_split(random.permutation(len(cloud)), count)]
