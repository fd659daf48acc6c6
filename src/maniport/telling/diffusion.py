"""Diffusion maps: few coordinates in which points that are near each other in the SPD space stay near.

Coifman & Lafon, Diffusion Maps, Applied and Computational Harmonic Analysis 21, 2006, with the Gaussian kernel of
affine-invariant distances and α = 1, which takes the density of the samples out of the picture.
"""

from collections.abc import Sequence
from typing import Self

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike
from scipy.stats import gaussian_kde

from maniport.errors import InvalidInputError, NotFittedError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.subsample import evenly_spaced
from maniport.validation import Array, as_count, as_number, as_points

MAX_POINTS = 3000
"""Most points that `DiffusionMap.fit` takes: it works on a dense matrix of all pairs, 72 MB for so many."""

FITTED = 300
"""How many points of each domain and profile a map of several is fitted to, at most."""

DOTS = 3000
"""How many points of a domain are placed on a map, at most."""

REACHED = 0.01
"""The part of all points that the kernel reaches from every one. An outlier that it reaches nobody from would take a
coordinate for itself and leave all others at one place; α = 1 makes that worse."""

MIN_EIGENVALUE = 1e-8
"""Coordinates whose eigenvalue is smaller hold nothing but rounding."""


HELD = 0.9
"""Share of a domain that its outline holds."""

FEW, SHAPING, GRID = 20, 500, 80
"""Fewer dots have no outline; so many of them shape it, on a grid of so many lines each way."""


class DiffusionMap:
    """Coordinates of SPD matrices that any congruence of the whole space leaves as they are.

    Parameters
    ----------
    n_components : int
        How many coordinates.
    bandwidth : float
        Width of the kernel exp(−d² / ε): ε is `bandwidth` times the median of the squared distances d², or more where
        there are outliers, so that it reaches a hundredth of all points from every one.

    Attributes
    ----------
    points_ : ndarray, shape (n, d, d)
        The points of `fit`.
    coordinates_ : ndarray, shape (n, n_components)
        Theirs; `transform` gives the same.
    eigenvalues_ : ndarray, shape (n_components,)
        Of the diffusion, descending, below 1: how slowly the coordinate changes.
    epsilon_ : float
        The kernel's ε.
    """

    points_: Array
    coordinates_: Array
    eigenvalues_: Array
    epsilon_: float

    def __init__(self, n_components: int = 2, bandwidth: float = 1.0) -> None:
        self.n_components = n_components
        self.bandwidth = bandwidth

    def __repr__(self) -> str:
        fitted = f", fitted to {len(self.points_)} points" if hasattr(self, "points_") else ""
        return f"DiffusionMap(n_components={self.n_components}, bandwidth={self.bandwidth:g}{fitted})"

    def fit(self, points: ArrayLike) -> Self:
        """Find the map of some points."""
        count = as_count(self.n_components, "n_components")
        width = as_number(self.bandwidth, "bandwidth", above=0.0)
        data = as_points(points, "points", minimum=count + 2)
        if len(data) > MAX_POINTS:
            raise InvalidInputError(f"points must hold at most {MAX_POINTS} matrices; found {len(data)}")
        squared = _squared_distances(data, data)
        reached = int(REACHED * len(data))
        farthest = np.partition(squared, reached, axis=1)[:, reached].max()
        self.epsilon_ = width * max(float(np.median(squared[np.triu_indices(len(data), 1)])), float(farthest))
        if self.epsilon_ < 1e-16:
            raise InvalidInputError("points must not be equal; the median distance between them is zero")
        self.points_ = data
        kernel = np.exp(-squared / self.epsilon_)
        self._density = kernel.sum(axis=1)
        kernel /= np.outer(self._density, self._density)
        root = np.sqrt(kernel.sum(axis=1))
        # symmetric with the same eigenvalues as the Markov matrix, whose rows sum to one
        values, vectors = scipy.linalg.eigh(
            kernel / np.outer(root, root), subset_by_index=(len(data) - 1 - count, len(data) - 1)
        )
        self.eigenvalues_ = values[-2::-1]
        if self.eigenvalues_[-1] < MIN_EIGENVALUE:
            found = int(np.sum(self.eigenvalues_ >= MIN_EIGENVALUE))
            raise InvalidInputError(f"points span {found} diffusion coordinates; n_components is {count}")
        # scaled to variance one under the stationary distribution of the diffusion
        harmonics = vectors[:, -2::-1] / root[:, None] * np.linalg.norm(root)
        largest = np.argmax(np.abs(harmonics), axis=0)
        harmonics *= np.sign(harmonics[largest, np.arange(count)])
        self.coordinates_ = harmonics * self.eigenvalues_
        return self

    def transform(self, points: ArrayLike) -> Array:
        """Place points in the map by the Nyström extension: each at the kernel average of the points of `fit`."""
        if not hasattr(self, "coordinates_"):
            raise NotFittedError("this DiffusionMap is not fitted; call fit first")
        data = as_points(points, "points", self.points_.shape[-1], minimum=1)
        exponent = -_squared_distances(data, self.points_) / self.epsilon_
        exponent -= exponent.max(axis=1, keepdims=True)  # cancels below, and far points do not vanish
        weights = np.exp(exponent) / self._density
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(weights @ self.coordinates_ / self.eigenvalues_)


def map_of(sets: Sequence[Array], most: int = FITTED) -> DiffusionMap:
    """Fit one map to an even part of several domains and profiles, shapes (n, d, d): at most so many of each."""
    limit = min(most, MAX_POINTS // len(sets))
    return DiffusionMap().fit(np.concatenate([points[evenly_spaced(len(points), limit)] for points in sets]))


def _squared_distances(rows: Array, columns: Array) -> Array:
    """All squared affine-invariant distances, shape (len(rows), len(columns))."""
    return np.array([distance_unchecked(row, columns) ** 2 for row in rows])


def outline(points: Array) -> tuple[Array, ...]:
    """Lines around the densest part of points (m, 2) that holds `HELD` of them; none where there are few of them."""
    if len(points) < FEW or np.linalg.matrix_rank(points - points.mean(axis=0)) < 2:
        return ()
    from contourpy import contour_generator  # part of matplotlib

    density = gaussian_kde(points[evenly_spaced(len(points), SHAPING)].T)
    level = float(np.quantile(density(points.T), 1.0 - HELD))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.1 * (high - low)
    x, y = (np.linspace(a, b, GRID) for a, b in zip(low - margin, high + margin, strict=True))
    values = density(np.stack(np.meshgrid(x, y)).reshape(2, -1)).reshape(GRID, GRID)
    return tuple(np.asarray(line) for line in contour_generator(x, y, values).lines(level))
