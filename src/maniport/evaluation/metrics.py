"""Metrics of mapped ellipsoids: error, successive distance and distance preservation.

All take SPD matrices with the same regularization on both sides; distances at different ones are not comparable. They
raise `NotSPDError` when a matrix is not SPD, and `InvalidInputError` when the counts differ or there is no motion or
dispersion to compare.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.mean import mean
from maniport.util.sampling import evenly_spaced, rank_correlation
from maniport.util.validation import Array, as_count, as_points

STILL = 1e-9  # Largest distance that counts as rounding


def statistics_of(values: ArrayLike, time: ArrayLike | None = None) -> dict[str, Any]:
    """Return median, 95th percentile and maximum of values with its time [s] or index; nan is ignored."""
    array = np.asarray(values, dtype=float)
    index = int(np.nanargmax(array))
    where = {"max_at": index} if time is None else {"max_at_s": float(np.asarray(time)[index])}
    median, p95 = np.nanpercentile(array, [50.0, 95.0]).tolist()
    return {"median": median, "p95": p95, "max": float(array[index]), **where}


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
    """

    undivided: float
    per_dispersion: float
    per_squared_dispersion: float


@dataclass(frozen=True)
class Smoothness:
    """Affine-invariant distances between consecutive ellipsoids, mapped and of the teacher.

    Attributes
    ----------
    largest, median : float
        Of the mapped profile; the median is over the steps in which the teacher's profile moves.
    largest_ratio, median_ratio : float
        The same over those of the teacher's profile.
    """

    largest: float
    median: float
    largest_ratio: float
    median_ratio: float


@dataclass(frozen=True)
class DistancePreservation:
    """Pairwise distances and longest axes of mapped ellipsoids, compared with the teacher's.

    Attributes
    ----------
    rank_correlation : float
        Rank correlation of the pairwise distances; zero where all are mapped to one ellipsoid.
    major_axis_angle : float or None
        Median angle between the longest axes of both [degrees]. None where no axis is distinct.
    """

    rank_correlation: float
    major_axis_angle: float | None = None


def rmse(truth: ArrayLike, mapped: ArrayLike) -> RMSE:
    """Compute the root mean squared affine-invariant distance between ellipsoids and their truth.

    Parameters
    ----------
    truth, mapped : array_like, shape (n, d, d)
        SPD, in the same order, n ≥ 2.
    """
    wanted, images = _as_pair(truth, mapped, "truth", "mapped", minimum=2)
    undivided = float(np.sqrt(np.mean(distance_unchecked(wanted, images) ** 2)))
    deviations = distance_unchecked(mean(images), images)
    if np.max(deviations) <= STILL:
        raise InvalidInputError(f"mapped has no dispersion to divide by: all {len(images)} ellipsoids are equal")
    return RMSE(undivided, float(undivided / np.mean(deviations)), float(undivided / np.mean(deviations**2)))


def smoothness(mapped: ArrayLike, original: ArrayLike) -> Smoothness:
    """Compare the steps of a mapped profile with those of the teacher's.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the order of time, n ≥ 2.
    """
    images, own = _as_pair(mapped, original, "mapped", "original", minimum=2)
    steps, own_steps = (distance_unchecked(points[:-1], points[1:]) for points in (images, own))
    moving = own_steps > STILL
    if not np.any(moving):
        raise InvalidInputError(f"original does not move: its {len(own)} ellipsoids are equal")
    largest, median = float(np.max(steps)), float(np.median(steps[moving]))
    return Smoothness(largest, median, largest / float(np.max(own_steps)), median / float(np.median(own_steps[moving])))


def distance_preservation(mapped: ArrayLike, original: ArrayLike, most_points: int = 500) -> DistancePreservation:
    """Compare pairwise distances and longest axes of mapped ellipsoids with those of the teacher's.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the same order and the same frame, n ≥ 3.
    most_points : int
        Pairs are taken between at most this many ellipsoids, evenly over their order; axes of all.
    """
    images, own = _as_pair(mapped, original, "mapped", "original", minimum=3)
    chosen = evenly_spaced(len(own), as_count(most_points, "most_points", minimum=3))
    first, second = np.triu_indices(len(chosen), 1)
    apart, own_apart = (distance_unchecked(points[chosen[first]], points[chosen[second]]) for points in (images, own))
    if np.ptp(own_apart) <= STILL:
        raise InvalidInputError(f"original does not vary: all of its pairwise distances are {own_apart[0]:.3g}")
    rank = rank_correlation(apart, own_apart) if np.ptp(apart) > STILL else 0.0
    angles = axis_angles(images, own, -1)
    return DistancePreservation(rank, float(np.median(angles)) if len(angles) else None)


def _as_pair(first: ArrayLike, other: ArrayLike, name: str, other_name: str, minimum: int) -> tuple[Array, Array]:
    """Check two sets of SPD matrices (n, d, d) that belong together one by one."""
    a = as_points(first, name, minimum=minimum, copy=False)
    b = as_points(other, other_name, a.shape[-1], minimum=minimum, copy=False)
    if len(a) != len(b):
        raise InvalidInputError(f"{name} and {other_name} must be equally many; found {len(a)} and {len(b)}")
    return a, b
