"""The paper's correspondence, who resembles whom in direction and shape, and the same with shapes compared by ratio."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from maniport.subsample import evenly_spaced
from maniport.transfer.icp.correspondence.contract import Indices, Matches, Matching, Seeking
from maniport.transfer.icp.correspondence.match_table import LARGEST_TABLE, MatchTable
from maniport.transfer.icp.correspondence.match_tree import EllipsoidFeatures, MatchTree
from maniport.validation import Array, as_number


@dataclass(frozen=True, repr=False)
class EllipsoidCorrespondence(Seeking):
    """Every ellipsoid with the one of the largest score (Reithmeir et al. 2022, eq. 18).

    The score ``w = |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|)``, between 0 and 4, compares the
    directions of the shortest and the longest axis, the condition numbers and the volumes.

    Parameters
    ----------
    direction, trim
        See `GeodesicCorrespondence`; a lower score is a worse match.
    exponent : float
        k in the weights w^k of the matches (the paper's best rows have 3; 0 gives equal weights).

    See Also
    --------
    LogEllipsoidCorrespondence : the same with ratios.
    GeodesicCorrespondence : by the distance that ICP minimizes.

    References
    ----------
    Reithmeir, Figueredo and Haddadin, Human-to-robot manipulability domain adaptation with parallel transport and
    manifold-aware ICP, IROS 2022.
    """

    exponent: float = 3.0

    def __post_init__(self) -> None:
        super().__post_init__()
        as_number(self.exponent, "exponent", minimum=0.0)

    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match by score."""
        asking, asked = self.features(teacher), self.features(student)
        if len(teacher) * len(student) <= LARGEST_TABLE:
            return partial(self._match, len(teacher), MatchTable(asking, asked).query)
        return partial(self._match, len(teacher), partial(_through_tree, asking, MatchTree(asked)))

    def _match(
        self,
        count: int,
        best_of: Callable[[Array, Indices], tuple[Indices, Array]],
        rotation: Array,
        limit: int | None = None,
    ) -> Matches:
        seeking = evenly_spaced(count, limit)
        index, score = best_of(rotation, seeking)
        best = score.max()
        weight = (score / best) ** self.exponent if best > 0 else np.ones_like(score)
        return Matches.best(seeking, index, weight, -score, self.trim)

    @staticmethod
    def features(points: Array) -> EllipsoidFeatures:
        """What the score compares of SPD matrices, shape (n, d, d)."""
        return EllipsoidFeatures.of(points)


def _through_tree(
    teacher: EllipsoidFeatures, student: MatchTree, rotation: Array, seeking: Indices
) -> tuple[Indices, Array]:
    """Best matches of some of the teacher's ellipsoids, turned, and their scores."""
    return student.query(teacher.pick(seeking).turned(rotation))


@dataclass(frozen=True, repr=False)
class LogEllipsoidCorrespondence(EllipsoidCorrespondence):
    """As `EllipsoidCorrespondence`, with ``exp(−|log p − log p'|) + exp(−|log vol − log vol'|)`` in the score.

    These exponentials are ratios, the smaller condition or volume over the larger one. Elongated ellipsoids, whose
    conditions differ by tens and more, so keep a shape; in the paper's score they all look equally unlike.

    Parameters
    ----------
    direction, trim, exponent
        See `EllipsoidCorrespondence`.

    See Also
    --------
    EllipsoidCorrespondence : the paper's score.
    """

    @staticmethod
    def features(points: Array) -> EllipsoidFeatures:
        """The same, with the logarithms of condition and volume."""
        shape = EllipsoidFeatures.of(points)
        return replace(shape, condition=np.log(shape.condition), volume=np.log(shape.volume))
