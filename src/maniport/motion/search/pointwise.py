"""Pointwise optimum: the best configuration found for each target by itself, with the end effector in place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.motion.objective import EXACT_WEIGHT, SEARCH_WEIGHT
from maniport.motion.search.descent import PathCost, descend_in_blocks
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
    targets: PathCost, starts: Array, known: Array | None = None, progress: Part | None = None
) -> PointwiseBest:
    """Search from starts (n, k, dof), then from the results of the neighbors and from known configurations (n, dof)."""
    first, then = (None, None) if progress is None else pieces(progress, 4.0, 1.0)
    q = _descend(targets, starts, SEARCH_WEIGHT, first)
    candidates = [q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0), *([] if known is None else [known])]
    return improved_from(targets, np.stack(candidates, axis=1), then)


def improved_from(targets: PathCost, starts: Array, progress: Part | None = None) -> PointwiseBest:
    """Search from known configurations (n, k, dof) alone."""
    q = _descend(targets, starts, EXACT_WEIGHT, progress)
    return PointwiseBest(q, targets.distance(q), targets.tip_error(q))


def interpolated_distance(rows: NDArray[np.intp], distance: Array, count: int) -> Array:
    """Distances (count,) from those at some rows: the square is linear, which keeps the mean square."""
    return np.asarray(np.sqrt(np.interp(np.arange(count), rows, distance**2)))


def _descend(targets: PathCost, starts: Array, position_weight: float, progress: Part | None) -> Array:
    return descend_in_blocks(targets.weighing(position_weight), starts, tol=1e-6, max_iter=100, block=64, tell=progress)
