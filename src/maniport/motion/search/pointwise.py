"""Pointwise optimum: the best configuration found for each target by itself, with the end effector in place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.motion.objective import EXACT_WEIGHT, SEARCH_WEIGHT, Targets
from maniport.motion.search.descent import PathCost, descend_in_blocks
from maniport.motion.search.seed_bank import SeedBank
from maniport.util.progress import Part, pieces
from maniport.util.validation import Array

STARTS = 32  # Samples that a search starts from at each target


@dataclass(frozen=True)
class PointwiseBest:
    """The best found for each target by itself: not a motion, it may jump."""

    joint_positions: Array  # (n, dof) [rad or m]
    distance: Array  # (n,), to the target ellipsoids; smooth motions stay above it
    position_error: Array | None  # (n,) [m]


def pointwise_best(
    targets: Targets, bank: SeedBank, known: Array | None = None, n_starts: int = STARTS, progress: Part | None = None
) -> PointwiseBest:
    """Search from samples of a bank, then from the results of the neighbors and from known configurations (n, dof)."""
    return search_pointwise(targets, bank.starts_for(targets, n_starts), [] if known is None else [known], progress)


def search_pointwise(
    targets: PathCost, starts: Array, known: Sequence[Array] = (), progress: Part | None = None
) -> PointwiseBest:
    """Search from starts (n, k, dof), then from the results of the neighbors and from known configurations."""
    first, then = (None, None) if progress is None else pieces(progress, 4.0, 1.0)
    q = _descend(targets, starts, SEARCH_WEIGHT, first)
    candidates = [q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0), *known]
    return _best(targets, np.stack(candidates, axis=1), then)


def improved_from(targets: Targets, known: Array) -> PointwiseBest:
    """Search from known configurations (n, dof) alone."""
    return _best(targets, known[:, None])


def interpolated_distance(rows: NDArray[np.intp], distance: Array, count: int) -> Array:
    """Distances (count,) from those at some rows: the square is linear, which keeps the mean square."""
    return np.asarray(np.sqrt(np.interp(np.arange(count), rows, distance**2)))


def _best(targets: PathCost, starts: Array, progress: Part | None = None) -> PointwiseBest:
    q = _descend(targets, starts, EXACT_WEIGHT, progress)
    return PointwiseBest(q, targets.distance(q), targets.tip_error(q))


def _descend(targets: PathCost, starts: Array, position_weight: float, progress: Part | None) -> Array:
    return descend_in_blocks(targets.weighing(position_weight), starts, tol=1e-6, max_iter=100, block=64, tell=progress)
