"""The contract of a correspondence: which ellipsoids of two clouds are matched under a rotation.

To add one, derive a frozen dataclass of its options from `Correspondence`, whose `between` prepares two clouds and
returns a function of the rotation. `RiemannianICP(correspondence=MyOwn())` takes it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from maniport.util.validation import Array, as_choice, as_number

Indices = NDArray[np.intp]

DIRECTIONS = ("smaller", "teacher", "student", "both")


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
    def trimmed(cls, teacher: Indices, student: Indices, weight: Array, loss: Array, trim: float) -> Self:
        """Drop the fraction `trim` of the matches with the largest loss and scale the weights to sum to one."""
        if trim > 0.0:
            kept = np.sort(np.argsort(loss, kind="stable")[: len(loss) - trimmed_count(len(loss), trim)])
            teacher, student, weight = teacher[kept], student[kept], weight[kept]
        return cls(teacher, student, weight / weight.sum())

    def joined(self, others: "Matches") -> "Matches":
        """Return both, these first, each with half of the weight."""
        return Matches(
            np.concatenate([self.teacher, others.teacher]),
            np.concatenate([self.student, others.student]),
            0.5 * np.concatenate([self.weight, others.weight]),
        )


Matching = Callable[[Array], Matches]  # Matches R T_i Rᵀ with S_j for a rotation R, shape (d, d)


class Correspondence(ABC):
    """A rule that matches the ellipsoids of two clouds."""

    @abstractmethod
    def between(self, teacher: Array, student: Array) -> Matching:
        """Prepare two recentered clouds, shapes (n, d, d) and (m, d, d); return their matches by rotation."""


@dataclass(frozen=True)
class Seeking(Correspondence):
    """Base of the correspondences that match each ellipsoid on its own; see `GeodesicCorrespondence`."""

    direction: str = "smaller"
    trim: float = 0.0

    def __post_init__(self) -> None:
        as_choice(self.direction, "direction", DIRECTIONS)
        as_number(self.trim, "trim", minimum=0.0, below=1.0)

    @abstractmethod
    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match every teacher ellipsoid with one of the student's."""

    def between(self, teacher: Array, student: Array) -> Matching:
        """Match in the chosen direction."""
        if self.direction == "teacher" or (self.direction == "smaller" and len(teacher) <= len(student)):
            return self.one_way(teacher, student)
        backward = partial(_exchanged, self.one_way(student, teacher))
        if self.direction == "both":
            return partial(_both, self.one_way(teacher, student), backward)
        return backward


def _exchanged(matching: Matching, rotation: Array) -> Matches:
    """Matches of a matching that was prepared with teacher and student exchanged."""
    found = matching(rotation.T)
    return Matches(found.student, found.teacher, found.weight)


def _both(forward: Matching, backward: Matching, rotation: Array) -> Matches:
    return forward(rotation).joined(backward(rotation))


def trimmed_count(count: int, trim: float) -> int:
    """Return how many of `count` matches the fraction `trim` drops, rounded down; one match always remains."""
    return min(int(trim * count + 1e-9), count - 1)
