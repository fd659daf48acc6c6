"""Starts for clouds with many outliers: common ellipsoids look the same from a common ellipsoid.

Means and dispersions of such clouds are of no use. But a congruence changes no eigenvalue of A⁻¹ X. Seen from a common
ellipsoid A, each other common one has the same logarithms of eigenvalues of A⁻¹ X in both clouds, once the teacher's
cloud is dilated rightly. For several ratios of dispersion and teacher's ellipsoids A, the student's ellipsoids are
ranked by how many such spectra coincide. Each of the best pairs gives two centers, and with them rotations on which
many ellipsoids agree. The dilation is about the geometric median of the teacher's cloud: its place hardly matters.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import congruence, eigh, power_congruence, roots
from maniport.spd.matrix_functions import apply, from_vector, to_vector
from maniport.spd.mean import mean
from maniport.transfer.icp.algorithm import rotations_by_voting
from maniport.transfer.icp.pairs import Factors
from maniport.util.jit import kernel
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

RATIOS = (1.0, 0.87, 1.15, 0.75, 1.32)
"""Ratios of dispersion that are tried, by that of the median distances from the geometric medians.

With 30 % outliers on both sides the ratio of the medians is off by up to 25 %.
"""

LARGEST = 200  # ellipsoids of each cloud that are used

LARGEST_CLOUD = 800  # ellipsoids; of larger clouds too few common ones would be used

ANCHORS = 20  # of the teacher's ellipsoids

QUERIES = 50  # spectra of each anchor of the teacher that are compared

WIDTH = 0.3  # distance of spectra beyond which they do not coincide; 0.1 and 0.45 find fewer

RANKED = 32  # pairs of anchors that are followed

ROTATIONS = 2  # starts of each

FEWEST = 3  # matrices from which rotations are proposed


class Anchors(NamedTuple):
    """A teacher's and a student's ellipsoid that may be the same, by index, and the ratio of dispersion."""

    ratio: float
    teacher: int
    student: int


def congruent_starts(teacher: Array, student: Array) -> Iterator[Factors]:
    """Yield maps of clouds (n, d, d) and (m, d, d) on which many spectra agree, the best first; none of large ones."""
    if max(len(teacher), len(student)) > LARGEST_CLOUD:
        return
    teacher = teacher[evenly_spaced(len(teacher), LARGEST)]
    student = student[evenly_spaced(len(student), LARGEST)]
    center = geometric_median(teacher)
    whitening = roots(center)[1]
    spread_t = np.median(distance_unchecked(center, teacher))
    spread_s = np.median(distance_unchecked(geometric_median(student), student))

    ratio = float(spread_s / spread_t)
    dilated = {}
    for factor in RATIOS:
        dilated[ratio * factor] = power_congruence(
            whitening, teacher, ratio * factor, np.eye(len(center))
        )
    student_roots, student_whitenings = roots(student)
    for anchors in ranked_anchors(dilated, student):
        cloud = dilated[anchors.ratio]
        inverse_root = roots(cloud[anchors.teacher])[1]
        moved = definite(congruence(inverse_root, cloud))
        fixed = definite(congruence(student_whitenings[anchors.student], student))
        if min(len(moved), len(fixed)) < FEWEST:
            continue
        for rotation in rotations_by_voting(moved, fixed, ROTATIONS):
            right = student_roots[anchors.student] @ rotation @ inverse_root
            yield Factors(whitening, anchors.ratio, right)


def definite(matrices: Array) -> Array:
    """Return those of the matrices (n, d, d) that rounding leaves finite and positive-definite."""
    finite = matrices[np.isfinite(matrices).all(axis=(1, 2))]
    values = eigh(finite)[0]
    return np.asarray(finite[values[:, 0] > 0.0])


def ranked_anchors(dilated: dict[float, Array], student: Array) -> list[Anchors]:
    """Return pairs of anchors from which many spectra coincide, by their number, at most `RANKED`.

    Parameters
    ----------
    dilated : dict of ndarray, shapes (n, d, d)
        The teacher's cloud, by ratio of dispersion.
    student : ndarray, shape (m, d, d)
    """
    spectra_s = spectra(student, student)
    candidates = []
    scores = []
    for ratio, cloud in dilated.items():
        chosen = evenly_spaced(len(cloud), ANCHORS)
        compared = evenly_spaced(len(cloud), QUERIES)
        spectra_t = spectra(cloud[chosen], cloud[compared])
        coincident = np.empty((len(chosen), len(student)))
        _fill_coincident(spectra_t, np.swapaxes(spectra_s, 1, 2).copy(), WIDTH, coincident)
        for row, place in enumerate(chosen):
            for column in np.argsort(-coincident[row], kind="stable")[:RANKED]:
                candidates.append(Anchors(ratio, int(place), int(column)))
                scores.append(coincident[row, column])
    order = np.argsort(-np.array(scores), kind="stable")[:RANKED]
    return [candidates[place] for place in order]


def spectra(anchors: Array, points: Array) -> Array:
    """Logarithms of the eigenvalues of A⁻¹ X, ascending, for anchors (k, d, d) and points (n, d, d); (k, n, d)."""
    whitenings = roots(anchors)[1]
    values, _ = eigh(congruence(whitenings[:, None], points))
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(values)
    return np.nan_to_num(logs, nan=1e3, posinf=1e3, neginf=-1e3).astype(np.float32)


def geometric_median(points: Array, tol: float = 1e-3, max_iter: int = 50) -> Array:
    """Point with the least sum of distances to SPD matrices (n, d, d), by Weiszfeld's method.

    References
    ----------
    Fletcher, Venkatasubramanian and Joshi, The geometric median on Riemannian manifolds with application to robust
    atlas estimation, NeuroImage 45, 2009.
    """
    center = mean(points, tol=tol)
    for _ in range(max_iter):
        root, whitening = roots(center)
        vectors = to_vector(apply(congruence(whitening, points), np.log))
        weights = 1.0 / np.maximum(np.linalg.norm(vectors, axis=1), 1e-9)
        step = weights @ vectors / weights.sum()
        center = congruence(root, apply(from_vector(step), np.exp))
        if np.linalg.norm(step) < tol:
            break
    return center


@kernel(fastmath=True)
def _fill_coincident(
    queries: NDArray[np.float32],
    spectra: NDArray[np.float32],
    width: float,
    coincident: Array,
) -> None:
    """Fill Σ max(0, 1 − (r / width)²), r from each query to the nearest spectrum; (a, q, d), (m, d, k), (a, m)."""
    anchors, count, size = queries.shape
    squares = np.empty(spectra.shape[2], np.float32)
    for column in range(len(spectra)):
        for row in range(anchors):
            total = 0.0
            for i in range(count):
                squares[:] = 0.0
                for x in range(size):
                    value = queries[row, i, x]
                    for j in range(len(squares)):
                        squares[j] += (spectra[column, x, j] - value) ** 2
                least = squares[0]
                for j in range(len(squares)):
                    least = min(least, squares[j])
                total += max(0.0, 1.0 - least / width**2)
            coincident[row, column] = total
