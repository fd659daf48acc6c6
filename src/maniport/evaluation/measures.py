"""The measures of a mapped profile, by arrays: distance to the truth, steps, and how its ellipsoids lie to one another.

All take SPD matrices that carry the same regularisation on both sides; distances at different ones are not comparable.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import spearmanr

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.mean import mean
from maniport.subsample import evenly_spaced
from maniport.transfer.lengths.report import AXIS_MOVED
from maniport.validation import Array, as_count, as_points

STILL = 1e-9
"""Distances up to this are rounding: nothing moves there."""

MOST_POINTS = 500
"""Ellipsoids that pairwise distances are taken between, which makes 125 000 pairs."""


@dataclass(frozen=True)
class RMSE:
    """Root mean squared distance between the truth and the mapped ellipsoids, in three forms.

    Attributes
    ----------
    undivided : float
        sqrt(mean d²), dimensionless.
    per_dispersion : float
        Divided by the mean distance of the mapped ellipsoids to their Fréchet mean (Reithmeir et al. 2022, § V).
    per_squared_dispersion : float
        Divided by their mean squared distance to it, which is what the authors' published code computes.

    See Also
    --------
    rmse : makes it.
    """

    undivided: float
    per_dispersion: float
    per_squared_dispersion: float


def rmse(truth: ArrayLike, mapped: ArrayLike) -> RMSE:
    """Root mean squared affine-invariant distance between ellipsoids and what they should be.

    Parameters
    ----------
    truth, mapped : array_like, shape (n, d, d)
        SPD, in the same order; both with the same regularisation, else the distances mean nothing.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, the two are not equally many, or the mapped ellipsoids do not differ, so that
        there is no dispersion to divide by.

    See Also
    --------
    RMSE : what comes out.
    """
    wanted, found = as_pair(truth, mapped, "truth", "mapped", minimum=2)
    undivided = float(np.sqrt(np.mean(distance_unchecked(wanted, found) ** 2)))
    apart = distance_unchecked(mean(found), found)
    if np.max(apart) <= 1e-9:
        raise InvalidInputError(f"mapped has no dispersion to divide by: all {len(found)} ellipsoids are equal")
    return RMSE(undivided, float(undivided / np.mean(apart)), float(undivided / np.mean(apart**2)))


def as_pair(first: ArrayLike, other: ArrayLike, name: str, other_name: str, minimum: int) -> tuple[Array, Array]:
    """Check two sets of SPD matrices, both of shape (n, d, d), that belong together one by one."""
    a = as_points(first, name, minimum=minimum, copy=False)
    b = as_points(other, other_name, a.shape[-1], minimum=minimum, copy=False)
    if len(a) != len(b):
        raise InvalidInputError(f"{name} and {other_name} must be equally many; found {len(a)} and {len(b)}")
    return a, b


@dataclass(frozen=True)
class Smoothness:
    """Steps between consecutive ellipsoids (affine-invariant distances), mapped and of the teacher's own.

    Attributes
    ----------
    largest, median : float
        Of the mapped profile; the median is over the steps in which the teacher's profile moves.
    original_largest, original_median : float
        Of the teacher's own, over the same steps.

    See Also
    --------
    smoothness : makes it.
    """

    largest: float
    median: float
    original_largest: float
    original_median: float

    @property
    def largest_ratio(self) -> float:
        """Largest step over the teacher's own: 1 keeps it, a staircase is far above."""
        return self.largest / self.original_largest

    @property
    def median_ratio(self) -> float:
        """Median step over the teacher's own."""
        return self.median / self.original_median


@dataclass(frozen=True)
class Structure:
    """How the mapped ellipsoids lie to one another, and in space, compared with the teacher's.

    Attributes
    ----------
    spearman : float
        Rank correlation of the pairwise distances: 1 when near stays near and far stays far. Zero where all are
        mapped to one ellipsoid.
    distortion : float
        Median of abs(log(d_mapped / (s d_original))) over the pairs, s being the median ratio: 0 for an isometry
        up to scale; 0.1: half of the distances are off by more than 10 %. Infinite where most pairs collapse.
    major_turn, minor_turn : float or None
        Median angle between the original's and the mapped one's longest and shortest axes [degrees], from 0 to 90
        since axes have no sign. None where no ellipsoid has such an axis.
    major_left_out, minor_left_out : int
        How many ellipsoids have none, because the two largest or smallest eigenvalues nearly coincide in the
        original or the mapped one.
    major_moved : float or None
        Fraction of the ellipsoids with distinct longest axes in which that angle exceeds 10°.

    See Also
    --------
    structure : makes it.
    """

    spearman: float
    distortion: float
    major_turn: float | None
    minor_turn: float | None
    major_left_out: int
    minor_left_out: int
    major_moved: float | None = None


def moves(profile: Array) -> bool:
    """Whether ellipsoids (n, d, d) change at all; what compares motion does not apply otherwise."""
    return bool(np.max(distance_unchecked(profile[:1], profile)) > STILL)


def smoothness(mapped: ArrayLike, original: ArrayLike) -> Smoothness:
    """Compare the steps of a mapped profile with those of the teacher's own.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the order of time, n ≥ 2.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, sizes differ, or the original stands still.

    See Also
    --------
    Smoothness : what comes out.
    """
    images, own = as_pair(mapped, original, "mapped", "original", minimum=2)
    steps, own_steps = (distance_unchecked(points[:-1], points[1:]) for points in (images, own))
    moves = own_steps > STILL
    if not np.any(moves):
        raise InvalidInputError(f"original stands still: its {len(own)} ellipsoids are equal; steps compare motion")
    return Smoothness(
        float(np.max(steps)),
        float(np.median(steps[moves])),
        float(np.max(own_steps)),
        float(np.median(own_steps[moves])),
    )


def structure(mapped: ArrayLike, original: ArrayLike, most_points: int = MOST_POINTS) -> Structure:
    """Compare pairwise distances and principal axes of mapped ellipsoids with those of the teacher's.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the same order and the same frame, n ≥ 3.
    most_points : int
        Pairs are taken between at most this many ellipsoids, evenly over their order; axes of all.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a matrix is not SPD, sizes differ, or the original does not vary.

    See Also
    --------
    Structure : what comes out.
    """
    images, own = as_pair(mapped, original, "mapped", "original", minimum=3)
    limit = as_count(most_points, "most_points", minimum=3)
    chosen = evenly_spaced(len(own), limit)
    spearman, distortion = _distances_kept(*(_pairwise(points[chosen]) for points in (images, own)))
    major, minor = (axis_angles(images, own, which) for which in (-1, 0))
    return Structure(
        spearman,
        distortion,
        float(np.median(major)) if len(major) else None,
        float(np.median(minor)) if len(minor) else None,
        len(own) - len(major),
        len(own) - len(minor),
        float(np.mean(major > AXIS_MOVED)) if len(major) else None,
    )


def _pairwise(points: Array) -> Array:
    rows, columns = np.triu_indices(len(points), 1)
    return distance_unchecked(points[rows], points[columns])


def _distances_kept(mapped: Array, original: Array) -> tuple[float, float]:
    """Rank correlation and distortion of pairwise distances."""
    apart = original > STILL
    if np.ptp(original) <= STILL:
        raise InvalidInputError(
            f"original does not vary: all of its pairwise distances are {original[0]:.3g}; structure compares them"
        )
    rank = float(spearmanr(mapped, original).statistic) if np.ptp(mapped) > STILL else 0.0
    ratios = mapped[apart] / original[apart]
    scale = float(np.median(ratios))
    if scale <= STILL:
        return rank, float("inf")
    with np.errstate(divide="ignore"):
        return rank, float(np.median(np.abs(np.log(ratios / scale))))
