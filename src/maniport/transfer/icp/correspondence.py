"""Correspondences: which ellipsoids of two clouds are matched under a rotation.

To add one, derive a frozen dataclass of its options from `Correspondence`, whose `between` prepares two clouds and
returns a function of the rotation. `RiemannianICP(correspondence=MyOwn())` takes it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import Indices, NeighborIndex
from maniport.spd.ellipsoid import unit_ball_volume
from maniport.spd.kernels import congruence, eigh
from maniport.util.jit import kernel
from maniport.util.validation import Array, as_choice, as_number

EQUAL_EIGENVALUES = (
    1e-6  # Relative difference below which an eigenvector is undefined and must not decide a match
)

TIE = 1e-12  # Scores that differ by less are equal; of equal scores the lowest index wins

BLOCK = 32  # Candidates whose bounds are computed together: vector instructions


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


Matching = Callable[[Array], Matches]  # Matches R T_i Rᵀ with S_j for a rotation R, shape (d, d)


class Correspondence(ABC):
    """A rule that matches the ellipsoids of two clouds."""

    @abstractmethod
    def between(self, teacher: Array, student: Array) -> Matching:
        """Prepare two recentered clouds, shapes (n, d, d) and (m, d, d); return their matches by rotation."""


def _between(partners: Callable[[Array], tuple[Indices, Array]], teacher_seeks: bool) -> Matching:
    """Match each ellipsoid of the smaller cloud with its partner under the rotation of that cloud."""

    def match(rotation: Array) -> Matches:
        partner, weight = partners(rotation if teacher_seeks else rotation.T)
        seekers = np.arange(len(partner))
        weight = weight / weight.sum()
        if teacher_seeks:
            return Matches(seekers, partner, weight)
        return Matches(partner, seekers, weight)

    return match


@dataclass(frozen=True)
class GeodesicCorrespondence(Correspondence):
    """Match every ellipsoid with the one at the smallest affine-invariant distance, found exactly.

    Matches have equal weights. Matching and rotation have one objective, so that no iteration raises the cost.

    References
    ----------
    Besl and McKay, A method for registration of 3-D shapes, IEEE TPAMI 14, 1992.
    """

    def between(self, teacher: Array, student: Array) -> Matching:
        """Match with the nearest."""
        seeking, sought = sorted((teacher, student), key=len)
        index = NeighborIndex(sought)
        weight = np.ones(len(seeking))
        return _between(
            lambda rotation: (index.query(congruence(rotation, seeking))[0], weight),
            seeking is teacher,
        )


@dataclass(frozen=True)
class EllipsoidCorrespondence(Correspondence):
    """Match every ellipsoid with the one of the largest score (Reithmeir et al. 2022, eq. 18).

    The score ``w = |v₁·v₁'| + |v_n·v_n'| + exp(−|p − p'|) + exp(−|vol − vol'|)``, between 0 and 4, compares the
    directions of the shortest and the longest axis, the condition numbers λ_n/λ_1 and the volumes, which are
    `maniport.spd.volume`.

    Parameters
    ----------
    exponent : float
        k in the weights w^k of the matches (the paper's best rows have 3; 0 gives equal weights).
    """

    exponent: float = 3.0

    def __post_init__(self) -> None:
        as_number(self.exponent, "exponent", minimum=0.0)

    def between(self, teacher: Array, student: Array) -> Matching:
        """Match by score."""
        seeking, sought = sorted((teacher, student), key=len)
        directions, shapes = _features(seeking)
        directions_sought, shapes_sought = _features(sought)
        order = np.argsort(shapes_sought[:, 0], kind="stable")
        positions = np.searchsorted(shapes_sought[order, 0], shapes[:, 0])
        others = np.ascontiguousarray(directions_sought.swapaxes(1, 2)[order].T)
        other_shapes = np.ascontiguousarray(shapes_sought[order].T)

        def partners(rotation: Array) -> tuple[Indices, Array]:
            index = np.empty(len(shapes), np.intp)
            score = np.empty(len(shapes))
            _search(
                np.dot(directions, rotation.T),
                shapes,
                positions,
                others,
                other_shapes,
                order,
                index,
                score,
            )
            best = score.max()
            weight = np.ones_like(score)
            if best > 0:
                weight = (score / best) ** self.exponent
            return index, weight

        return _between(partners, seeking is teacher)


CORRESPONDENCES: dict[str, type[Correspondence]] = {
    "ellipsoid": EllipsoidCorrespondence,
    "geodesic": GeodesicCorrespondence,
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


def _features(points: Array) -> tuple[Array, Array]:
    """Return shortest and longest axes (n, 2, d), zero where undefined, and condition numbers and volumes (n, 2)."""
    values, vectors = eigh(points)
    gap_below = values[:, 1] - values[:, 0]
    gap_above = values[:, -1] - values[:, -2]
    gaps = np.stack([gap_below, gap_above], axis=1) / values[:, [1, -1]]
    shortest = vectors[:, :, 0]
    longest = vectors[:, :, -1]
    directions = np.stack([shortest, longest], axis=1)
    directions *= (gaps > EQUAL_EIGENVALUES)[:, :, None]
    conditions = values[:, -1] / values[:, 0]
    volumes = unit_ball_volume(points.shape[-1]) * np.sqrt(np.prod(values, axis=-1))
    return directions, np.stack([conditions, volumes], axis=1)


@kernel
def _search(
    directions_t: Array,
    shapes_t: Array,
    positions: NDArray[np.intp],
    directions_s: Array,
    shapes_s: Array,
    order: NDArray[np.intp],
    indices: NDArray[np.intp],
    scores: Array,
) -> None:
    """Fill `indices` and `scores`, going outward from the student ellipsoid of the nearest condition number."""
    count = len(order)
    d = directions_t.shape[2]
    minor = np.empty(BLOCK)
    major = np.empty(BLOCK)
    bound = np.empty(BLOCK)
    for i in range(len(positions)):
        condition = shapes_t[i, 0]
        volume = shapes_t[i, 1]
        left = positions[i]
        right = positions[i]
        best = -1.0
        best_index = 0
        reach = np.inf
        while left > 0 or right < count:
            if left > 0:
                gap_left = condition - shapes_s[0, left - 1]
            else:
                gap_left = np.inf
            if right < count:
                gap_right = shapes_s[0, right] - condition
            else:
                gap_right = np.inf
            if min(gap_left, gap_right) > reach:
                break
            if gap_left <= gap_right:
                first = max(left - BLOCK, 0)
                size = min(left, BLOCK)
                left = first
            else:
                first = right
                size = min(count - right, BLOCK)
                right += size
            minor[:] = 0.0
            major[:] = 0.0
            for k in range(d):
                x = directions_t[i, 0, k]
                y = directions_t[i, 1, k]
                shortest = directions_s[0, k, first : first + size]
                longest = directions_s[1, k, first : first + size]
                for w in range(size):
                    minor[w] += x * shortest[w]
                    major[w] += y * longest[w]
            conditions = shapes_s[0, first : first + size]
            volumes = shapes_s[1, first : first + size]
            for w in range(size):
                minor[w] = abs(minor[w]) + abs(major[w])
                gap = min(abs(conditions[w] - condition), 1e6)
                other = min(abs(volumes[w] - volume), 1e6)
                # exp(−g) ≤ 1 / (1 + g + g²/2), which costs no exponential
                x = 1.0 + gap * (1.0 + 0.5 * gap)
                y = 1.0 + other * (1.0 + 0.5 * other)
                bound[w] = minor[w] + (x + y) / (x * y)
            for w in range(size):
                if bound[w] < best - TIE:
                    continue
                j = first + w
                score = (
                    minor[w]
                    + np.exp(-abs(condition - conditions[w]))
                    + np.exp(-abs(volume - volumes[w]))
                )
                if score > best + TIE or (score >= best - TIE and order[j] < best_index):
                    best_index = order[j]
                if score > best:
                    best = score
            excess = best - 3.0 - 2.0 * TIE  # a candidate scores at most 3 + exp(−|p − p'|)
            if excess > 0.0:
                reach = -np.log(excess)
            else:
                reach = np.inf
        indices[i] = best_index
        scores[i] = best
