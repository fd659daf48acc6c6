"""The best way through the nodes of all stages, by dynamic programming; compiled."""

import numpy as np
from numpy.typing import NDArray

from maniport.compiling import njit
from maniport.tracking.plan.nodes import Nodes
from maniport.tracking.plan.refinement import durations_of
from maniport.validation import Array

TRAVEL = 0.3
"""What (rad/s)² counts for beside d² (λ), where smoothness counts in full. With 0.02 the motion is 1 % worse."""
LEAP = 1000.0
"""What the squared excess over the largest change between stages counts for; nodes that far apart are no motion."""


def shortest_path(nodes: Nodes, time: Array, largest: Array, travel: float = TRAVEL) -> NDArray[np.intp]:
    """Choose one node a stage, with the least sum of cost and travel.

    The cost of a way is Σ_s cost_s Δt_s + (λ/Δt) |Δq_s|² + 1000 Σ_over ((|Δq|/largest)² − 1), over the joints that
    change more than `largest`. Predecessors are tried from the best on, until none can do better (exact pruning).

    Parameters
    ----------
    nodes : Nodes
    time : ndarray, shape (stages,)
        Increasing [s]; Δt_s is the time that a stage stands for, and Δt the time since the one before.
    largest : ndarray, shape (stages, dof)
        Largest change of the joints on the way to each stage; that to the first counts for nothing.
    travel : float
        λ [s²/rad²].

    Returns
    -------
    ndarray of int, shape (stages,)
        Indices into ``nodes.q``.
    """
    gaps = np.diff(time, prepend=time[0])
    value, before = _values(nodes.q, nodes.cost, nodes.first, durations_of(time), gaps, largest, travel, LEAP)
    stages = len(nodes.first) - 1
    way = np.empty(stages, np.intp)
    way[-1] = nodes.first[-2] + np.argmin(value[nodes.first[-2] : nodes.first[-1]])
    for stage in range(stages - 1, 0, -1):
        way[stage - 1] = before[way[stage]]
    return way


@njit(cache=True, nogil=True, error_model="numpy")
def _values(q, cost, first, durations, gaps, largest, travel, leap):  # type: ignore[no-untyped-def]
    """Least cost of a way to each node (n,), and the node before it (n,)."""
    count, dof = q.shape
    value, before = np.empty(count), np.full(count, -1, np.intp)
    for k in range(first[0], first[1]):
        value[k] = cost[k] * durations[0]
    for stage in range(1, len(durations)):
        begin, end = first[stage - 1], first[stage]
        order = begin + np.argsort(value[begin:end])
        weight = travel / gaps[stage]
        for k in range(end, first[stage + 1]):
            best, chosen = np.inf, order[0]
            for i in order:
                total = value[i]
                if total >= best:
                    break
                for j in range(dof):
                    change = abs(q[k, j] - q[i, j])
                    total += weight * change * change
                    if change > largest[stage, j]:
                        total += leap * ((change / largest[stage, j]) ** 2 - 1.0)
                    if total >= best:
                        break
                if total < best:
                    best, chosen = total, i
            value[k] = best + cost[k] * durations[stage]
            before[k] = chosen
    return value, before
