"""Diffusion coordinates of SPD matrices.

Coifman & Lafon, Applied and Computational Harmonic Analysis 21, 2006, with the Gaussian kernel of affine-invariant
distances and α = 1, which removes the density of the samples.
"""

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array


class DiffusionMap:
    """Two coordinates of SPD matrices (n, d, d) that are invariant to congruences of the whole space."""

    def __init__(self, points: Array) -> None:
        squared = _squared_distances(points, points)
        # The kernel reaches 1 % of the points from each; otherwise an outlier would take a coordinate for itself.
        reached = int(0.01 * len(points))
        farthest = np.partition(squared, reached, axis=1)[:, reached].max()
        self._epsilon = max(float(np.median(squared[np.triu_indices(len(points), 1)])), float(farthest))
        if self._epsilon < 1e-16:
            raise InvalidInputError("points must not be equal; the median distance between them is zero")
        self._points = points
        kernel = np.exp(-squared / self._epsilon)
        self._density = kernel.sum(axis=1)
        kernel /= np.outer(self._density, self._density)
        root = np.sqrt(kernel.sum(axis=1))
        # symmetric with the same eigenvalues as the Markov matrix, whose rows sum to one
        values, vectors = scipy.linalg.eigh(
            kernel / np.outer(root, root), subset_by_index=(len(points) - 3, len(points) - 1)
        )
        self._eigenvalues = values[-2::-1]
        if self._eigenvalues[-1] < 1e-8:  # smaller ones are rounding errors
            raise InvalidInputError("points must span two diffusion coordinates; these lie on a curve")
        # scaled to variance one under the stationary distribution of the diffusion
        harmonics = vectors[:, -2::-1] / root[:, None] * np.linalg.norm(root)
        largest = np.argmax(np.abs(harmonics), axis=0)
        harmonics *= np.sign(harmonics[largest, np.arange(2)])
        self.coordinates = harmonics * self._eigenvalues  # (n, 2) of the points that the map is fitted to

    def transform(self, points: Array) -> Array:
        """Map points by the Nyström extension: each to the kernel average of the fitted points."""
        exponent = -_squared_distances(points, self._points) / self._epsilon
        exponent -= exponent.max(axis=1, keepdims=True)  # cancels below, and far points do not vanish
        weights = np.exp(exponent) / self._density
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(weights @ self.coordinates / self._eigenvalues)


def map_of(sets: Sequence[Array], most: int = 300) -> DiffusionMap:
    """Fit one map to at most `most` points of each of several domains and profiles, shapes (n, d, d)."""
    chosen = np.concatenate([points[evenly_spaced(len(points), most)] for points in sets])
    if len(chosen) < 4:
        raise InvalidInputError(f"a map needs at least 4 points; found {len(chosen)}")
    return DiffusionMap(chosen)


def _squared_distances(rows: Array, columns: Array) -> Array:
    """All squared affine-invariant distances, shape (len(rows), len(columns))."""
    parts = [rows[k : k + 64] for k in range(0, len(rows), 64)]  # all at once would take much memory
    return np.concatenate([distance_unchecked(part[:, None], columns) ** 2 for part in parts])
