"""How alike demonstrations are, and how well a profile of some predicts another.

All distances are root mean squares of affine-invariant distances of matched ellipsoids: 0.1 is one axis that is 5 % too
long.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maniport.estimator import clone
from maniport.learning.alignment import Alignment, align, matched
from maniport.learning.gmm import ProfileGMM
from maniport.learning.mixture import points_each
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.ellipsoid import axes
from maniport.spd.matrix_functions import to_vector
from maniport.spd.mean import dispersion, mean
from maniport.util.progress import Progress, Step, counted
from maniport.util.subsample import evenly_spaced
from maniport.util.validation import Array

FEWEST = 3  # Fewest demonstrations of which one can be left out


@dataclass(frozen=True)
class HeldOut:
    """Distances of k demonstrations, each from what is learned without it; each of shape (k,)."""

    learned: Array  # from the profile of the others, with as many Gaussians as from all
    mean: Array  # from the Fréchet mean of the others at each time
    nearest: Array  # from the nearest of the others
    constant: Array  # from the Fréchet mean of all ellipsoids of the others


@dataclass(frozen=True)
class Agreement:
    """How alike k demonstrations are."""

    before: float  # distance from their mean at the same share of their durations
    after: float  # distance from their mean at the same times after alignment
    movement: float  # distance of the learned ellipsoids from their own mean
    apart: Array  # distances of each two, aligned with one another, shape (k, k)
    held_out: HeldOut | None  # None of fewer than three demonstrations, or where the others are too few ellipsoids

    @property
    def share(self) -> float:
        """Share of all variance that lies between the demonstrations: 0 of equal ones, 1 of a profile that stays."""
        total = self.after**2 + self.movement**2
        return self.after**2 / total if total > 0.0 else 0.0

    @property
    def alone(self) -> Array:
        """Mean distance of each demonstration from the others, shape (k,)."""
        return np.asarray(self.apart.sum(axis=1) / (len(self.apart) - 1))

    @property
    def odd(self) -> int | None:
        """The outlier: more than 1.5 times as far from the others as the median demonstration; None without one."""
        alone = self.alone
        one = int(np.argmax(alone))
        return one if len(alone) >= FEWEST and alone[one] > 1.5 * np.median(np.delete(alone, one)) else None


def agreement(
    profiles: Sequence[Array], alignment: Alignment, model: ProfileGMM, progress: Progress | None = None
) -> Agreement:
    """Measure how alike demonstrations are."""
    step, k, n = Step(progress, "Leave demonstrations out"), len(profiles), min(map(len, profiles))
    apart = np.zeros((k, k))
    for i in range(k):
        for j in range(i):
            apart[i, j] = apart[j, i] = apart_by(profiles[i], profiles[j])
    found = None
    if k >= FEWEST and (k - 1) * n >= points_each(profiles[0].shape[-1]):
        rows = [_left_out(i, profiles, apart, model) for i in counted(range(k), k, step)]
        found = HeldOut(*np.array(rows).T)
    step.end("" if found is None else f"{np.mean(found.learned):.2f} from what the others say")
    return Agreement(
        spread(np.stack([one[evenly_spaced(len(one), n)] for one in profiles])),
        spread(alignment.ellipsoids),
        float(dispersion(np.asarray(model.predict(alignment.time)), kind="rms")),
        apart,
        found,
    )


def spread(ellipsoids: Array) -> float:
    """Distance of demonstrations (k, n, d, d) from their mean at each time."""
    return float(np.sqrt(np.mean(distance_unchecked(ellipsoids, means(ellipsoids)[None]) ** 2)))


def means(ellipsoids: Array) -> Array:
    """Fréchet means (n, d, d) of demonstrations (k, n, d, d) at each time."""
    return np.stack([mean(several) for several in np.moveaxis(ellipsoids, 1, 0)])


def apart_by(one: Array, other: Array) -> float:
    """Distance of two profiles (n, d, d) and (m, d, d), aligned with one another."""
    path, cost = matched(one, other)
    return cost / float(np.sqrt(len(path)))


def _left_out(i: int, profiles: Sequence[Array], apart: Array, model: ProfileGMM) -> tuple[float, ...]:
    """How far one demonstration is from what is learned of the others: the entries of `HeldOut`."""
    others = [k for k in range(len(profiles)) if k != i]
    among = apart[np.ix_(others, others)]
    aligned = align([profiles[k] for k in others], reference=int(np.argmin(among.sum(axis=0))))
    *data, groups = aligned.stacked()
    most = len(data[1]) // points_each(data[1].shape[-1])
    fitted = clone(model).set_params(n_components=min(model.n_components_, most)).fit(data[0], data[1], groups)
    return (
        apart_by(np.asarray(fitted.predict(aligned.time)), profiles[i]),
        apart_by(means(aligned.ellipsoids), profiles[i]),
        float(apart[i, others].min()),
        apart_by(mean(data[1])[None], profiles[i]),
    )


def axis_deviations(profile: Array, covariance: Array) -> Array:
    """Standard deviations of the logarithms of the semi-axes of a profile, to first order."""
    _, directions = axes(profile)
    along = to_vector(np.einsum("nai,nbi->niab", directions, directions))
    return np.asarray(0.5 * np.sqrt(np.einsum("nia,nab,nib->ni", along, covariance, along)))
