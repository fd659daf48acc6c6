"""Comparing two clouds of SPD matrices as distributions."""

from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from maniport.errors import InvalidInputError
from maniport.spd.kernels import congruence
from maniport.spd.matrix_functions import logarithm, roots, to_vector
from maniport.spd.mean import mean
from maniport.validation import Array, as_points, as_spd

BLOCK_BYTES = 2_000_000
"""Size of the largest array of distances; larger ones leave the processor's cache and are slower."""


def energy_distance(a: ArrayLike, b: ArrayLike, center: ArrayLike | None = None) -> float:
    """Energy distance 2 E|x − y| − E|x − x'| − E|y − y'| of two clouds, between their log-vectors about one centre.

    Székely & Rizzo, Energy statistics: a class of statistics based on distances, Journal of Statistical Planning and
    Inference 143, 2013, eq. 2.5 as a V-statistic. Not negative, and zero only where the two clouds are equal; it
    needs no pairs and sees place, spread and shape at once.

    Parameters
    ----------
    a, b : array_like, shapes (n, d, d) and (m, d, d)
        SPD. Sizes may differ.
    center : array_like, shape (d, d), optional
        C, about which both clouds are mapped to the Mandel vectors of log(C^-½ X C^-½). Default: the Fréchet mean
        of `b`, the cloud that `a` is compared with. Values with different centres are not comparable.

    Returns
    -------
    float
        Dimensionless, of the order of a distance. For a small shift of one cloud it grows with the shift's square.

    Raises
    ------
    NotSPDError, InvalidInputError
        When a cloud or the centre is not SPD, a cloud is empty, or sizes differ.

    Notes
    -----
    The affine-invariant distance itself would not do: for d ≥ 3 it is not of negative type, since SL(d, R) has
    Kazhdan's property (T) and admits no unbounded function of that type (Delorme-Guichardet theorem; Bekka, de la
    Harpe & Valette, Kazhdan's Property (T), 2008, ch. 2). The expression could then be negative, or zero for different
    clouds. Euclidean distances are of strictly negative type, and log-vectors about one centre keep the distances to
    it. The value does not change under an isometry X → G X Gᵀ of both clouds and the centre.
    """
    first = as_points(a, "a", minimum=1, copy=False)
    other = as_points(b, "b", first.shape[-1], minimum=1, copy=False)
    if center is None:
        middle = mean(other)
    else:
        middle = as_spd(center, "center", first.shape[-1])
        if middle.ndim != 2:
            raise InvalidInputError(f"center must be one matrix, shape (d, d); found shape {middle.shape}")
    return energy_between(log_vectors(first, middle), log_vectors(other, middle))


def log_vectors(points: Array, center: Array) -> Array:
    """Mandel vectors of log(C^-½ X C^-½), shape (n, d (d + 1) / 2); input unchecked.

    Their lengths are the distances to the centre; distances between them never exceed those between the points
    (Bhatia 2007, eq. 6.13).
    """
    return to_vector(logarithm(congruence(roots(center)[1], points)))


def energy_between(x: Array, y: Array, within_y: float | None = None) -> float:
    """Energy distance of two sets of vectors (n, k) and (m, k); `within_y` is E|y − y'| where it is known already."""
    within = mean_distance(y) if within_y is None else within_y
    # the expression is not negative, but its three sums round differently
    return max(0.0, 2.0 * mean_distance(x, y) - mean_distance(x) - within)


def mean_distance(x: Array, y: Array | None = None) -> float:
    """Mean Euclidean distance from all of `x` (n, k) to all of `y` (m, k), or among all of `x`, itself included."""
    other = x if y is None else y
    rows = max(1, BLOCK_BYTES // (8 * len(other)))
    total = 0.0
    for start in range(0, len(x), rows):
        part = x[start : start + rows]
        if y is None:  # symmetric: only what lies on and after the diagonal block
            total += float(cdist(part, part).sum()) + 2.0 * float(cdist(part, x[start + rows :]).sum())
        else:
            total += float(cdist(part, other).sum())
    return total / (len(x) * len(other))
