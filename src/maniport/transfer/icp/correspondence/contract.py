"""What every way of matching two clouds keeps: built once on both, asked again for every rotation."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from maniport.validation import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Matches:
    """Which ellipsoids belong together, and how much each match counts.

    Attributes
    ----------
    teacher, student : ndarray, shape (k,)
        Indices into the two clouds. An ellipsoid may occur often, or not at all.
    weight : ndarray, shape (k,)
        Non-negative; sums to one.
    """

    teacher: Indices
    student: Indices
    weight: Array

    @classmethod
    def best(cls, teacher: Indices, student: Indices, weight: Array, loss: Array, trim: float) -> Self:
        """Leave out the fraction `trim` of the matches with the largest loss; scale the other weights to sum to one.

        Of equal losses the first stay.
        """
        if trim > 0.0:
            best = np.sort(np.argsort(loss, kind="stable")[: len(loss) - left_out(len(loss), trim)])
            teacher, student, weight = teacher[best], student[best], weight[best]
        return cls(teacher, student, weight / weight.sum())

    def exchanged(self) -> "Matches":
        """Return the same matches with the roles of teacher and student exchanged."""
        return Matches(self.student, self.teacher, self.weight)

    def partners(self) -> bytes:
        """Return a key that is equal for equal partners."""
        return self.teacher.tobytes() + b"|" + self.student.tobytes()


class Correspondence(ABC):
    """Finds partners between two clouds that are recentred at the identity, under any rotation of the teacher.

    Every teacher ellipsoid seeks a partner; methods that are `symmetric` treat both sides alike.

    Parameters
    ----------
    teacher : ndarray, shape (n, d, d)
    student : ndarray, shape (m, d, d)
    trim : float
        Fraction of the worst matches, in [0, 1), that is left out under each rotation.
    exponent : float
        k in the weights w^k of methods that rate their matches by a score w; the others do not use it.
    """

    symmetric = False

    def __init__(self, teacher: Array, student: Array, trim: float = 0.0, exponent: float = 3.0):
        self.teacher, self.student = teacher, student
        self.trim, self.exponent = trim, exponent

    @abstractmethod
    def match(self, rotation: Array) -> Matches:
        """Match R T_i Rᵀ with S_j, R being `rotation`, shape (d, d)."""

    @abstractmethod
    def scouts(self, limit: int) -> "Correspondence":
        """Return the same correspondence for fewer ellipsoids, which is faster: `limit` of each side that seeks.

        They are taken evenly over their order; indices still refer to the whole clouds.
        """


def left_out(count: int, trim: float) -> int:
    """Return how many of `count` matches make up the fraction `trim`, rounded down; one match always remains."""
    return min(int(trim * count + 1e-9), count - 1)


def evenly(count: int, limit: int) -> Indices:
    """Choose at most `limit` of `count` places, evenly over their order."""
    return np.linspace(0, count - 1, min(count, limit)).round().astype(np.intp)
