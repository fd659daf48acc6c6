"""Taking the damping off images of maps that are not rigid, so that they stay positive-definite wherever they lie."""

import numpy as np

from maniport.spd.kernels import compose, eigh
from maniport.transfer.lengths.field import KAPPA
from maniport.validation import Array


def released(points: Array, epsilon: float) -> Array:
    """Solve z = y (y + ε) / (y + κ ε) for each eigenvalue z of matrices (n, d, d): the inverse of `damped`.

    See `maniport.transfer.lengths.field.damped`; y is positive, and for z far above ε it is z − ε.
    """
    if epsilon == 0.0:
        return points
    values, vectors = eigh(points)
    gap = values - epsilon
    way = np.sqrt(gap * gap + 4.0 * KAPPA * epsilon * values)
    low = gap <= 0.0  # where the difference of the two would lose digits
    lengths = np.where(low, 2.0 * KAPPA * epsilon * values / np.where(low, way - gap, 1.0), 0.5 * (gap + way))
    return compose(lengths, vectors)
