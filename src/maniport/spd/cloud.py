"""Comparing two clouds of SPD matrices as distributions."""

from scipy.spatial.distance import cdist

from maniport.spd.kernels import congruence
from maniport.spd.matrix_functions import logarithm, roots, to_vector
from maniport.util.validation import Array


def log_vectors(points: Array, center: Array) -> Array:
    """Mandel vectors of log(C^-½ X C^-½), shape (n, d (d + 1) / 2); input unchecked."""
    return to_vector(logarithm(congruence(roots(center)[1], points)))


def energy_between(x: Array, y: Array, within_y: float | None = None) -> float:
    """Energy distance 2 E|x − y| − E|x − x'| − E|y − y'| of vectors (n, k) and (m, k); `within_y` is the last term."""
    within = mean_distance(y) if within_y is None else within_y
    # the expression is not negative, but its three sums round differently
    return max(0.0, 2.0 * mean_distance(x, y) - mean_distance(x) - within)


def mean_distance(x: Array, y: Array | None = None) -> float:
    """Mean Euclidean distance from all of `x` (n, k) to all of `y` (m, k), or among all of `x`, itself included."""
    other = x if y is None else y
    rows = max(1, 250_000 // len(other))  # larger arrays leave the processor's cache
    total = 0.0
    for start in range(0, len(x), rows):
        part = x[start : start + rows]
        if y is None:  # symmetric: only what lies on and after the diagonal block
            total += float(cdist(part, part).sum()) + 2.0 * float(cdist(part, x[start + rows :]).sum())
        else:
            total += float(cdist(part, other).sum())
    return total / (len(x) * len(other))
