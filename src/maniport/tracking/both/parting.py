"""Arms that would meet: each is planned anew beside what the other one does, which stays as it is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maniport.tracking.both.planner import ArmsPlanner
from maniport.tracking.objective import Targets
from maniport.tracking.plan.planner import joints_between
from maniport.tracking.plan.refinement import CLEAR, CLEAR_WEIGHT
from maniport.tracking.plan.shortest_path import TRAVEL, shortest_path
from maniport.validation import Array

STAGE = 0.55
"""Longest time between stages [s]."""
NODES = 150
"""Postures at each."""
SHARE = 0.1
"""Of the usual cost of travel."""
IN_ITSELF = 1e4
"""What a posture costs in which an arm collides with itself, or with what stands around."""


def parted(
    planner: ArmsPlanner, each: Sequence[Targets], time: Array, courses: Sequence[Array], random: np.random.Generator
) -> list[Array]:
    """Motions of both (n, dof) in which one arm makes way for the other, and then the other for it."""
    found = []
    for first in (1, 0):
        ways = list(courses)
        for side in (first, 1 - first):
            ways[side] = _beside(planner, side, each[side], time, ways[1 - side], random)
        found.append(planner.arms.joined(*ways))
    return found


def _beside(
    planner: ArmsPlanner, side: int, targets: Targets, time: Array, other: Array, random: np.random.Generator
) -> Array:
    """The best way of an arm through nodes, each of which costs by how near it is to the other arm at that moment."""
    own, columns, apart = planner.each[side], planner.arms.columns, planner.collisions
    assert apart is not None
    rows = own.stages(time, STAGE)
    nodes = own.atlas.nodes(targets[rows], NODES, random)
    both = np.empty((len(nodes.q), planner.arms.dof))
    both[:, columns[side]] = nodes.q
    both[:, columns[1 - side]] = np.repeat(other[rows], np.diff(nodes.first), axis=0)
    cost = nodes.cost.copy()
    near, distance, _ = apart.between.gradient(both, CLEAR)
    np.add.at(cost, near, (CLEAR_WEIGHT * (CLEAR - distance)) ** 2)
    if own.collisions is not None:
        cost += IN_ITSELF * own.collisions.collides(nodes.q)
    nodes = replace(nodes, cost=cost)
    way = nodes.q[shortest_path(nodes, time[rows], own.largest_changes(time[rows]), SHARE * TRAVEL)]
    return joints_between(time[rows], way, time)
