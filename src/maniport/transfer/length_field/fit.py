"""The fit of a length field, and the report of its effect on samples that were held out of it.

The fit repeats: find the nearest feasible ellipsoids to the images, rescale toward them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import NeighborIndex, distance_unchecked
from maniport.spd.ellipsoid import axis_angles
from maniport.spd.kernels import compose, congruence, symmetrize
from maniport.spd.matrix_functions import apply, logarithm, to_vector
from maniport.transfer.length_field.field import (
    NEAR_SINGULAR,
    LengthsMap,
    axiswise,
    least_singular,
    powers,
)
from maniport.util.sampling import rank_correlation
from maniport.util.validation import Array, as_finite, as_points, require_shape

Projector = Callable[[Array], ArrayLike]
"""Takes ellipsoids with the student's damping, shape (n, d, d), and returns the nearest feasible ones with it.

An attribute `axis` is a direction (3,) in the student's frame about which every feasible ellipsoid may be turned. An
attribute `damping`, relative to the mean eigenvalue of a domain, is the field's default.

A projector that also returns derivatives along the student's joints is faster, and its fit is better:
`projector.search(damping)` begins a search among ellipsoids that carry this damping ε [unit of M], and
`search.nearest(points, neighbors)` returns the nearest ellipsoids M (n, d, d) to points A, and the derivatives of
log(A^-½ M A^-½), (n, k, d, d).
"""

TIE = 1e-6
"""Difference of logarithms, and of their squared distances, up to which samples are equally suited. It is far above
rounding (1e-13), so that rounding does not choose between the mirror images in a symmetric domain."""


class NearestSamples:
    """The projector without a model of the student: the nearest of its samples, damped, shape (m, d, d)."""

    def __init__(self, student: Array):
        self._index = NeighborIndex(student)

    def __call__(self, points: Array) -> Array:
        """Return the nearest sample to each point."""
        return np.asarray(self._index.points[self._index.query(points)[0]])


class Samples:
    """The teacher's samples (n, d, d) that a field is fitted to or measured at."""

    def __init__(
        self,
        field: LengthsMap,
        points: Array,
        projector: Projector,
        damping: float,
        neighbors: int = 3,
    ):
        self.points = points
        self.values, self.vectors = field.base(points)
        self.x = to_vector(compose(self.values, self.vectors))
        self._projector = projector
        self._search = None
        self._neighbors = None
        if hasattr(projector, "search"):
            self._search = projector.search(damping)
            if len(points) > neighbors:
                self._neighbors = np.asarray(
                    cKDTree(self.x).query(self.x, k=[*range(2, neighbors + 2)])[1], np.intp
                )

    def projected(self, images: Array) -> tuple[Array, Array | None]:
        """Return the ellipsoids (n, d, d) nearest to the images, and derivatives (n, k, d, d) or None."""
        result: ArrayLike
        changes: Array | None = None
        if self._search is None:
            result = self._projector(images.copy())
        else:
            name = "the second of projector.search(damping).nearest(points)"
            result, changes = self._search.nearest(images, self._neighbors)
            changes = symmetrize(as_finite(changes, name))
            require_shape(changes, name, (len(images), "k", *images.shape[1:]))
        array = as_finite(result, "projector(points)")
        require_shape(array, "projector(points)", images.shape, ", as the points")
        nearest = as_points(array, "projector(points)", minimum=1)
        few = isinstance(self._projector, NearestSamples)  # one sample may be the nearest to all
        if not few and _all_equal(nearest) and not _all_equal(images):
            raise InvalidInputError(
                f"projector(points) is the same ellipsoid for all {len(images)} points; it must be the nearest to each"
            )
        return nearest, changes


def _all_equal(points: Array) -> bool:
    return bool(np.abs(points - points[0]).max() <= 1e-12 * np.abs(points[0]).max())


def fitted(
    base: LengthsMap, samples: Samples, ridge: float, rounds: int
) -> tuple[LengthsMap, list[float]]:
    """Fit a field with centers in rounds; return it and the mean distance to the feasible set before and after each."""
    field = base
    history = list[float]()
    near = field.kernel(samples.x)
    among = field.kernel(field.centers)
    for number in range(rounds + 1):
        images = field.apply(samples.points)
        nearest, changes = samples.projected(images)
        history.append(float(np.mean(distance_unchecked(images, nearest))))
        if number < rounds:
            whitening = apply(images, lambda values: 1.0 / np.sqrt(values))
            difference = logarithm(congruence(whitening, nearest))
            error = congruence(np.swapaxes(samples.vectors, -1, -2), difference)
            if number == 0:
                changes = None
            lengths = _lengths(field.lengths, samples, near, among, error, changes, ridge)
            field = replace(field, lengths=lengths)
    return field, history


def _lengths(
    lengths: Array,
    samples: Samples,
    near: Array,
    among: Array,
    error: Array,
    changes: Array | None,
    ridge: float,
) -> Array:
    """Coefficients (m, 3) of (39) and (40), from kernel values `near` (n, m) and `among` (m, m) of the centers."""
    n, d = samples.values.shape
    t = powers(samples.values)
    vector = to_vector(error)
    m = near.shape[1]
    rank = t.shape[2]
    wanted = axiswise(near @ lengths, t) + vector[:, :d]
    weights = np.broadcast_to(np.eye(d), (n, d, d))
    pull = wanted
    if changes is not None:
        frames = np.swapaxes(samples.vectors, -1, -2)
        moves = np.swapaxes(to_vector(congruence(frames[:, None], changes)), 1, 2)
        residual = _unreachable(moves)
        alpha = 0.1  # cost of an error that motion of the joints removes
        weights = residual[:, :d, :d] + alpha * np.eye(d)
        of_lengths = (weights @ wanted[..., None])[..., 0]
        of_axes = (residual[:, :d, d:] @ vector[:, d:, None])[..., 0]
        pull = of_lengths + of_axes
    mixed = np.swapaxes(t, 1, 2) @ weights @ t  # (n, 3, 3)
    normal = np.empty((rank, m, rank, m))
    for r in range(rank):
        for s in range(r, rank):
            normal[r, :, s] = near.T @ (mixed[:, r, s, None] * near)
            normal[s, :, r] = normal[r, :, s]
        normal[r, :, r] += ridge * n * (among + 1e-8 * np.eye(m))
    right = np.einsum("nir,ni->rn", t, pull) @ near
    coefficients = cho_solve(cho_factor(normal.reshape(rank * m, rank * m)), right.ravel())
    return np.ascontiguousarray(coefficients.reshape(rank, m).T)


def _unreachable(moves: Array, gamma: float = 0.05) -> Array:
    """N = I − J (JᵀJ + γ I)⁻¹ Jᵀ, shape (n, D, D), of the changes along the joints J (n, D, k): the rest."""
    inner = np.swapaxes(moves, 1, 2) @ moves + gamma * np.eye(moves.shape[2])
    return np.asarray(
        np.eye(moves.shape[1]) - moves @ np.linalg.solve(inner, np.swapaxes(moves, 1, 2))
    )


def centers_among(x: Array, count: int) -> NDArray[np.intp]:
    """Return indices of `count` vectors (n, D): the nearest to the mean, then always the farthest."""

    def squares(center: Array) -> Array:
        """Squared distances from a vector (D,)."""
        return np.asarray(np.sum((x - center) ** 2, axis=1))

    from_mean = squares(x.mean(axis=0))
    first = int(np.argmax(from_mean <= from_mean.min() + TIE))
    chosen = [first]
    from_centers = squares(x[first])
    while len(chosen) < count:
        farthest = int(np.argmax(from_centers >= from_centers.max() - TIE))
        chosen.append(farthest)
        from_centers = np.minimum(from_centers, squares(x[farthest]))
    return np.array(chosen, dtype=np.intp)


AXIS_MOVED = 10.0  # Angle between the longest axes of an ellipsoid and its image that counts as moved [degrees]

# Limits of `FieldReport.failures`, from fits to 13 arms for 3 persons each (table in docs/evaluation.md). The 18 good
# fits (Panda, xArm7, Tiago, Talos, G1 with seven joints, Jaco) have at most 0.07, 0.017 and 0.02, and a rank
# correlation of at least 0.92. The other 21 (UR5, Z1, IRB140, SO-100, iCub, G1 with four or five joints) exceed 0.11
# and 0.037.
MAX_SHARES = {
    "reversing": (0.1, "orientation-reversing at"),
    "nonmonotone": (0.03, "own-axis slope not positive at"),
    "moved_axes": (0.05, f"longest axis moved by more than {AXIS_MOVED:g}° at"),
}
MIN_RANK_CORRELATION = 0.8


@dataclass(frozen=True)
class FieldReport:
    """Effect of a length field on the teacher's samples that were held out of the fit."""

    # number of samples held out; zero where the values are those at samples of the fit
    held_out: int
    gap: float  # distance from their images to the nearest feasible ellipsoids, mean
    gap_p95: float  # and 95th percentile
    # rank correlation of all distances between images and between the samples
    rank_correlation: float
    near_singular: float  # fraction of the samples where the map folds, or nearly so
    moved_axes: float  # fraction whose longest axis is more than 10° from the image's; 0 where none is distinct
    reversing: float  # fraction where the determinant of the map's derivative is negative
    nonmonotone: float  # fraction where lengthening an axis shortens the image's

    def failures(self) -> tuple[str, ...]:
        """Return the checks that the map fails, with value and limit; empty where it may be used."""
        shares = ((getattr(self, name), limit, text) for name, (limit, text) in MAX_SHARES.items())
        failed = []
        for share, limit, text in shares:
            if share > limit:
                failed.append(f"{text} {100 * share:.0f} % (limit {100 * limit:.0f} %)")
        if self.rank_correlation < MIN_RANK_CORRELATION:
            failed.append(
                f"rank correlation of distances {self.rank_correlation:.2f} (limit {MIN_RANK_CORRELATION:g})"
            )
        return tuple(failed)

    def in_words(self) -> str:
        """Return it as one line."""
        if self.held_out:
            where = f"at {self.held_out} held-out samples"
        else:
            where = "at the samples of the fit"
        shares = ", ".join(
            f"{text} {100 * getattr(self, name):.0f} %" for name, (_, text) in MAX_SHARES.items()
        )
        return (
            f"{where}: gap {self.gap:.3f} (95 % below {self.gap_p95:.3f}), rank correlation "
            f"{self.rank_correlation:.3f}, {shares}, folds at {100 * self.near_singular:.1f} %"
        )


def reported(field: LengthsMap, samples: Samples, held_out: int) -> FieldReport:
    """Measure a field at samples."""
    points = samples.points
    images = field.apply(samples.points)
    for _ in range(2):  # the second search also starts from what was found for neighbors
        nearest, _ = samples.projected(images)
    gaps = distance_unchecked(images, nearest)
    first, other = np.triu_indices(len(points), 1)
    between_images = distance_unchecked(images[first], images[other])
    between_samples = distance_unchecked(points[first], points[other])
    varied = min(np.ptp(between_images), np.ptp(between_samples)) > 0.0
    slopes = field.slopes(samples.values, samples.vectors)
    singular = least_singular(slopes)
    moved = axis_angles(images, points, -1)
    # vec v vᵀ for axes v, (n, d, D)
    along = to_vector(np.einsum("nik,njk->nkij", samples.vectors, samples.vectors))
    growth = np.einsum("nki,nij,nkj->nk", along, slopes, along).min(axis=1)
    correlation = 1.0
    if varied:
        correlation = rank_correlation(between_images, between_samples)
    return FieldReport(
        held_out=held_out,
        gap=float(gaps.mean()),
        gap_p95=float(np.percentile(gaps, 95)),
        rank_correlation=correlation,
        near_singular=float(np.mean(singular <= NEAR_SINGULAR)),
        moved_axes=float(np.mean(moved > AXIS_MOVED)) if len(moved) else 0.0,
        reversing=float(np.mean(singular < 0.0)),
        nonmonotone=float(np.mean(growth <= 0.0)),
    )
