"""Arms that would meet: each is planned anew beside what the other one does, which stays as it is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maniport.tracking.both.planner import ArmsPlanner
from maniport.tracking.objective import Targets
from maniport.tracking.plan.optimizer import CLEARANCE, CLEARANCE_WEIGHT
from maniport.tracking.plan.planner import interpolated, smoothness_share, stages_of
from maniport.tracking.plan.roadmap import JOINT_MOTION_WEIGHT, shortest_path
from maniport.validation import Array


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
    rows = stages_of(time, 0.55)
    nodes = own.atlas.nodes(targets[rows], 150, random)
    both = np.empty((len(nodes.q), planner.arms.dof))
    both[:, columns[side]] = nodes.q
    both[:, columns[1 - side]] = np.repeat(other[rows], np.diff(nodes.first), axis=0)
    cost = nodes.cost.copy()
    near, distance, _ = apart.between.gradient(both, CLEARANCE)
    np.add.at(cost, near, (CLEARANCE_WEIGHT * (CLEARANCE - distance)) ** 2)
    if own.collisions is not None:
        cost += 1e4 * own.collisions.collides(nodes.q)
    nodes = replace(nodes, cost=cost)
    way = nodes.q[
        shortest_path(nodes, time[rows], own.largest_changes(time[rows]), smoothness_share(time) * JOINT_MOTION_WEIGHT)
    ]
    return interpolated(time[rows], way, time)
