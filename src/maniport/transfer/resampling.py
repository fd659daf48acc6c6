"""Repeating a fit on resampled clouds: the bootstrap (Efron 1979)."""

from collections.abc import Callable, Sequence

import numpy as np
from joblib import Parallel, delayed

from maniport.spd.matrix_functions import congruence, roots
from maniport.spd.mean import mean
from maniport.transfer.rigid_map import recentre, transport_rotation
from maniport.validation import Array


def refitted(
    fit: Callable[[np.random.Generator], Array], randoms: Sequence[np.random.Generator], n_jobs: int | None = None
) -> list[Array]:
    """Rotations of a fit that draws its own clouds, one for each generator; through joblib where `n_jobs` is given."""
    if n_jobs is None:
        return [fit(random) for random in randoms]
    return list(Parallel(n_jobs=n_jobs)(delayed(fit)(random) for random in randoms))


def drawn_again(points: Array, random: np.random.Generator) -> Array:
    """Draw as many of the points with replacement; not the same one every time, which would have no dispersion."""
    while True:
        drawn = np.asarray(points[random.integers(len(points), size=len(points))])
        if np.any(drawn != drawn[0]):
            return drawn


def transported(
    teacher: Array,
    student: Array,
    means: tuple[Array, Array],
    randoms: Sequence[np.random.Generator],
) -> list[Array]:
    """Rotations of parallel transport between the means of resampled clouds, one for each generator."""
    sides = zip((teacher, student), means, strict=True)
    resampled = [resampled_means(points, center, randoms) for points, center in sides]
    return [transport_rotation(t, s) for t, s in zip(*resampled, strict=True)]


def resampled_means(points: Array, center: Array, randoms: Sequence[np.random.Generator]) -> list[Array]:
    """Fréchet means of clouds drawn from `points` with replacement; `center` is the mean of all."""
    n = len(points)
    # about the identity, where the search for the others starts close to its end
    whitened, back = recentre(points, center), roots(center)[0]
    weights = (np.bincount(random.integers(n, size=n), minlength=n) / n for random in randoms)
    return [congruence(back, mean(whitened, weight)) for weight in weights]
