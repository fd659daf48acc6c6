"""The paper's correspondence: the largest score of direction and shape, found exactly by a sorted search."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from maniport.spd.kernels import eigh
from maniport.transfer.icp.matches import Indices, Matches, Matching, Seeking
from maniport.util.jit import kernel
from maniport.util.validation import Array, as_number

EQUAL_EIGENVALUES = 1e-6  # Relative difference below which an eigenvector is undefined and must not decide a match

TIE = 1e-12  # Scores that differ by less are equal; of equal scores the lowest index wins


@dataclass(frozen=True)
class EllipsoidFeatures:
    """The features that the score compares (Reithmeir et al. 2022, eq. 18)."""

    directions: Array  # (n, 2, d): unit eigenvectors of the smallest and largest eigenvalue; zero where undefined
    shapes: Array  # (n, 2): condition number λ_max / λ_min, and volume (product of the semi-axes)

    @classmethod
    def of(cls, points: Array, ratios: bool = False) -> "EllipsoidFeatures":
        """Measure SPD matrices, shape (n, d, d); with `ratios` the shapes are logarithms."""
        values, vectors = eigh(points)
        gaps = np.stack([values[:, 1] - values[:, 0], values[:, -1] - values[:, -2]], axis=1) / values[:, [1, -1]]
        directions = np.stack([vectors[:, :, 0], vectors[:, :, -1]], axis=1)
        directions *= (gaps > EQUAL_EIGENVALUES)[:, :, None]
        shapes = np.stack([values[:, -1] / values[:, 0], np.sqrt(np.prod(values, axis=-1))], axis=1)
        return cls(directions, np.log(shapes) if ratios else shapes)


class ScoreMatcher:
    """Two clouds, prepared for matching by the largest score under many rotations."""

    def __init__(self, teacher: EllipsoidFeatures, student: EllipsoidFeatures):
        order = np.argsort(student.shapes[:, 0], kind="stable")
        positions = np.searchsorted(student.shapes[order, 0], teacher.shapes[:, 0])
        self._directions = teacher.directions
        self._clouds = teacher.shapes, positions, student.directions[order], student.shapes[order], order

    def query(self, rotation: Array | None = None) -> tuple[Indices, Array]:
        """For every teacher ellipsoid, rotated, the index of the student's with the largest score, and the score."""
        directions = self._directions if rotation is None else self._directions @ rotation.T
        index, score = np.empty(len(directions), np.intp), np.empty(len(directions))
        _search(directions, *self._clouds, index, score)
        return index, score


@kernel
def _search(directions_t, shapes_t, positions, directions_s, shapes_s, order, indices, scores):  # type: ignore[no-untyped-def]
    """Fill `indices` and `scores`, going outward from the student ellipsoid of the nearest condition number.

    The score of a candidate is at most 3 + exp(−|p − p'|), so that the search ends where this falls below the best.
    """
    count, d = len(order), directions_t.shape[2]
    for i in range(len(positions)):
        condition, volume = shapes_t[i, 0], shapes_t[i, 1]
        left, right = positions[i] - 1, positions[i]
        best, best_index, reach = -1.0, 0, np.inf
        while left >= 0 or right < count:
            gap_left = condition - shapes_s[left, 0] if left >= 0 else np.inf
            gap_right = shapes_s[right, 0] - condition if right < count else np.inf
            if gap_left <= gap_right:
                j, gap = left, gap_left
                left -= 1
            else:
                j, gap = right, gap_right
                right += 1
            if gap > reach:
                break
            minor, major = 0.0, 0.0
            for k in range(d):
                minor += directions_t[i, 0, k] * directions_s[j, 0, k]
                major += directions_t[i, 1, k] * directions_s[j, 1, k]
            score = abs(minor) + abs(major)
            # exp(−g) ≤ 1 / (1 + g + g²/2), which costs no exponential
            if score + 1.0 + 1.0 / (1.0 + gap * (1.0 + 0.5 * gap)) < best - TIE:
                continue
            score += np.exp(-gap) + np.exp(-abs(volume - shapes_s[j, 1]))
            if score > best + TIE or (score >= best - TIE and order[j] < best_index):
                best_index = order[j]
            if score > best:
                best = score
                excess = best - 3.0 - 2.0 * TIE
                reach = -np.log(excess) if excess > 0.0 else np.inf
        indices[i], scores[i] = best_index, best


@dataclass(frozen=True)
class EllipsoidCorrespondence(Seeking):
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

    def __post_init__(self) -> None:
        super().__post_init__()
        as_number(self.exponent, "exponent", minimum=0.0)

    def one_way(self, teacher: Array, student: Array) -> Matching:
        """Match by score."""
        ratios = isinstance(self, LogEllipsoidCorrespondence)
        features = EllipsoidFeatures.of(teacher, ratios), EllipsoidFeatures.of(student, ratios)
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
