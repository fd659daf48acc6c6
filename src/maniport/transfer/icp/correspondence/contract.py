"""What every way of matching two clouds keeps: options, that build a matching of two clouds, that is asked for matches.

A way of one's own is one class: a frozen dataclass of its options, derived from `Correspondence`, whose `between` looks
at both clouds once and returns a function of the rotation. `RiemannianICP(correspondence=MyOwn())` takes it.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_choice, as_number

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

    See Also
    --------
    Correspondence : finds them.
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

    def beside(self, others: "Matches") -> "Matches":
        """Return both, these first, each side with half of the weight, however many they are."""
        return Matches(
            np.concatenate([self.teacher, others.teacher]),
            np.concatenate([self.student, others.student]),
            np.concatenate([0.5 * self.weight, 0.5 * others.weight]),
        )

    def partners(self) -> bytes:
        """Return a key that is equal for equal partners."""
        return self.teacher.tobytes() + b"|" + self.student.tobytes()


class Matching(Protocol):
    """Matches two clouds that are recentred at the identity, under any rotation of the teacher."""

    def __call__(self, rotation: Array, limit: int | None = None) -> Matches:
        """Match R T_i Rᵀ with S_j, R being `rotation`, shape (d, d)."""


OPTIONS: dict[str, type["Options"]] = {}
"""Every class of options by its name, for files; those from outside of maniport with their module."""


class Options:
    """Base of frozen dataclasses of options, which check themselves when they are made and show what was chosen."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        OPTIONS[cls.key()] = cls

    @classmethod
    def key(cls) -> str:
        """Name in `OPTIONS`."""
        return cls.__name__ if cls.__module__.startswith("maniport.") else f"{cls.__module__}.{cls.__qualname__}"

    def chosen(self) -> dict[str, Any]:
        """Return the options that are not their defaults."""
        every: Any = fields(self) if is_dataclass(self) else ()
        return {one.name: getattr(self, one.name) for one in every if getattr(self, one.name) is not one.default}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.chosen().items())})"

    def plain(self) -> dict[str, Any]:
        """Return what a file keeps: the name of the class, and the options where these are numbers and words."""
        values = {name: getattr(value, "item", lambda value=value: value)() for name, value in self.chosen().items()}
        held = is_dataclass(self) and all(isinstance(value, (bool, int, float, str)) for value in values.values())
        return {"class": self.key(), "options": values if held else None}


def options_from(plain: dict[str, Any]) -> Options:
    """Return what `Options.plain` wrote; a `LostCorrespondence` for what is not known here or was not held."""
    kind, options = OPTIONS.get(plain["class"]), plain["options"]
    return LostCorrespondence(plain["class"]) if kind is None or options is None else kind(**options)


class Correspondence(Options, ABC):
    """Says how the ellipsoids of two clouds find their partners.

    See Also
    --------
    EllipsoidCorrespondence, GeodesicCorrespondence, OneToOneCorrespondence, TransportCorrespondence
    RiemannianICP : takes one.
    """

    @abstractmethod
    def between(self, teacher: Array, student: Array) -> Matching:
        """Look at two clouds, shapes (n, d, d) and (m, d, d), and return how they match under each rotation."""


@dataclass(frozen=True, repr=False)
class Seeking(Correspondence):
    """Base of those where ellipsoids seek their partners one by one.

    Parameters
    ----------
    direction, trim
        See `maniport.transfer.GeodesicCorrespondence`.
    """

    direction: str = "smaller"
    trim: float = 0.0

    def __post_init__(self) -> None:
        as_choice(self.direction, "direction", DIRECTIONS)
        as_number(self.trim, "trim", minimum=0.0, below=1.0)

    @abstractmethod
    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Return how every teacher ellipsoid finds its partner."""

    def between(self, teacher: Array, student: Array) -> Matching:
        """Build what the direction asks for."""
        teacher_seeks = self.direction == "teacher" or (self.direction == "smaller" and len(teacher) <= len(student))
        if teacher_seeks:
            return self.one_way(teacher, student)
        back = partial(_exchanged, self.one_way(student, teacher))
        return partial(_both, self.one_way(teacher, student), back) if self.direction == "both" else back


def _exchanged(inner: Matching, rotation: Array, limit: int | None = None) -> Matches:
    """Turning the teacher is turning the student back; `inner` was built with the roles exchanged."""
    return inner(rotation.T, limit).exchanged()


def _both(first: Matching, second: Matching, rotation: Array, limit: int | None = None) -> Matches:
    """Both sides seek; a pair that chose each other occurs twice."""
    return first(rotation, limit).beside(second(rotation, limit))


@dataclass(frozen=True)
class LostCorrespondence(Correspondence):
    """Stands for a correspondence of the user's own, which a file names and does not hold."""

    name: str

    def between(self, teacher: Array, student: Array) -> Matching:
        """Say what is missing."""
        raise InvalidInputError(
            f"the file of this adapter names the correspondence {self.name} and does not hold it; "
            "before fitting again give it: set_params(correspondence=...)"
        )


def left_out(count: int, trim: float) -> int:
    """Return how many of `count` matches make up the fraction `trim`, rounded down; one match always remains."""
    return min(int(trim * count + 1e-9), count - 1)
