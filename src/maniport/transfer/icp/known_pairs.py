"""Known correspondences: ellipsoids of teacher and student in the same task at the same time."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.transfer.icp.rotation import RotationProblem
from maniport.transfer.icp.rotation_prior import RotationPrior
from maniport.transfer.icp.rotation_starts import starts
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array, as_points

Side = Callable[[ArrayLike, str], Array]
"""Treats ellipsoids, shape (k, d, d), as those of a domain were; also takes their name, for messages."""

TIE_BREAK = 1e-6
"""Weight of a prior, relative to the pairs' own size, that decides between rotations that suit the pairs equally."""

DISTINCT = 0.01
"""Angle [rad] from which on rotations are different ones."""


@dataclass(frozen=True)
class KnownPairs:
    """Ellipsoids that belong together, teacher[i] and student[i].

    Attributes
    ----------
    teacher, student : ndarray, shape (k, d, d)
    """

    teacher: Array
    student: Array

    def rotations(self, near: Array, random: np.random.Generator) -> list[Array]:
        """Return the rotations that turn the teacher's ellipsoids best onto the student's, equally well.

        The one nearest to the rotation `near` comes first. One pair leaves half turns about its axes open, pairs that
        are round about a common axis every turn about it, and round pairs everything; of all turns about an axis
        only the one nearest to `near` is returned.
        """
        count = len(self.teacher)
        size = np.sum(np.log(np.linalg.eigvalsh(np.concatenate([self.teacher, self.student]))) ** 2) / count
        prior = RotationPrior(near, TIE_BREAK * (1.0 + float(size)))
        problem = RotationProblem(self.student, self.teacher, np.full(count, 1.0 / count), prior)
        first = [near, *starts(self.teacher, self.student, random)]
        ends = sorted((problem.minimize(start, tol=1e-12) for start in first), key=lambda end: end.cost)
        found = [ends[0].rotation]
        equal = ends[0].cost + 2.0 * len(near) * prior.weight  # the largest penalty there is
        for end in ends:
            if end.cost <= equal and min(rotation_angle(end.rotation, other) for other in found) > DISTINCT:
                found.append(end.rotation)
        return found


def regular_pairs(
    pairs: tuple[ArrayLike, ArrayLike], sides_of: tuple[Side, Side], dimension: int
) -> tuple[Array, Array]:
    """Check known pairs and treat each side as its domain was; shapes (k, d, d).

    Raises
    ------
    InvalidInputError
        When `pairs` are not two sets of equally many ellipsoids, at least one, of the domains' size.
    """
    try:
        teacher, student = pairs
    except (TypeError, ValueError):
        raise InvalidInputError(
            "pairs must be two sets of ellipsoids, (teacher, student), each of shape (k, d, d); "
            f"found {type(pairs).__name__}" + (f" of {len(pairs)}" if hasattr(pairs, "__len__") else "")
        ) from None
    sides = []
    for name, side, own in zip(("pairs[0]", "pairs[1]"), (teacher, student), sides_of, strict=True):
        sides.append(as_points(own(side, name), name, dimension, minimum=1))
    if len(sides[0]) != len(sides[1]):
        raise InvalidInputError(
            "pairs must hold equally many ellipsoids of teacher and student, the same task at the same time; "
            f"found {len(sides[0])} and {len(sides[1])}"
        )
    return sides[0], sides[1]
