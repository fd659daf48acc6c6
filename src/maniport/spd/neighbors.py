"""The nearest ellipsoid on the manifold, exactly and without trying them all."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.matrix_functions import apply, congruence, logarithm, roots, to_vector
from maniport.util.validation import Array

Indices = NDArray[np.intp]


class NeighborIndex:
    """Exact nearest neighbors among SPD matrices under the affine-invariant distance."""

    def __init__(self, points: Array):
        self.points = points
        # A congruence changes no affine-invariant distance, and about the identity the two metrics agree best.
        _, self._whitening = roots(apply(apply(points, np.log).mean(axis=0), np.exp))
        self._cloud, vectors = self._seen(points)
        self._tree = cKDTree(vectors)

    def query(self, queries: Array) -> tuple[Indices, Array]:
        """For every query, shape (n, d, d), the index of the nearest point and the distance to it, shapes (n,)."""
        queried, vectors = self._seen(queries)
        best, distance = np.zeros(len(queried), np.intp), np.full(len(queried), np.inf)
        open_queries = np.arange(len(queried))
        count = min(8, len(self._cloud))
        while len(open_queries):
            block = max(1, 16_000_000 // (count * queried[0].nbytes))  # bounds the memory [bytes]
            still_open = []
            for part in np.split(open_queries, range(block, len(open_queries), block)):
                lower, candidates = self._tree.query(vectors[part], k=[*range(1, count + 1)])
                distances = distance_unchecked(queried[part][:, None], self._cloud[candidates])
                choice, rows = np.argmin(distances, axis=1), np.arange(len(part))
                best[part], distance[part] = candidates[rows, choice], distances[rows, choice]
                still_open.append(part[lower[:, -1] < distance[part]])
            if count == len(self._cloud):
                break
            open_queries = np.concatenate(still_open)
            count = min(4 * count, len(self._cloud))
        return best, distance

    def _seen(self, points: Array) -> tuple[Array, Array]:
        """Return points (n, d, d) about the identity, and the vectors of their logarithms."""
        whitened = congruence(self._whitening, points)
        return whitened, to_vector(logarithm(whitened))


def nearest(queries: Array, points: Array) -> tuple[Indices, Array]:
    """Index of the nearest of `points` (m, d, d) and the distance to it, for every query (n, d, d)."""
    return NeighborIndex(points).query(queries)
