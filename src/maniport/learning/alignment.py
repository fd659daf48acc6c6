"""Alignment of demonstrations of unequal pace in time, their agreement, and how well some predict another.

All distances of the agreement are root mean squares of affine-invariant distances of matched ellipsoids: 0.1 is one
axis that is 5 % too long.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.errors import InvalidInputError
from maniport.estimator import clone
from maniport.learning.gmm import ProfileGMM, points_each
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axes
from maniport.spd.matrix_functions import to_vector
from maniport.spd.mean import mean
from maniport.util.notebook import NotebookDisplay
from maniport.util.progress import Progress, Step, counted
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array, as_count, as_finite, as_points, as_times, require_shape

Path = NDArray[np.intp]

MIN_COUNT = 3  # Fewest demonstrations of which one can be held out

PREDICTIONS = ("learned", "plain_mean", "nearest_other", "one_for_all_times")
"""Predictions of a demonstration by the others: their profile with as many Gaussians as that of all, their Fréchet mean
at each time, the nearest of them, and the Fréchet mean of all of their ellipsoids."""


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
    reference : int
        Index of the demonstration with these times.
    """

    time: Array
    ellipsoids: Array
    paths: tuple[Path, ...]
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
            raise InvalidInputError(
                f"signals must be {len(self.paths)}, one a demonstration; found {len(signals)}"
            )
        arrays = []
        for index, signal in enumerate(signals):
            arrays.append(as_finite(signal, f"signals[{index}]"))
        warped = []
        for index, (array, path) in enumerate(zip(arrays, self.paths, strict=True)):
            require_shape(array, f"signals[{index}]", (path[-1, 1] + 1, *arrays[0].shape[1:]))
            warped.append([array[own].mean(axis=0) for own in _groups(path)])
        return np.stack(warped)

    def stacked(self) -> tuple[Array, Array, NDArray[np.intp]]:
        """Concatenate all demonstrations for ``ProfileGMM().fit(*alignment.stacked())``.

        Returns
        -------
        inputs, ellipsoids, groups : ndarray, shapes (k n,), (k n, d, d) and (k n,)
            Times, ellipsoids, and the index of the demonstration of each point.
        """
        k, n, d, _ = self.ellipsoids.shape
        return (
            np.tile(self.time, k),
            self.ellipsoids.reshape(k * n, d, d),
            np.repeat(np.arange(k), n),
        )


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
    first = as_points(profiles[0], "profiles[0]")
    k = len(profiles)
    data = [first]
    for i, profile in enumerate(profiles[1:], start=1):
        data.append(as_points(profile, f"profiles[{i}]", first.shape[-1]))
    clocks = _clocks(times, data)
    if reference is not None:
        reference = as_count(reference, "reference", minimum=0, maximum=k - 1)
    step = Step(progress, "Align demonstrations")
    chosen = reference
    if chosen is None:
        chosen = _medoid(data, step)

    paths = []
    warped = []
    for i, profile in enumerate(data):
        if i == chosen:
            path = np.repeat(np.arange(len(profile))[:, None], 2, axis=1)
        else:
            path = matched(data[chosen], profile)[0]
        paths.append(path)
        warped.append([_mean_of_group(profile[group]) for group in _groups(path)])
    step.end(f"{k} demonstrations, {len(clocks[chosen])} times")
    return Alignment(clocks[chosen].copy(), np.stack(warped), tuple(paths), chosen)


def _clocks(times: Sequence[ArrayLike] | None, data: Sequence[Array]) -> list[Array]:
    """Return the times (n_i,) of each demonstration; from 0 to 1 where none are given."""
    if times is None:
        return [np.linspace(0.0, 1.0, len(profile)) for profile in data]
    if len(times) != len(data):
        raise InvalidInputError(
            f"times must be {len(data)} arrays, one for each profile; found {len(times)}"
        )
    clocks = []
    for i, (clock, profile) in enumerate(zip(times, data, strict=True)):
        clocks.append(as_times(clock, f"times[{i}]", len(profile)))
    return clocks


def _medoid(data: Sequence[Array], step: Step) -> int:
    """Return the index of the demonstration with the least sum of distances from the others."""
    count = len(data)
    pairs = list(combinations(range(count), 2))
    apart = np.zeros((count, count))
    for a, b in counted(pairs, len(pairs) + count, step):
        apart[a, b] = apart[b, a] = matched(data[b], data[a])[1]
    return int(np.argmin(apart.sum(axis=0)))


def _mean_of_group(ellipsoids: Array) -> Array:
    """Return the Fréchet mean (d, d) of ellipsoids (n, d, d) that are matched with one time."""
    if len(ellipsoids) == 1:
        return np.asarray(ellipsoids[0])
    return mean(ellipsoids)


def matched(reference: Array, profile: Array) -> tuple[Path, float]:
    """Return matched indices of two profiles, shape (l, 2), and sqrt(Σ d²) along them."""
    path, cost = cheapest_path(distance_unchecked(reference[:, None], profile[None]) ** 2)
    return path, float(np.sqrt(cost))


def _groups(path: Path) -> list[Path]:
    """Return the indices of the demonstration that are matched with each index of the reference."""
    return np.split(path[:, 1], np.flatnonzero(np.diff(path[:, 0])) + 1)


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
    path = [(n - 1, m - 1)]
    entry = (n, m)
    while entry != (1, 1):
        i, j = entry
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        entry = min(steps, key=lambda step: total[step])
        path.append((entry[0] - 1, entry[1] - 1))
    return np.array(path[::-1], dtype=np.intp), float(total[n, m])


@dataclass(frozen=True)
class Agreement:
    """Agreement of k demonstrations."""

    before: float  # distance from their mean at the same share of their durations
    after: float  # distance from their mean at the same times after alignment
    movement: float  # distance of the learned ellipsoids from their own mean
    apart: Array  # pairwise distances after alignment, shape (k, k)
    held_out: dict[
        str, Array
    ]  # distances (k,) from `PREDICTIONS`; empty of too few demonstrations or ellipsoids

    @property
    def share(self) -> float:
        """Share of the total variance that lies between the demonstrations, 0 to 1."""
        total = self.after**2 + self.movement**2
        if not total > 0.0:
            return 0.0
        return self.after**2 / total

    @property
    def alone(self) -> Array:
        """Mean distance of each demonstration from the others, shape (k,)."""
        return np.asarray(self.apart.sum(axis=1) / (len(self.apart) - 1))

    @property
    def outlier(self) -> int | None:
        """Index of a demonstration more than 1.5 times as far from the others as the median one; else None."""
        if len(self.apart) <= 2:
            return None
        farthest = int(np.argmax(self.alone))
        others = np.delete(self.alone, farthest)
        if self.alone[farthest] > 1.5 * np.median(others):
            return farthest
        return None


def agreement(
    profiles: Sequence[Array],
    alignment: Alignment,
    model: ProfileGMM,
    progress: Progress | None = None,
) -> Agreement:
    """Measure the agreement of demonstrations and hold out each of them."""
    step = Step(progress, "Hold out demonstrations")
    k = len(profiles)
    n = min(map(len, profiles))
    apart = np.zeros((k, k))
    for i, j in combinations(range(k), 2):
        apart[i, j] = apart[j, i] = _aligned_distance(profiles[j], profiles[i])
    held_out = dict[str, Array]()
    text = ""
    if k >= MIN_COUNT and (k - 1) * n >= points_each(profiles[0].shape[-1]):
        rows = [_held_out(i, profiles, apart, model) for i in counted(range(k), k, step)]
        held_out = dict(zip(PREDICTIONS, np.array(rows).T, strict=True))
        text = f"distance {np.mean(held_out['learned']):.2f} from the prediction by the others"
    step.end(text)
    learned = np.asarray(model.predict(alignment.time))
    movement = float(np.sqrt(np.mean(distance_unchecked(mean(learned), learned) ** 2)))
    before = np.stack([profile[evenly_spaced(len(profile), n)] for profile in profiles])
    after = alignment.ellipsoids
    return Agreement(_spread(before), _spread(after), movement, apart, held_out)


def _spread(ellipsoids: Array) -> float:
    """Return the distance of demonstrations (k, n, d, d) from their mean at each time."""
    squares = distance_unchecked(ellipsoids, _means(ellipsoids)[None]) ** 2
    return float(np.sqrt(np.mean(squares)))


def _means(ellipsoids: Array) -> Array:
    """Return Fréchet means (n, d, d) of demonstrations (k, n, d, d) at each time."""
    return np.stack([mean(several) for several in np.moveaxis(ellipsoids, 1, 0)])


def _aligned_distance(first: Array, second: Array) -> float:
    """Return the distance of two profiles (n, d, d) and (m, d, d) after alignment."""
    path, cost = matched(first, second)
    return cost / float(np.sqrt(len(path)))


def _held_out(
    i: int, profiles: Sequence[Array], apart: Array, model: ProfileGMM
) -> tuple[float, ...]:
    """Return the distances of one demonstration from `PREDICTIONS` by the others."""
    others = [k for k in range(len(profiles)) if k != i]
    among = apart[np.ix_(others, others)]
    aligned = align([profiles[k] for k in others], reference=int(np.argmin(among.sum(axis=0))))
    inputs, ellipsoids, groups = aligned.stacked()
    most = len(ellipsoids) // points_each(ellipsoids.shape[-1])
    unfitted = clone(model).set_params(n_components=min(model.n_components_, most))
    fitted = unfitted.fit(inputs, ellipsoids, groups)
    prediction = np.asarray(fitted.predict(aligned.time))
    learned = _aligned_distance(prediction, profiles[i])
    plain_mean = _aligned_distance(_means(aligned.ellipsoids), profiles[i])
    constant = _aligned_distance(mean(ellipsoids)[None], profiles[i])
    return learned, plain_mean, float(apart[i, others].min()), constant


def axis_deviations(profile: Array, covariance: Array) -> Array:
    """Return standard deviations of the logarithms of the semi-axes of a profile, to first order."""
    _, directions = axes(profile)
    along = to_vector(np.einsum("nai,nbi->niab", directions, directions))
    return np.asarray(0.5 * np.sqrt(np.einsum("nia,nab,nib->ni", along, covariance, along)))
