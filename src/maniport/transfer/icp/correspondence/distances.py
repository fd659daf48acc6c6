"""Correspondences by affine-invariant distance: the nearest one, one to one, and optimal transport."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from maniport.errors import InvalidInputError
from maniport.optional import optimal_transport
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import congruence
from maniport.spd.neighbors import NeighborIndex
from maniport.subsample import evenly_spaced
from maniport.transfer.icp.correspondence.contract import (
    Correspondence,
    Indices,
    Matches,
    Matching,
    Seeking,
    left_out,
)
from maniport.validation import Array, as_number

LIMIT = 2000
"""Largest number of ellipsoids on a side where both are matched as a whole. All distances of 2000 × 2000 take 0.3 s
under each rotation and solving the assignment about 1 s, which grows with the third power; a search asks for dozens."""

BLOCK = 200_000
"""Distances worked out at a time, against memory."""

MAX_PIVOTS = 10_000_000
"""Limit of the transport's simplex, far beyond what `LIMIT` ellipsoids a side need."""

NEGLIGIBLE = 1e-9
"""Masses below this fraction of an ellipsoid's own are rounding."""


@dataclass(frozen=True, repr=False)
class GeodesicCorrespondence(Seeking):
    """Every ellipsoid with the one at the smallest affine-invariant distance, found exactly.

    All matches weigh the same. Equal matches lower the cost in every iteration: matching and rotation have one
    objective (Besl and McKay 1992).

    Parameters
    ----------
    direction : {"smaller", "teacher", "student", "both"}
        Who seeks a partner: every ellipsoid of the smaller cloud, the teacher's where both are of one size, since most
        of the larger one's may have none; every teacher ellipsoid, as in the paper; every student ellipsoid; or both,
        with half of the weight each.
    trim : float
        Fraction, in [0, 1), of the worst matches (lowest score or largest distance) that is left out each time.

    See Also
    --------
    OneToOneCorrespondence, TransportCorrespondence, EllipsoidCorrespondence

    References
    ----------
    Besl and McKay, A method for registration of 3-D shapes, IEEE TPAMI 14, 1992.
    """

    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match with the nearest."""
        return partial(self._match, teacher, NeighborIndex(student))

    def _match(self, teacher: Array, student: NeighborIndex, rotation: Array, limit: int | None = None) -> Matches:
        seeking = evenly_spaced(len(teacher), limit)
        index, distance = student.query(congruence(rotation, teacher[seeking]))
        return Matches.best(seeking, index, np.ones(len(index)), distance, self.trim)


@dataclass(frozen=True, repr=False)
class Assignment(Correspondence):
    """Base of those that minimise the sum of squared distances over all matches. Both sides are treated alike.

    Parameters
    ----------
    trim : float
        See `OneToOneCorrespondence`.

    Raises
    ------
    InvalidInputError
        When a side has more than `LIMIT` ellipsoids.
    """

    trim: float = 0.0
    name: ClassVar[str]

    def __post_init__(self) -> None:
        as_number(self.trim, "trim", minimum=0.0, below=1.0)

    @abstractmethod
    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Return rows, columns and masses, shapes (k,), that make the sum of mass times cost (n, m) least.

        The fraction `trim` of the mass is left out where this helps most.
        """

    def between(self, teacher: Array, student: Array) -> Matching:
        """Refuse clouds that are too large."""
        if max(len(teacher), len(student)) > LIMIT:
            raise InvalidInputError(
                f"correspondence={self.name!r} matches at most {LIMIT} ellipsoids of each domain, since its time grows "
                f"with the third power; found {len(teacher)} and {len(student)}: give smaller domains, "
                f"search=Search(most_singular={LIMIT}), or correspondence='geodesic'"
            )
        return partial(self._match, teacher, student)

    def _match(self, teacher: Array, student: Array, rotation: Array, limit: int | None = None) -> Matches:
        """Match all at once, or `limit` of either side."""
        rows, columns = evenly_spaced(len(teacher), limit), evenly_spaced(len(student), limit)
        turned, fixed = congruence(rotation, teacher[rows]), student[columns]
        step = max(1, BLOCK // len(fixed))
        parts = [distance_unchecked(turned[i : i + step, None], fixed) for i in range(0, len(turned), step)]
        first, second, mass = self.assign(np.concatenate(parts) ** 2)
        return Matches(rows[first], columns[second], mass / mass.sum())


@dataclass(frozen=True, repr=False)
class OneToOneCorrespondence(Assignment):
    """Every ellipsoid of the smaller cloud has a partner of its own, the sum of squared distances being least.

    Solved exactly by SciPy's `linear_sum_assignment` (Crouse 2016), O(n³); rectangular problems leave ellipsoids of
    the larger cloud alone. All matches weigh the same.

    Parameters
    ----------
    trim : float
        Fraction, in [0, 1), that is left out. It is chosen together with the matches, so that outliers displace nobody.

    See Also
    --------
    TransportCorrespondence : for clouds of different sizes.
    GeodesicCorrespondence : where partners may be shared.

    References
    ----------
    Crouse, On implementing 2D rectangular assignment algorithms, IEEE Trans. Aerosp. Electron. Syst. 52, 2016.
    """

    name = "one-to-one"

    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Solve the linear assignment."""
        from scipy.optimize import linear_sum_assignment  # takes its time to import

        n, m = cost.shape
        rows, columns = linear_sum_assignment(with_dump(cost, left_out(min(n, m), self.trim)))
        real = (rows < n) & (columns < m)
        return np.asarray(rows[real], np.intp), np.asarray(columns[real], np.intp), np.ones(int(real.sum()))


@dataclass(frozen=True, repr=False)
class TransportCorrespondence(Assignment):
    """Every teacher ellipsoid spreads 1/n over the student's, each of which receives 1/m, at the least total cost.

    The cost is the squared affine-invariant distance: the 2-Wasserstein distance on the manifold. The plan of POT's
    exact network simplex has at most n + m − 1 matches (Bonneel et al. 2011); their masses are the weights. Clouds of
    different density are matched as a whole, and clouds of equal size one to one.

    Parameters
    ----------
    trim : float
        See `OneToOneCorrespondence`.

    See Also
    --------
    OneToOneCorrespondence, GeodesicCorrespondence

    References
    ----------
    Bonneel, van de Panne, Paris and Heidrich, Displacement interpolation using Lagrangian mass transport,
    ACM TOG 30, 2011.
    """

    name = "transport"

    def assign(self, cost: Array) -> tuple[Indices, Indices, Array]:
        """Solve the transport."""
        emd = optimal_transport().emd  # takes a second to import

        n, m = cost.shape
        gives, receives = np.full(n, 1.0 / n), np.full(m, 1.0 / m)
        if self.trim > 0.0:  # partial transport by dummy points (Chapel et al. 2020)
            cost, gives, receives = with_dump(cost, 1), np.append(gives, self.trim), np.append(receives, self.trim)
        plan, log = emd(gives, receives, cost, numItermax=MAX_PIVOTS, log=True)
        if log["warning"]:
            raise InvalidInputError(
                f"the transport of {n} onto {m} ellipsoids could not be solved ({log['warning']}); "
                "give smaller domains or another correspondence"
            )
        plan = plan[:n, :m]
        rows, columns = np.nonzero(plan > NEGLIGIBLE / max(n, m))
        return rows, columns, np.asarray(plan[rows, columns])


def with_dump(cost: Array, count: int) -> Array:
    """Add rows and columns that cost nothing, for what is left out, and that do not take one another."""
    n, m = cost.shape
    padded = np.zeros((n + count, m + count))
    padded[:n, :m] = cost
    padded[n:, m:] = 2.0 * cost.max() + 1.0
    return padded
