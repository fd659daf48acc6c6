"""Correspondences: which ellipsoids of two clouds are matched under a rotation.

To add one, derive a frozen dataclass of its options from `Correspondence`, whose `between` prepares two clouds and
returns a function of the rotation. `RiemannianICP(correspondence=MyOwn())` takes it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Self

import numpy as np

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import congruence
from maniport.spd.neighbors import Indices, NeighborIndex
from maniport.transfer.icp.score import EllipsoidFeatures, ScoreMatcher
from maniport.util.optional import optimal_transport
from maniport.util.validation import Array, as_choice, as_number

LIMIT = 2000  # Most ellipsoids of a cloud for an assignment: 1 s for each rotation, growing with the third power

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
class DirectedCorrespondence(Correspondence):
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
        exchanged = self.one_way(student, teacher)

        def backward(rotation: Array) -> Matches:
            matches = exchanged(rotation.T)
            return Matches(matches.student, matches.teacher, matches.weight)

        if self.direction == "student" or self.direction == "smaller":
            return backward
        forward = self.one_way(teacher, student)
        return lambda rotation: forward(rotation).joined(backward(rotation))


def trimmed_count(count: int, trim: float) -> int:
    """Return how many of `count` matches the fraction `trim` drops, rounded down; one match always remains."""
    return min(int(trim * count + 1e-9), count - 1)


@dataclass(frozen=True)
class GeodesicCorrespondence(DirectedCorrespondence):
    """Match every ellipsoid with the one at the smallest affine-invariant distance, found exactly.

    All matches weigh the same. Equal matches lower the cost in every iteration: matching and rotation have one
    objective (Besl and McKay 1992).

    Parameters
    ----------
    direction : {"smaller", "teacher", "student", "both"}
        The side each of whose ellipsoids gets a partner: the smaller cloud, the teacher's where both are of one size;
        the teacher, as in the paper; the student; or both, with half of the weight each.
    trim : float
        Fraction, in [0, 1), of the worst matches (lowest score or largest distance) that is dropped each time.

    References
    ----------
    Besl and McKay, A method for registration of 3-D shapes, IEEE TPAMI 14, 1992.
    """

    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match with the nearest."""
        return partial(self._match, teacher, NeighborIndex(student))

    def _match(self, teacher: Array, student: NeighborIndex, rotation: Array) -> Matches:
        index, distance = student.query(congruence(rotation, teacher))
        return Matches.trimmed(np.arange(len(index)), index, np.ones(len(index)), distance, self.trim)


@dataclass(frozen=True)
class EllipsoidCorrespondence(DirectedCorrespondence):
    """Match every ellipsoid with the one of the largest score (Reithmeir et al. 2022, eq. 18).

    The score ``w = |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|)``, between 0 and 4, compares the
    directions of the shortest and the longest axis, the condition numbers and the volumes.

    Parameters
    ----------
    direction, trim
        See `GeodesicCorrespondence`; a lower score is a worse match.
    exponent : float
        k in the weights w^k of the matches (the paper's best rows have 3; 0 gives equal weights).

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    exponent: float = 3.0
    log_shapes: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        as_number(self.exponent, "exponent", minimum=0.0)

    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match by score."""
        features = (EllipsoidFeatures.of(points, self.log_shapes) for points in (teacher, student))
        return partial(self._match, ScoreMatcher(*features))

    def _match(self, matcher: ScoreMatcher, rotation: Array) -> Matches:
        index, score = matcher.query(rotation)
        best = score.max()
        weight = (score / best) ** self.exponent if best > 0 else np.ones_like(score)
        return Matches.trimmed(np.arange(len(index)), index, weight, -score, self.trim)


@dataclass(frozen=True)
class LogEllipsoidCorrespondence(EllipsoidCorrespondence):
    """As `EllipsoidCorrespondence`, with ``exp(−|log p − log p'|) + exp(−|log vol − log vol'|)`` in the score.

    The terms are ratios of condition numbers and volumes, which also separate elongated ellipsoids; in the paper's
    score they are all equally unlike.

    Parameters
    ----------
    direction, trim, exponent
        See `EllipsoidCorrespondence`.
    """

    log_shapes: ClassVar[bool] = True


@dataclass(frozen=True)
class Assignment(Correspondence):
    """Base of the correspondences that minimize the sum of squared distances over all matches."""

    trim: float = 0.0
    name: ClassVar[str]

    def __post_init__(self) -> None:
        as_number(self.trim, "trim", minimum=0.0, below=1.0)

    @abstractmethod
    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Return rows, columns and masses, shapes (k,), that minimize the sum of mass times cost (n, m)."""

    def between(self, teacher: Array, student: Array) -> Matching:
        """Match both clouds as a whole; raise where they are too large."""
        if max(len(teacher), len(student)) > LIMIT:
            raise InvalidInputError(
                f"correspondence={self.name!r} matches at most {LIMIT} ellipsoids of each domain, since its time grows "
                f"with the third power; found {len(teacher)} and {len(student)}: give smaller domains, "
                f"search=Search(most_singular={LIMIT}), or correspondence='geodesic'"
            )
        return partial(self._match, teacher, student)

    def _match(self, teacher: Array, student: Array, rotation: Array) -> Matches:
        turned = congruence(rotation, teacher)
        step = max(1, 200_000 // len(student))  # distances at a time, against memory
        rows = [distance_unchecked(turned[i : i + step, None], student) for i in range(0, len(turned), step)]
        first, second, mass = self.assign(np.concatenate(rows) ** 2)
        return Matches(first, second, mass / mass.sum())


@dataclass(frozen=True)
class OneToOneCorrespondence(Assignment):
    """Give every ellipsoid of the smaller cloud its own partner; the sum of squared distances is minimal.

    Solved exactly by SciPy's `linear_sum_assignment` (Crouse 2016), O(n³); rectangular problems leave ellipsoids of
    the larger cloud unmatched. All matches weigh the same.

    Parameters
    ----------
    trim : float
        Fraction, in [0, 1), that is dropped. It is chosen together with the matches.

    References
    ----------
    Crouse, On implementing 2D rectangular assignment algorithms, IEEE Trans. Aerosp. Electron. Syst. 52, 2016.
    """

    name = "one-to-one"

    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Solve the linear assignment."""
        from scipy.optimize import linear_sum_assignment  # slow to load

        n, m = cost.shape
        rows, columns = linear_sum_assignment(_with_dummies(cost, trimmed_count(min(n, m), self.trim)))
        real = (rows < n) & (columns < m)
        return np.asarray(rows[real], np.intp), np.asarray(columns[real], np.intp), np.ones(int(real.sum()))


@dataclass(frozen=True)
class TransportCorrespondence(Assignment):
    """Transport the teacher's cloud, masses 1/n, onto the student's, masses 1/m, at the least total cost.

    The cost is the squared affine-invariant distance: the 2-Wasserstein distance on the manifold. The plan of POT's
    exact network simplex has at most n + m − 1 matches (Bonneel et al. 2011); their masses are the weights. Clouds of
    equal size are matched one to one.

    Parameters
    ----------
    trim : float
        See `OneToOneCorrespondence`.

    References
    ----------
    Bonneel, van de Panne, Paris and Heidrich, Displacement interpolation using Lagrangian mass transport,
    ACM TOG 30, 2011.
    """

    name = "transport"

    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Solve the transport."""
        emd = optimal_transport().emd  # slow to load

        n, m = cost.shape
        supply, demand = np.full(n, 1.0 / n), np.full(m, 1.0 / m)
        if self.trim > 0.0:  # partial transport by dummy points (Chapel et al. 2020)
            cost, supply, demand = _with_dummies(cost, 1), np.append(supply, self.trim), np.append(demand, self.trim)
        plan, log = emd(supply, demand, cost, numItermax=10_000_000, log=True)
        if log["warning"]:
            raise InvalidInputError(
                f"the transport of {n} onto {m} ellipsoids could not be solved ({log['warning']}); "
                "give smaller domains or another correspondence"
            )
        plan = plan[:n, :m]
        rows, columns = np.nonzero(plan > 1e-9 / max(n, m))  # smaller masses are rounding
        return rows, columns, np.asarray(plan[rows, columns])


def _with_dummies(cost: Array, count: int) -> Array:
    """Add free rows and columns for the matches that are dropped; dummies are not matched with each other."""
    n, m = cost.shape
    padded = np.zeros((n + count, m + count))
    padded[:n, :m] = cost
    padded[n:, m:] = 2.0 * cost.max() + 1.0
    return padded


CORRESPONDENCES: dict[str, type[Correspondence]] = {
    "ellipsoid": EllipsoidCorrespondence,
    "log-ellipsoid": LogEllipsoidCorrespondence,
    "geodesic": GeodesicCorrespondence,
    "one-to-one": OneToOneCorrespondence,
    "transport": TransportCorrespondence,
}
"""The correspondences by the names that `RiemannianICP` takes."""


def correspondence_of(value: str | Correspondence) -> Correspondence:
    """Return a correspondence: the one of that name with its defaults, or the given one."""
    if isinstance(value, Correspondence):
        return value
    if isinstance(value, str):
        return CORRESPONDENCES[as_choice(value, "correspondence", tuple(CORRESPONDENCES))]()
    raise InvalidInputError(
        f"correspondence must be one of {', '.join(map(repr, CORRESPONDENCES))} or a Correspondence; found {value!r}"
    )
