"""Agreement of demonstrations, and how well a profile learned from some predicts another.

All distances are root mean squares of affine-invariant distances of matched ellipsoids: 0.1 is one axis that is 5 % too
long.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from maniport.estimator import clone
from maniport.learning.alignment import Alignment, align, matched
from maniport.learning.gmm import ProfileGMM, points_each
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axes
from maniport.spd.matrix_functions import to_vector
from maniport.spd.mean import dispersion, mean
from maniport.util.progress import Progress, Step, counted
from maniport.util.sampling import evenly_spaced
from maniport.util.validation import Array

MIN_COUNT = 3  # Fewest demonstrations of which one can be held out


@dataclass(frozen=True)
class HeldOut:
    """Distances of k demonstrations from predictions without them; each of shape (k,)."""

    learned: Array  # from the profile of the others, with as many Gaussians as from all
    mean: Array  # from the Fréchet mean of the others at each time
    nearest: Array  # from the nearest of the others
    constant: Array  # from the Fréchet mean of all ellipsoids of the others


@dataclass(frozen=True)
class Agreement:
    """Agreement of k demonstrations."""

    before: float  # distance from their mean at the same share of their durations
    after: float  # distance from their mean at the same times after alignment
    movement: float  # distance of the learned ellipsoids from their own mean
    apart: Array  # pairwise distances after alignment, shape (k, k)
    held_out: HeldOut | None  # None of fewer than three demonstrations, or where the others are too few ellipsoids

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
        far = self.alone[farthest] > 1.5 * np.median(np.delete(self.alone, farthest)) if len(self.apart) > 2 else False
        return farthest if far else None


def agreement(
    profiles: Sequence[Array], alignment: Alignment, model: ProfileGMM, progress: Progress | None = None
) -> Agreement:
    """Measure the agreement of demonstrations and hold out each of them."""
    step, k, n = Step(progress, "Hold out demonstrations"), len(profiles), min(map(len, profiles))
    apart = np.zeros((k, k))
    for i, j in combinations(range(k), 2):
        apart[i, j] = apart[j, i] = _aligned_distance(profiles[j], profiles[i])
    held_out = None
    if k >= MIN_COUNT and (k - 1) * n >= points_each(profiles[0].shape[-1]):
        rows = [_held_out(i, profiles, apart, model) for i in counted(range(k), k, step)]
        held_out = HeldOut(*np.array(rows).T)
    step.end("" if held_out is None else f"distance {np.mean(held_out.learned):.2f} from the prediction by the others")
    movement = float(dispersion(np.asarray(model.predict(alignment.time)), kind="rms"))
    before = np.stack([profile[evenly_spaced(len(profile), n)] for profile in profiles])
    squares = (distance_unchecked(own, _means(own)[None]) ** 2 for own in (before, alignment.ellipsoids))
    spread, aligned_spread = (float(np.sqrt(np.mean(own))) for own in squares)
    return Agreement(spread, aligned_spread, movement, apart, held_out)


def _means(ellipsoids: Array) -> Array:
    """Return Fréchet means (n, d, d) of demonstrations (k, n, d, d) at each time."""
    return np.stack([mean(several) for several in np.moveaxis(ellipsoids, 1, 0)])


def _aligned_distance(first: Array, second: Array) -> float:
    """Return the distance of two profiles (n, d, d) and (m, d, d) after alignment."""
    path, cost = matched(first, second)
    return cost / float(np.sqrt(len(path)))


def _held_out(i: int, profiles: Sequence[Array], apart: Array, model: ProfileGMM) -> tuple[float, ...]:
    """Return the distances of one demonstration from predictions by the others, as in `HeldOut`."""
    others = [k for k in range(len(profiles)) if k != i]
    among = apart[np.ix_(others, others)]
    aligned = align([profiles[k] for k in others], reference=int(np.argmin(among.sum(axis=0))))
    inputs, ellipsoids, groups = aligned.stacked()
    most = len(ellipsoids) // points_each(ellipsoids.shape[-1])
    fitted = clone(model).set_params(n_components=min(model.n_components_, most)).fit(inputs, ellipsoids, groups)
    predictions = np.asarray(fitted.predict(aligned.time)), _means(aligned.ellipsoids), mean(ellipsoids)[None]
    learned, average, constant = (_aligned_distance(prediction, profiles[i]) for prediction in predictions)
    return learned, average, float(apart[i, others].min()), constant


def axis_deviations(profile: Array, covariance: Array) -> Array:
    """Return standard deviations of the logarithms of the semi-axes of a profile, to first order."""
    _, directions = axes(profile)
    along = to_vector(np.einsum("nai,nbi->niab", directions, directions))
    return np.asarray(0.5 * np.sqrt(np.einsum("nia,nab,nib->ni", along, covariance, along)))
