"""Metrics of mapped ellipsoids, and the comparison of methods by them.

The functions take SPD matrices with the same regularization on both sides; distances at different ones are not
comparable. They raise `NotSPDError` when a matrix is not SPD, and `InvalidInputError` when the counts differ or there
is no motion or dispersion to compare.

Without a known truth, a method is recommended by the criterion of `maniport.evaluation.select_method`, which depends on
the domains and the robot and not on the profile: a length field that passes its checks, else the first of parallel
transport, scaled transport and the evaluated adapter whose `domain_distance` no other undercuts by more than 5 %. The
adapter takes part if it has no weakness. Identity and mean transport are baselines only: the first ignores the domains,
and the second is not equivariant, so that its result depends on the frame. Where the truth is known, the root mean
squared error decides alone, and the first in the order of `maniport.transfer.METHODS` within 5 % is recommended.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.kernels import congruence, roots
from maniport.spd.matrix_functions import logarithm, to_vector
from maniport.spd.mean import mean
from maniport.transfer import METHODS
from maniport.transfer.length_field.fit import AXIS_MOVED, MIN_RANK_CORRELATION
from maniport.util.notebook import NotebookDisplay
from maniport.util.sampling import evenly_spaced, rank_correlation
from maniport.util.validation import Array, as_count, as_points

STILL = 1e-9  # Largest distance that counts as rounding
TRANSPORTS = (
    "parallel-transport",
    "scaled-transport",
)  # The rigid maps in closed form that fit the domains, the one of fewer parameters first
BASELINES = ("identity", "mean-transport", *TRANSPORTS)  # The default baselines
NEVER_RECOMMENDED = ("identity", "mean-transport", "nearest-neighbor")  # Without a known truth
RELEVANT_RATIO = 0.95  # A value must fall below this fraction of another to count as better
MAX_STEP_RATIO = 1.5
MOST_OF_DOMAIN = 2048  # Most ellipsoids of a domain whose pairwise distances are computed


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
        raise InvalidInputError(
            f"mapped has no dispersion to divide by: all {len(images)} ellipsoids are equal"
        )
    return RMSE(
        undivided, float(undivided / np.mean(deviations)), float(undivided / np.mean(deviations**2))
    )


def step_ratio(mapped: ArrayLike, original: ArrayLike) -> float:
    """Compute the largest distance of consecutive ellipsoids of a mapped profile over that of the teacher's.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the order of time, n ≥ 2.

    Returns
    -------
    float
    """
    images, originals = _as_pair(mapped, original, "mapped", "original", minimum=2)
    step = _largest_step(images)
    original_step = _largest_step(originals)
    if original_step <= STILL:
        raise InvalidInputError(
            f"original does not move: its {len(originals)} ellipsoids are equal"
        )
    return step / original_step


def _largest_step(profile: Array) -> float:
    """Return the largest distance of consecutive ellipsoids (n, d, d)."""
    return float(distance_unchecked(profile[:-1], profile[1:]).max())


def distance_preservation(
    mapped: ArrayLike, original: ArrayLike, most_points: int = 500
) -> DistancePreservation:
    """Compare pairwise distances and longest axes of mapped ellipsoids with those of the teacher's.

    Parameters
    ----------
    mapped, original : array_like, shape (n, d, d)
        SPD, in the same order and the same frame, n ≥ 3.
    most_points : int
        Pairs are taken between at most this many ellipsoids, evenly over their order; axes of all.
    """
    images, originals = _as_pair(mapped, original, "mapped", "original", minimum=3)
    chosen = evenly_spaced(len(originals), as_count(most_points, "most_points", minimum=3))
    first, second = np.triu_indices(len(chosen), 1)
    first = chosen[first]
    second = chosen[second]
    distances = distance_unchecked(images[first], images[second])
    original_distances = distance_unchecked(originals[first], originals[second])
    if np.ptp(original_distances) <= STILL:
        raise InvalidInputError(
            f"original does not vary: all of its pairwise distances are {original_distances[0]:.3g}"
        )
    rank = 0.0
    if np.ptp(distances) > STILL:
        rank = rank_correlation(distances, original_distances)
    angles = axis_angles(images, originals, -1)
    if not len(angles):
        return DistancePreservation(rank)
    return DistancePreservation(rank, float(np.median(angles)))


def domain_distance(mapped: ArrayLike, student: ArrayLike) -> float:
    """Compute the energy distance between a mapped domain and the student's, of log-vectors about the latter's mean.

    It is 2 E(x, y) − E(x, x') − E(y, y') with mean distances E, zero for equal domains. Domains need no pairs and may
    differ in size; the same subset of at most 2048 ellipsoids of each is taken for every map.

    Parameters
    ----------
    mapped, student : array_like, shapes (n, d, d) and (m, d, d)
        SPD.

    Returns
    -------
    float
    """
    images = subset_of_domain(as_points(mapped, "mapped", copy=False))
    points = subset_of_domain(as_points(student, "student", images.shape[-1], copy=False))
    whitening = roots(mean(points))[1]
    image_vectors = to_vector(logarithm(congruence(whitening, images)))
    vectors = to_vector(logarithm(congruence(whitening, points)))
    between = cdist(image_vectors, vectors).mean()
    within = cdist(image_vectors, image_vectors).mean() + cdist(vectors, vectors).mean()
    return float(2.0 * between - within)


def subset_of_domain(points: Array) -> Array:
    """Return all ellipsoids (n, d, d), or 2048 random ones, the same for all domains of this size."""
    if len(points) <= MOST_OF_DOMAIN:
        return points
    order = np.random.default_rng(0).permutation(len(points))
    return points[order[:MOST_OF_DOMAIN]]


def first_of_least(values: Mapping[str, float]) -> str:
    """Return the first name whose value no other undercuts by more than 5 %; empty where there is none."""
    least = min(values.values(), default=0.0)
    for name, value in values.items():
        if RELEVANT_RATIO * value <= least:
            return name
    return ""


def _as_pair(
    first: ArrayLike, other: ArrayLike, name: str, other_name: str, minimum: int
) -> tuple[Array, Array]:
    """Check two sets of SPD matrices (n, d, d) that belong together one by one."""
    a = as_points(first, name, minimum=minimum, copy=False)
    b = as_points(other, other_name, a.shape[-1], minimum=minimum, copy=False)
    if len(a) != len(b):
        raise InvalidInputError(
            f"{name} and {other_name} must be equally many; found {len(a)} and {len(b)}"
        )
    return a, b


@dataclass(frozen=True)
class Gaps:
    """Statistics of distances to the feasible set.

    Methods are compared by the mean: where half of a profile is feasible, the median is zero for all of them.

    Attributes
    ----------
    mean, p95, largest : float
    """

    mean: float
    p95: float
    largest: float

    @classmethod
    def of(cls, distances: Array) -> "Gaps":
        """Summarize distances, shape (n,)."""
        return cls(
            *map(float, (np.mean(distances), np.percentile(distances, 95), np.max(distances)))
        )


@dataclass(frozen=True)
class Row:
    """The metrics of one method; None where a metric does not apply.

    Attributes
    ----------
    name : str
        As in `maniport.transfer.METHODS`, or the class of the method.
    note : str
        A remark.
    rmse : RMSE or None
        Where the truth is known.
    domain_distance : float or None
        Of the mapped domain of the teacher from the student's, see `domain_distance`.
    feasibility_gap : Gaps or None
        Of the profile; None without the student's kinematics.
    step_ratio : float or None
    preservation : DistancePreservation or None
        None where the teacher's ellipsoids do not change.
    failures : tuple of str
        Checks that the fit of a length field fails, see `FieldReport.failures`.
    warnings : tuple of str
        Warnings of its fits, each once.
    """

    name: str
    note: str = ""
    rmse: RMSE | None = None
    domain_distance: float | None = None
    feasibility_gap: Gaps | None = None
    step_ratio: float | None = None
    preservation: DistancePreservation | None = None
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def weaknesses(self) -> dict[str, float]:
        """Metrics beyond their limits, whatever the gaps.

        They are "large_step" (largest step over the teacher's), "rank_correlation" (of distances) and "rotated_axes"
        (of the longest axes [degrees]).
        """
        ratio = self.step_ratio or 0.0
        kept = self.preservation
        if kept is None:
            rank = 1.0
            angle = 0.0
        else:
            rank = kept.rank_correlation
            angle = kept.major_axis_angle or 0.0
        metrics = {
            "large_step": (ratio, ratio > MAX_STEP_RATIO),
            "rank_correlation": (rank, rank < MIN_RANK_CORRELATION),
            "rotated_axes": (angle, angle > AXIS_MOVED),
        }
        return {name: value for name, (value, weak) in metrics.items() if weak}


@dataclass(frozen=True)
class Evaluation(NotebookDisplay):
    """All metrics of an adapter and of the baselines.

    Attributes
    ----------
    rows : tuple of Row
        The adapter first, then the baselines.
    settings : dict
        Sizes, regularization, seed, and the source of samples; ready for JSON.
    rejected : tuple of str or None
        Of a method that was selected: why the length field was not, empty where it was; else None.
    """

    rows: tuple[Row, ...]
    settings: dict[str, str | int] = field(default_factory=dict)
    rejected: tuple[str, ...] | None = None

    def __repr__(self) -> str:
        if self.recommended:
            recommended = f"; recommended: {self.recommended!r}"
        else:
            recommended = ""
        return f"Evaluation({self.adapter.name!r} and {len(self.rows) - 1} baselines{recommended})"

    @property
    def adapter(self) -> Row:
        """The row of the adapter that was evaluated."""
        return self.rows[0]

    @property
    def measure(self) -> str:
        """Measure of the comparison: "rmse" with a ground truth, else "feasibility_gap" (mean), "" without a robot."""
        if self.adapter.rmse is not None:
            return "rmse"
        if self.adapter.feasibility_gap is not None:
            return "feasibility_gap"
        return ""

    @property
    def values(self) -> dict[str, float]:
        """The measure of every row that is compared, the adapter's first.

        A lookup of samples is compared only where the truth is known, since its gaps are zero by construction.
        """
        if self.measure == "rmse":
            return {row.name: row.rmse.undivided for row in self.rows if row.rmse is not None}
        values = {}
        for row in self.rows:
            is_compared = row is self.adapter or row.name != "nearest-neighbor"
            if is_compared and row.feasibility_gap is not None:
                values[row.name] = row.feasibility_gap.mean
        return values

    @property
    def recommended(self) -> str:
        """Recommended method; empty where nothing is compared. The criterion is that of this module."""
        if self.measure == "rmse":
            return self._most_accurate()

        for row in self.rows:
            if row.name == "length-field" and not row.failures:
                return row.name
        distances = {}
        for row in self._candidates() or self.rows:
            if row.domain_distance is not None and row.name != "nearest-neighbor":
                distances[row.name] = row.domain_distance
        return first_of_least(distances)

    def _candidates(self) -> list[Row]:
        """Return the transports in their order, then the adapter if it has no weakness."""
        candidates = []
        for name in TRANSPORTS:
            candidates += [row for row in self.rows if row.name == name]
        adapter = self.adapter
        is_other = adapter.name not in (*TRANSPORTS, *NEVER_RECOMMENDED)
        if is_other and not (adapter.weaknesses or adapter.failures):
            candidates.append(adapter)
        return candidates

    def _most_accurate(self) -> str:
        """Return the first method, in the order of `METHODS`, whose error no other undercuts by more than 5 %."""
        errors = self.values
        ordered = {}
        for name in (*METHODS, self.adapter.name):
            if name in errors:
                ordered[name] = errors[name]
        return first_of_least(ordered)
