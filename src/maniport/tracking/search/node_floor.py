"""The node floor: the smallest distance to each target ellipsoid with the tip at its position, each point by itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.steps import Part, pieces
from maniport.tracking.objective import EXACT_WEIGHT, SEARCH_WEIGHT, Targets
from maniport.tracking.search.descent import Reached, descend_in_blocks
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array

STARTS, STEPS, BLOCK, TOLERANCE = 32, 100, 64, 1e-6


@dataclass(frozen=True)
class NodeFloor:
    """What an arm can make with its tip in place, point by point: not a motion, it may jump.

    Attributes
    ----------
    joint_positions : ndarray, shape (n, dof)
        [rad] or [m].
    distance : ndarray, shape (n,)
        Affine-invariant distance to the target ellipsoids; smooth motions stay above it.
    position_error : ndarray, shape (n,), or None
        How far the tip stays beside its position [m].
    """

    joint_positions: Array
    distance: Array
    position_error: Array | None


def node_floor(
    targets: Targets,
    bank: StartBank,
    known: Array | None = None,
    n_jobs: int | None = None,
    tell: Part | None = None,
    n_starts: int = STARTS,
) -> NodeFloor:
    """Search at each point by itself, from many samples; then from what its neighbors have found."""
    starts = bank.starts_for(targets, n_starts)
    return floor_searched(targets, starts, [] if known is None else [known], n_jobs, tell)


def floor_searched(
    targets: Reached, starts: Array, known: Sequence[Array] = (), n_jobs: int | None = None, tell: Part | None = None
) -> NodeFloor:
    """Search from starts (n, k, dof) of each point, then from what its neighbors have found and what is known."""
    soft = targets.weighing(SEARCH_WEIGHT)
    first, then = (None, None) if tell is None else pieces(tell, 4.0, 1.0)
    q = descend_in_blocks(soft, starts, TOLERANCE, STEPS, BLOCK, n_jobs, first)
    # what is good at one point may be better at its neighbors than what they have found
    beside = [q, np.roll(q, 1, axis=0), np.roll(q, -1, axis=0), *known]
    return _descended(targets, np.stack(beside, axis=1), n_jobs, then)


def lowered(targets: Targets, known: Array) -> NodeFloor:
    """Search from what is known at each point (n, dof) alone."""
    return _descended(targets, known[:, None])


def floor_between(rows: NDArray[np.intp], distance: Array, count: int) -> Array:
    """The floor (count,) at all points, from that at some rows: its square is linear, so that its mean square stays."""
    return np.asarray(np.sqrt(np.interp(np.arange(count), rows, distance**2)))


def _descended(targets: Reached, starts: Array, n_jobs: int | None = None, tell: Part | None = None) -> NodeFloor:
    q = descend_in_blocks(targets.weighing(EXACT_WEIGHT), starts, TOLERANCE, STEPS, BLOCK, n_jobs, tell)
    return NodeFloor(q, targets.distance(q), targets.tip_error(q))
