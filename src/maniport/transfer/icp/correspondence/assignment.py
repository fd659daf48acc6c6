"""What the correspondences share that match two clouds as a whole."""

from abc import abstractmethod
from copy import copy
from typing import ClassVar

import numpy as np

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import congruence
from maniport.transfer.icp.correspondence.contract import Correspondence, Indices, Matches, evenly
from maniport.validation import Array

LIMIT = 2000
"""Largest number of ellipsoids on a side. All distances of 2000 × 2000 take 0.3 s under each rotation and solving the
assignment about 1 s, which grows with the third power; a search asks for some dozens."""

BLOCK = 200_000
"""Distances worked out at a time, against memory."""


class Assignment(Correspondence):
    """Base of the correspondences that minimise the sum of squared affine-invariant distances over all matches.

    Both sides are treated alike, so that every `direction` is the same.

    Raises
    ------
    InvalidInputError
        When a side has more than `LIMIT` ellipsoids.
    """

    symmetric = True
    name: ClassVar[str]

    def __init__(self, teacher: Array, student: Array, trim: float = 0.0, exponent: float = 3.0):
        super().__init__(teacher, student, trim, exponent)
        if max(len(teacher), len(student)) > LIMIT:
            raise InvalidInputError(
                f"correspondence={self.name!r} matches at most {LIMIT} ellipsoids of each domain, since its time grows "
                f"with the third power; found {len(teacher)} and {len(student)}: give smaller domains, "
                f"most_singular={LIMIT}, or correspondence='geodesic'"
            )
        self._rows, self._columns = np.arange(len(teacher)), np.arange(len(student))

    @abstractmethod
    def _assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Return rows, columns and masses, shapes (k,), that make the sum of mass times cost (n, m) least.

        The fraction `trim` of the mass is left out where this helps most.
        """

    def match(self, rotation: Array) -> Matches:
        """Match all at once. What is trimmed is chosen together with the matches, so that outliers displace nobody."""
        turned, fixed = congruence(rotation, self.teacher[self._rows]), self.student[self._columns]
        step = max(1, BLOCK // len(fixed))
        parts = [distance_unchecked(turned[i : i + step, None], fixed) for i in range(0, len(turned), step)]
        rows, columns, mass = self._assign(np.concatenate(parts) ** 2)
        return Matches(self._rows[rows], self._columns[columns], mass / mass.sum())

    def scouts(self, limit: int) -> "Assignment":
        """Return the same for fewer ellipsoids of both sides."""
        part = copy(self)
        part._rows, part._columns = evenly(len(self.teacher), limit), evenly(len(self.student), limit)
        return part


def with_dump(cost: Array, count: int) -> Array:
    """Add rows and columns that cost nothing, for what is left out, and that do not take one another."""
    n, m = cost.shape
    padded = np.zeros((n + count, m + count))
    padded[:n, :m] = cost
    padded[n:, m:] = 2.0 * cost.max() + 1.0
    return padded
