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
        arrays = [as_finite(signal, f"signals[{index}]") for index, signal in enumerate(signals)]
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
    first, k = as_points(profiles[0], "profiles[0]"), len(profiles)
    data = [
        first,
        *(
            as_points(p, f"profiles[{i}]", first.shape[-1])
            for i, p in enumerate(profiles[1:], start=1)
        ),
    ]
    if times is None:
        clocks = [np.linspace(0.0, 1.0, len(profile)) for profile in data]
    elif len(times) != k:
        raise InvalidInputError(
            f"times must be {k} arrays, one for each profile; found {len(times)}"
        )
    else:
        clocks = [as_times(clock, f"times[{i}]", len(data[i])) for i, clock in enumerate(times)]
    chosen = (
        None if reference is None else as_count(reference, "reference", minimum=0, maximum=k - 1)
    )
    step = Step(progress, "Align demonstrations")
    if chosen is None:
        pairs, apart = list(combinations(range(k), 2)), np.zeros((k, k))
        for a, b in counted(pairs, len(pairs) + k, step):
            apart[a, b] = apart[b, a] = matched(data[b], data[a])[1]
        chosen = int(np.argmin(apart.sum(axis=0)))
    itself = np.repeat(np.arange(len(data[chosen]))[:, None], 2, axis=1)
    paths = tuple(
        itself if i == chosen else matched(data[chosen], other)[0] for i, other in enumerate(data)
    )
    warped = np.stack([
        [mean(profile[own]) if len(own) > 1 else profile[own[0]] for own in _groups(path)]
        for profile, path in zip(data, paths, strict=True)
    ])  # fmt: skip
    step.end(f"{k} demonstrations, {len(clocks[chosen])} times")
    return Alignment(clocks[chosen].copy(), warped, paths, chosen)


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
    i, j = n, m
    path = [(n - 1, m - 1)]
    while (i, j) != (1, 1):
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        i, j = min(steps, key=lambda entry: total[entry])
        path.append((i - 1, j - 1))
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
        return self.after**2 / total if total > 0.0 else 0.0

    @property
    def alone(self) -> Array:
        """Mean distance of each demonstration from the others, shape (k,)."""
        return np.asarray(self.apart.sum(axis=1) / (len(self.apart) - 1))

    @property
    def outlier(self) -> int | None:
        """Index of a demonstration more than 1.5 times as far from the others as the median one; else None."""
        farthest = int(np.argmax(self.alone))
        far = (
            self.alone[farthest] > 1.5 * np.median(np.delete(self.alone, farthest))
            if len(self.apart) > 2
            else False
        )
        return farthest if far else None


def agreement(
    profiles: Sequence[Array],
    alignment: Alignment,
    model: ProfileGMM,
    progress: Progress | None = None,
) -> Agreement:
    """Measure the agreement of demonstrations and hold out each of them."""
    step, k, n = Step(progress, "Hold out demonstrations"), len(profiles), min(map(len, profiles))
    apart = np.zeros((k, k))
    for i, j in combinations(range(k), 2):
        apart[i, j] = apart[j, i] = _aligned_distance(profiles[j], profiles[i])
    held_out, text = dict[str, Array](), ""
    if k >= MIN_COUNT and (k - 1) * n >= points_each(profiles[0].shape[-1]):
        rows = [_held_out(i, profiles, apart, model) for i in counted(range(k), k, step)]
        held_out = dict(zip(PREDICTIONS, np.array(rows).T, strict=True))
        text = f"distance {np.mean(held_out['learned']):.2f} from the prediction by the others"
    step.end(text)
    learned = np.asarray(model.predict(alignment.time))
    movement = float(np.sqrt(np.mean(distance_unchecked(mean(learned), learned) ** 2)))
    before = np.stack([profile[evenly_spaced(len(profile), n)] for profile in profiles])
    squares = (
        distance_unchecked(own, _means(own)[None]) ** 2 for own in (before, alignment.ellipsoids)
    )
    spread, aligned_spread = (float(np.sqrt(np.mean(own))) for own in squares)
    return Agreement(spread, aligned_spread, movement, apart, held_out)


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
    fitted = (
        clone(model)
        .set_params(n_components=min(model.n_components_, most))
        .fit(inputs, ellipsoids, groups)
    )
    predictions = (
        np.asarray(fitted.predict(aligned.time)),
        _means(aligned.ellipsoids),
        mean(ellipsoids)[None],
    )
    learned, average, constant = (
        _aligned_distance(prediction, profiles[i]) for prediction in predictions
    )
    return learned, average, float(apart[i, others].min()), constant


def axis_deviations(profile: Array, covariance: Array) -> Array:
    """Return standard deviations of the logarithms of the semi-axes of a profile, to first order."""
    _, directions = axes(profile)
    along = to_vector(np.einsum("nai,nbi->niab", directions, directions))
    return np.asarray(0.5 * np.sqrt(np.einsum("nia,nab,nib->ni", along, covariance, along)))
