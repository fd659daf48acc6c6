"""Alignment of demonstrations of unequal pace in time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.mean import mean
from maniport.util.notebook import NotebookDisplay
from maniport.util.progress import Progress, Step, counted
from maniport.util.validation import Array, as_count, as_finite, as_points, as_times, require_shape

Path = NDArray[np.intp]


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(NotebookDisplay):
    """k demonstrations on the n times of one of them.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times of the reference: [s] if times were passed, else from 0 to 1.
    ellipsoids : ndarray, shape (k, n, d, d)
        Each demonstration at these times.
    paths : tuple of ndarray, shape (l, 2)
        For each demonstration the matched indices (of the reference, of the demonstration), in order.
    distances : ndarray, shape (k,)
        sqrt(Σ d²) along each path, d the affine-invariant distance of matched ellipsoids; 0 for the reference.
    reference : int
        Index of the demonstration with these times.
    """

    time: Array
    ellipsoids: Array
    paths: tuple[Path, ...]
    distances: Array
    reference: int

    def __repr__(self) -> str:
        k, n, d, _ = self.ellipsoids.shape
        return f"Alignment({k} demonstrations on {n} times of number {self.reference}, ellipsoids {d}×{d})"

    def warp(self, signals: Sequence[ArrayLike]) -> Array:
        """Bring other signals of the same demonstrations, such as hand positions, to the common times.

        Parameters
        ----------
        signals : sequence of k array_like, shape (n_i, ...)
            One for each demonstration, of the length of its profile.

        Returns
        -------
        ndarray, shape (k, n, ...)
            Arithmetic mean of the values matched with each time.
        """
        if len(signals) != len(self.paths):
            raise InvalidInputError(f"signals must be {len(self.paths)}, one a demonstration; found {len(signals)}")
        arrays = [as_finite(signal, f"signals[{index}]") for index, signal in enumerate(signals)]
        warped = []
        for index, (array, path) in enumerate(zip(arrays, self.paths, strict=True)):
            require_shape(array, f"signals[{index}]", (path[-1, 1] + 1, *arrays[0].shape[1:]))
            starts = _starts(path)
            counts = np.diff(np.r_[starts, len(path)])
            sums = np.add.reduceat(array[path[:, 1]], starts)
            warped.append(sums / counts.reshape(-1, *[1] * (array.ndim - 1)))
        return np.stack(warped)

    def stacked(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """Concatenate all demonstrations for ``ProfileGMM().fit(*alignment.stacked())``.

        Returns
        -------
        inputs, ellipsoids, groups : ndarray, shapes (k n,), (k n, d, d) and (k n,)
            Times, ellipsoids, and the index of the demonstration of each point.
        """
        k, n, d, _ = self.ellipsoids.shape
        return np.tile(self.time, k), self.ellipsoids.reshape(k * n, d, d), np.repeat(np.arange(k), n)


def align(
    profiles: Sequence[ArrayLike],
    times: Sequence[ArrayLike] | None = None,
    reference: int | None = None,
    progress: Progress | None = None,
) -> Alignment:
    """Align demonstrations of the same motion in time by dynamic time warping.

    Each demonstration is matched with the reference so that Σ d² over the matched pairs is least, d the
    affine-invariant distance. Several ellipsoids that are matched with one time are replaced by their Fréchet mean.
    Neither a congruence of all ellipsoids nor a reversal of all times changes the matching. Only shapes are compared:
    while a demonstration rests its times are not determined.

    Parameters
    ----------
    profiles : sequence of array_like, shape (n_i, d, d)
        SPD; at least one demonstration of at least two ellipsoids, lengths may differ.
    times : sequence of array_like, shape (n_i,), optional
        Strictly increasing [s]. Only those of the reference enter the result.
    reference : int, optional
        Index of the demonstration with the common times. Default: the medoid, with the least sum of distances.
    progress : callable, optional
        Called with the name of a step and the fraction done.

    Raises
    ------
    NotSPDError, InvalidInputError
        When an ellipsoid is not SPD, sizes differ, times do not fit or increase, or there is no such reference.
    """
    if not len(profiles):
        raise InvalidInputError("profiles must hold at least one demonstration; found none")
    first, k = as_points(profiles[0], "profiles[0]"), len(profiles)
    data = [first, *(as_points(p, f"profiles[{i}]", first.shape[-1]) for i, p in enumerate(profiles[1:], start=1))]
    if times is None:
        clocks = [np.linspace(0.0, 1.0, len(profile)) for profile in data]
    elif len(times) != k:
        raise InvalidInputError(f"times must be {k} arrays, one for each profile; found {len(times)}")
    else:
        clocks = [as_times(clock, f"times[{i}]", len(data[i])) for i, clock in enumerate(times)]
    chosen = None if reference is None else as_count(reference, "reference", minimum=0, maximum=k - 1)
    step = Step(progress, "Align demonstrations")
    if chosen is None:
        pairs, apart = list(combinations(range(k), 2)), np.zeros((k, k))
        for a, b in counted(pairs, len(pairs) + k, step):
            apart[a, b] = apart[b, a] = matched(data[b], data[a])[1]
        chosen = int(np.argmin(apart.sum(axis=0)))
    matches = [matched(data[chosen], other, same=i == chosen) for i, other in enumerate(data)]
    paths, distances = zip(*matches, strict=True)
    warped = np.stack([_means(profile, path) for profile, path in zip(data, paths, strict=True)])
    step.end(f"{k} demonstrations, {len(clocks[chosen])} times")
    return Alignment(clocks[chosen].copy(), warped, paths, np.array(distances), chosen)


def matched(reference: Array, profile: Array, same: bool = False) -> tuple[Path, float]:
    """Return matched indices of two profiles, shape (l, 2), and sqrt(Σ d²) along them."""
    if same:
        return np.repeat(np.arange(len(profile))[:, None], 2, axis=1), 0.0
    path, cost = cheapest_path(distance_unchecked(reference[:, None], profile[None]) ** 2)
    return path, float(np.sqrt(cost))


def _means(profile: Array, path: Path) -> Array:
    """Return Fréchet means of the ellipsoids that are matched with each index of the reference."""
    starts = _starts(path)
    warped: Array = profile[path[starts, 1]]
    for index, several in enumerate(np.split(path[:, 1], starts[1:])):
        if len(several) > 1:
            warped[index] = mean(profile[several])
    return warped


def _starts(path: Path) -> Path:
    """Return where the rows of each index of the reference begin."""
    return np.flatnonzero(np.r_[True, np.diff(path[:, 0]) > 0])


def cheapest_path(costs: Array) -> tuple[Path, float]:
    """Return the cheapest path from the first to the last entry of a cost matrix: dynamic time warping."""
    n, m = costs.shape
    total = np.full((n + 1, m + 1), np.inf)
    total[0, 0] = 0.0
    for diagonal in range(n + m - 1):  # entries of an antidiagonal depend on the two before it only
        i = np.arange(max(0, diagonal - m + 1), min(diagonal, n - 1) + 1)
        j = diagonal - i
        before = np.minimum(np.minimum(total[i, j], total[i, j + 1]), total[i + 1, j])
        total[i + 1, j + 1] = costs[i, j] + before
    i, j = n, m
    path = [(n - 1, m - 1)]
    while (i, j) != (1, 1):
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        i, j = min(steps, key=lambda entry: total[entry])
        path.append((i - 1, j - 1))
    return np.array(path[::-1], dtype=np.intp), float(total[n, m])
