"""The best way through the nodes of all stages, by dynamic programming; compiled."""

import numpy as np
from numpy.typing import NDArray

from maniport.jit import kernel
from maniport.tracking.plan.nodes import Nodes
from maniport.tracking.plan.refinement import durations_of
from maniport.validation import Array

TRAVEL = 0.3
"""What (rad/s)² counts for beside d² (λ), where smoothness counts in full. With 0.02 the motion is 1 % worse."""
LEAP = 1000.0
"""What the squared excess over the largest change between stages counts for; nodes that far apart are no motion."""


def shortest_path(nodes: Nodes, time: Array, largest: Array, travel: float = TRAVEL) -> NDArray[np.intp]:
    """Choose one node a stage, with the least sum of cost and travel."""
    gaps = np.diff(time, prepend=time[0])
    durations, first = durations_of(time), nodes.first
    value, before = np.full(len(nodes.q), np.inf), np.full(len(nodes.q), -1, np.intp)
    value[first[0] : first[1]] = nodes.cost[first[0] : first[1]] * durations[0]
    for stage in range(1, len(durations)):
        order = first[stage - 1] + np.argsort(value[first[stage - 1] : first[stage]])
        here = first[stage], first[stage + 1], travel / gaps[stage], largest[stage]
        _fill_stage(nodes.q, order, *here, LEAP, value, before)
        value[first[stage] : first[stage + 1]] += nodes.cost[first[stage] : first[stage + 1]] * durations[stage]
    stages = len(nodes.first) - 1
    way = np.empty(stages, np.intp)
    way[-1] = nodes.first[-2] + np.argmin(value[nodes.first[-2] : nodes.first[-1]])
    for stage in range(stages - 1, 0, -1):
        way[stage - 1] = before[way[stage]]
    return way


@kernel
def _fill_stage(q, order, begin, end, weight, largest, leap, value, before):  # type: ignore[no-untyped-def]
    """Fill the least cost of a way to each node from `begin` to `end`, its own left out, and the node before it."""
    for k in range(begin, end):
        best, chosen = np.inf, order[0]
        for n in range(len(order)):
            i = order[n]
            total = value[i]
            if total >= best:
                break
            for j in range(q.shape[1]):
                change = abs(q[k, j] - q[i, j])
                total += weight * change * change
                if change > largest[j]:
                    total += leap * ((change / largest[j]) ** 2 - 1.0)
                if total >= best:
                    break
            if total < best:
                best, chosen = total, i
        value[k], before[k] = best, chosen
