"""Profiles over time as numbers, gaps in time, and diffusion coordinates of ellipsoids.

Diffusion maps: Coifman & Lafon, Applied and Computational Harmonic Analysis 21, 2006, with the Gaussian kernel of
affine-invariant distances and α = 1, which removes the density of the samples.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError, NotFittedError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axis_over_time, lengths, volume
from maniport.subsample import evenly_spaced
from maniport.validation import SPD_TOLERANCE, Array, as_count, as_number, as_points

MAX_POINTS = 3000
"""Most points of `DiffusionMap.fit`, which needs a dense matrix of all pairs: 72 MB for so many."""


class Course(NamedTuple):
    """Numbers of n ellipsoids."""

    semi_axes: Array  # (n, d) ascending
    longest: Array  # (n, d) unit vectors
    shortest: Array  # (n, d) unit vectors
    volume: Array  # (n,)
    condition: Array  # (n,)


def courses(profiles: Mapping[str, Array]) -> dict[str, Course]:
    """Return numbers of profiles, shapes (n, d, d); the directions agree in sign with those of the first."""
    found: dict[str, Course] = {}
    for name, points in profiles.items():
        semi_axes, like = lengths(points), next(iter(found.values()), None)
        longest = axis_over_time(points, -1, None if like is None else like.longest)
        shortest = axis_over_time(points, 0, None if like is None else like.shortest)
        flat = semi_axes[:, 0] ** 2 <= SPD_TOLERANCE * np.trace(points, axis1=1, axis2=2)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.where(flat, np.nan, (semi_axes[:, -1] / semi_axes[:, 0]) ** 2)
        found[name] = Course(semi_axes, longest, shortest, np.where(flat, np.nan, volume(points)), condition)
    return found


def is_gap(steps: Array) -> NDArray[np.bool_]:
    """Return which time steps are more than three times the median, so that a line breaks there."""
    return np.asarray(steps > 3.0 * np.median(steps)) if len(steps) else np.zeros(0, dtype=bool)


class DiffusionMap:
    """Coordinates of SPD matrices that are invariant to congruences of the whole space."""

    points_: Array  # (n, d, d): the points of `fit`
    coordinates_: Array  # (n, n_components): coordinates of the points of `fit`
    eigenvalues_: Array  # (n_components,): eigenvalues of the diffusion, descending, below 1
    epsilon_: float  # The kernel's ε

    def __init__(self, n_components: int = 2, bandwidth: float = 1.0) -> None:
        self.n_components = n_components
        self.bandwidth = bandwidth

    def __repr__(self) -> str:
        fitted = f", fitted to {len(self.points_)} points" if hasattr(self, "points_") else ""
        return f"DiffusionMap(n_components={self.n_components}, bandwidth={self.bandwidth:g}{fitted})"

    def fit(self, points: ArrayLike) -> Self:
        """Fit the map to points."""
        count = as_count(self.n_components, "n_components")
        width = as_number(self.bandwidth, "bandwidth", above=0.0)
        data = as_points(points, "points", minimum=count + 2)
        if len(data) > MAX_POINTS:
            raise InvalidInputError(f"points must hold at most {MAX_POINTS} matrices; found {len(data)}")
        squared = _squared_distances(data, data)
        # The kernel reaches 1 % of the points from each; otherwise an outlier would take a coordinate for itself.
        reached = int(0.01 * len(data))
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
        if self.eigenvalues_[-1] < 1e-8:  # smaller ones are rounding errors
            found = int(np.sum(self.eigenvalues_ >= 1e-8))
            raise InvalidInputError(f"points span {found} diffusion coordinates; n_components is {count}")
        # scaled to variance one under the stationary distribution of the diffusion
        harmonics = vectors[:, -2::-1] / root[:, None] * np.linalg.norm(root)
        largest = np.argmax(np.abs(harmonics), axis=0)
        harmonics *= np.sign(harmonics[largest, np.arange(count)])
        self.coordinates_ = harmonics * self.eigenvalues_
        return self

    def transform(self, points: ArrayLike) -> Array:
        """Map points by the Nyström extension: each to the kernel average of the points of `fit`."""
        if not hasattr(self, "coordinates_"):
            raise NotFittedError("this DiffusionMap is not fitted; call fit first")
        data = as_points(points, "points", self.points_.shape[-1], minimum=1)
        exponent = -_squared_distances(data, self.points_) / self.epsilon_
        exponent -= exponent.max(axis=1, keepdims=True)  # cancels below, and far points do not vanish
        weights = np.exp(exponent) / self._density
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(weights @ self.coordinates_ / self.eigenvalues_)


def map_of(sets: Sequence[Array], most: int = 300) -> DiffusionMap:
    """Fit one map to at most `most` points of each of several domains and profiles, shapes (n, d, d)."""
    limit = min(most, MAX_POINTS // len(sets))
    return DiffusionMap().fit(np.concatenate([points[evenly_spaced(len(points), limit)] for points in sets]))


def _squared_distances(rows: Array, columns: Array) -> Array:
    """All squared affine-invariant distances, shape (len(rows), len(columns))."""
    parts = [rows[k : k + 64] for k in range(0, len(rows), 64)]  # all at once would take much memory
    return np.concatenate([distance_unchecked(part[:, None], columns) ** 2 for part in parts])
