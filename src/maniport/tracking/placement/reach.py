"""Waypoints that an arm cannot reach, among all waypoints of a path that was placed by some of them.

A trajectory is judged by means over the path, to which a few waypoints out of reach, or only in reach where the arm
collides with itself, are next to nothing: a hand may come near the body, and the path then near the robot's base.
"""

from dataclasses import replace

import numpy as np

from maniport.tracking.placement.problem import ArmGroup, PlacementProblem
from maniport.tracking.plan.optimizer import CLEARANCE
from maniport.tracking.plan.reachability_map import Atlas
from maniport.tracking.plan.roadmap import IN_PLACE
from maniport.validation import Array

NEAR = 7.0
"""Multiple of the distance between samples within which an arm mostly reaches a position from a sample."""


def out_of_reach(group: ArmGroup, place: Array) -> bool:
    """Whether some arm has no collision-free configuration for some waypoint at a placement (7,)."""
    return any(
        _out_of_reach(problem, atlas, place) for problem, atlas in zip(group.problems, group.atlases, strict=True)
    )


def _out_of_reach(problem: PlacementProblem, atlas: Atlas, place: Array) -> bool:
    targets = problem.targets(place)
    assert targets.positions is not None
    far = targets[np.linalg.norm(atlas.offsets(targets.positions), axis=1) > NEAR * atlas.spacing]
    if not len(far):
        return False
    nodes = atlas.nodes(far, 120, np.random.default_rng(0))
    owner = np.repeat(np.arange(len(far)), np.diff(nodes.first))
    good = np.linalg.norm(far[owner].tip_offset(nodes.q), axis=1) <= IN_PLACE
    if atlas.collisions is not None:  # with less clearance, trajectories leave the path
        good[good] = atlas.collisions.clearance(nodes.q[good]) >= 0.5 * CLEARANCE
    return len(np.unique(owner[good])) < len(far)


def within_reach(group: ArmGroup, place: Array) -> Array:
    """Move a placement (7,) as little as possible until all waypoints are next to samples, by damped Newton steps."""
    common = group.common
    free, units = common.free, np.array([0.2, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])[common.free]
    for _ in range(8):
        place = group.within(place[None])[0][0]
        beyond, slopes = _beyond(group, place)
        if not len(beyond):
            break
        matrix = slopes[:, free] * units
        square = matrix.T @ matrix
        damped = square + 0.1 * np.trace(square) * np.eye(len(square))
        # 1.5 times as far, since the samples' neighbors are beyond them
        step = np.linalg.solve(damped, -1.5 * matrix.T @ beyond)
        place[free] = np.clip(place[free] + units * step, common.least[free], common.most[free])
    return np.asarray(group.within(place[None])[0][0])


def _beyond(group: ArmGroup, place: Array) -> tuple[Array, Array]:
    """How much farther than `NEAR` waypoints are from samples (k,) [m], and derivatives in the placement (k, 7)."""
    beyond, slopes = [], []
    for problem, atlas in zip(group.problems, group.atlases, strict=True):
        offset = atlas.offsets(problem.placed(place[None])[0][0])
        gap = np.linalg.norm(offset, axis=1)
        near = NEAR * atlas.spacing
        far = gap > near
        beyond.append(gap[far] - near)
        slopes.append(-np.einsum("ni,nij->nj", offset[far] / gap[far, None], problem.derivatives(place)[0][far]))
    return np.concatenate(beyond), np.concatenate(slopes)


def with_paths(group: ArmGroup, paths: tuple[Array, ...]) -> ArmGroup:
    """The same with other paths (m, 3) around their center; their ellipsoids and times mean nothing."""
    problems = (
        replace(
            problem,
            path=path,
            profile=np.tile(np.eye(problem.objective.spec.size), (len(path), 1, 1)),
            time=np.arange(len(path), dtype=float),
        )
        for problem, path in zip(group.problems, paths, strict=True)
    )
    return replace(group, problems=tuple(problems))
