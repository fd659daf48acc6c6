"""Who seeks: every teacher ellipsoid, every student ellipsoid, or both."""

import numpy as np

from maniport.transfer.icp.correspondence.contract import Correspondence, Matches
from maniport.validation import Array

DIRECTIONS = ("teacher", "student", "both")


class Exchanged(Correspondence):
    """Every student ellipsoid seeks a partner: `inner` is built with the roles exchanged, and so are its matches."""

    def __init__(self, inner: Correspondence):
        super().__init__(inner.student, inner.teacher, inner.trim, inner.exponent)
        self._inner = inner

    def match(self, rotation: Array) -> Matches:
        """Turning the teacher is turning the student back."""
        return self._inner.match(rotation.T).exchanged()

    def scouts(self, limit: int) -> "Exchanged":
        """Return the same for fewer seeking ellipsoids."""
        return Exchanged(self._inner.scouts(limit))


class Both(Correspondence):
    """Both sides seek; each side's matches have half of the weight, however many they are."""

    def __init__(self, first: Correspondence, second: Correspondence):
        super().__init__(first.teacher, first.student, first.trim, first.exponent)
        self._sides = (first, second)

    def match(self, rotation: Array) -> Matches:
        """Return the matches of both sides; a pair that chose each other occurs twice."""
        sides = [side.match(rotation) for side in self._sides]
        return Matches(
            np.concatenate([side.teacher for side in sides]),
            np.concatenate([side.student for side in sides]),
            np.concatenate([0.5 * side.weight for side in sides]),
        )

    def scouts(self, limit: int) -> "Both":
        """Return the same for fewer seeking ellipsoids on each side."""
        return Both(*(side.scouts(limit) for side in self._sides))


def correspondence_of(
    kind: type[Correspondence],
    teacher: Array,
    student: Array,
    direction: str = "teacher",
    trim: float = 0.0,
    exponent: float = 3.0,
) -> Correspondence:
    """Build a correspondence of two recentred clouds in one direction or both.

    Parameters
    ----------
    kind : type
        One of `CORRESPONDENCES`.
    teacher, student : ndarray, shapes (n, d, d) and (m, d, d)
    direction : {"teacher", "student", "both"}
        Who seeks a partner. Makes no difference to symmetric kinds.
    trim, exponent : float
        See `Correspondence`.
    """
    if kind.symmetric or direction == "teacher":
        return kind(teacher, student, trim, exponent)
    seeking = Exchanged(kind(student, teacher, trim, exponent))
    return seeking if direction == "student" else Both(kind(teacher, student, trim, exponent), seeking)
