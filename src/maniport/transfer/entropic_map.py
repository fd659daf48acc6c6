"""A smooth map between two point clouds by optimal transport with entropy, which keeps a cloud in its place."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from maniport.validation import Array

MOST_ITERATIONS = 2000
TOLERANCE = 1e-9
"""Relative error of the masses at which Sinkhorn's iterations end."""

BLOCK = 1 << 20
"""Numbers in an array of distances, which stays in the processor's cache."""


@dataclass(frozen=True)
class EntropicMap:
    """The debiased entropic transport map T(x) = x + E_b(x) − E_a(x) from a cloud a to a cloud b.

    E_b(x) is the mean of b that the transport with entropy gives x, and E_a(x) the same from a to itself, where nothing
    has to move: their difference takes out the shrinking that entropy causes. Pooladian, Cuturi & Niles-Weed, Debiaser
    Beware, ICML 2022; the map outside of the cloud is that of Seguy et al., ICLR 2018, and Pooladian & Niles-Weed 2021.

    Attributes
    ----------
    start, end : ndarray, shapes (n, c, k) and (m, c, k)
        The clouds: c copies of each point, such as its permutations, all of which have a share of its mass.
    start_potential, end_potential : ndarray, shapes (n,) and (m,)
        Of a → a and of a → b, over ε.
    epsilon : float
        What the entropy counts for beside squared distances.
    """

    start: Array
    end: Array
    start_potential: Array
    end_potential: Array
    epsilon: float

    @classmethod
    def of(cls, start: Array, end: Array, epsilon: float) -> "EntropicMap":
        """Solve the two transports; `start` and `end` as in the attributes, points first among their copies."""
        own, other = (sinkhorn(_affinity(start[:, 0], to, epsilon)) for to in (start, end))
        return cls(start, end, own, other, epsilon)

    def __call__(self, points: Array) -> Array:
        """Map points, shape (j, k)."""
        rows = max(1, BLOCK // (self.start.shape[0] + self.end.shape[0]))
        parts = [self._moved(points[at : at + rows]) for at in range(0, len(points), rows)]
        return np.concatenate(parts) if parts else points.copy()

    def _moved(self, points: Array) -> Array:
        found = self._mean(points, self.end, self.end_potential)
        return points + found - self._mean(points, self.start, self.start_potential)

    def _mean(self, points: Array, cloud: Array, potential: Array) -> Array:
        logs = [potential - cdist(points, copy, "sqeuclidean") / self.epsilon for copy in np.swapaxes(cloud, 0, 1)]
        highest = np.max([one.max(axis=1) for one in logs], axis=0)[:, None]
        shares = [np.exp(one - highest) for one in logs]
        total = np.sum([one.sum(axis=1) for one in shares], axis=0)[:, None]
        return np.asarray(np.sum([share @ cloud[:, at] for at, share in enumerate(shares)], axis=0) / total)


def sinkhorn(affinity: Array) -> Array:
    """Potential of the columns, shape (m,), that transports even masses of n rows to m columns.

    Parameters
    ----------
    affinity : ndarray, shape (n, m)
        Minus cost over ε. Sinkhorn's iterations run on its exponential; what would leave the range of floating-point
        numbers is taken out of rows and columns beforehand.
    """
    n, m = affinity.shape
    rows = affinity.max(axis=1, keepdims=True)
    columns = (affinity - rows).max(axis=0)
    kernel = np.exp(affinity - rows - columns)
    right = np.full(m, 1.0 / m)
    for _ in range(MOST_ITERATIONS):
        left = 1.0 / (n * (kernel @ right))
        sums = kernel.T @ left
        off = np.abs(m * right * sums - 1.0).max()
        right = 1.0 / (m * sums)
        if off < TOLERANCE:
            break
    return np.asarray(np.log(right) - columns)


def _affinity(points: Array, cloud: Array, epsilon: float) -> Array:
    """Logarithm of the mean over the copies of exp(−|x − y|²/ε), shape (n, m)."""
    logs = np.stack([-cdist(points, copy, "sqeuclidean") / epsilon for copy in np.swapaxes(cloud, 0, 1)])
    highest = logs.max(axis=0)
    return np.asarray(highest + np.log(np.exp(logs - highest).mean(axis=0)))
