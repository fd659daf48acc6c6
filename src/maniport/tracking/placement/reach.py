"""Points that an arm cannot come to, among all points of a path that was placed by some of them.

A motion is judged by means over the path, to which a few points out of reach, or only in reach where the arm collides
with itself, are next to nothing: the person's hand may come near the body, and the path then near the robot's base.
"""

from dataclasses import replace

import numpy as np

from maniport.tracking.placement.journey import Journey
from maniport.tracking.placement.sides import Sides
from maniport.tracking.plan.atlas import GAP_WEIGHT, Atlas
from maniport.tracking.plan.in_place import IN_PLACE
from maniport.tracking.plan.refinement import CLEAR
from maniport.validation import Array

NEAR = 7.0
"""Distances between samples; so near to the tip of one that collides with nothing the arm mostly comes so, too."""
NODES = 120
"""So many postures are tried at a point that is farther from all samples."""
ROOM = 0.5 * CLEAR
"""Of what motions are kept apart by, so much must be possible [m]: they leave the path where there is less."""
STEPS, RIDGE = 8, 0.1
INWARDS = 1.5
"""What is moved towards the samples goes so many times as far as it should: a sample's neighbors are beyond it."""


def out_of_reach(sides: Sides, place: Array) -> bool:
    """Whether at a place (7,) some arm has no posture without a collision for some point of its path."""
    return any(
        _out_of_reach(journey, atlas, place) for journey, atlas in zip(sides.journeys, sides.atlases, strict=True)
    )


def _out_of_reach(journey: Journey, atlas: Atlas, place: Array) -> bool:
    targets = journey.targets(place)
    assert targets.positions is not None
    far = targets[np.linalg.norm(atlas.ways(targets.positions), axis=1) > NEAR * atlas.spacing]
    if not len(far):
        return False
    nodes = atlas.nodes(far, NODES, np.random.default_rng(0))
    owner = np.repeat(np.arange(len(far)), np.diff(nodes.first))
    good = np.linalg.norm(far[owner].tip_offset(nodes.q), axis=1) <= IN_PLACE
    if atlas.collisions is not None:
        good[good] = atlas.collisions.clearance(nodes.q[good]) >= ROOM
    return len(np.unique(owner[good])) < len(far)


def _beyond(sides: Sides, place: Array) -> tuple[Array, Array]:
    """By how much points are farther from samples than `NEAR` (k,) [m], and what a place (7,) does to that (k, 7)."""
    beyond, slopes = [], []
    for journey, atlas in zip(sides.journeys, sides.atlases, strict=True):
        way = atlas.ways(journey.placed(place[None])[0][0])
        gap = np.linalg.norm(way, axis=1)
        near = NEAR * atlas.spacing
        far = gap > near
        beyond.append(gap[far] - near)
        slopes.append(-np.einsum("ni,nij->nj", way[far] / gap[far, None], journey.moves(place)[0][far]))
    return np.concatenate(beyond), np.concatenate(slopes)


def price(sides: Sides, place: Array) -> tuple[float, Array]:
    """What points that are far from all samples add to the cost of a place (7,), and its slopes (7,)."""
    beyond, slopes = _beyond(sides, place)
    return float(GAP_WEIGHT**2 * np.sum(beyond**2)), 2.0 * GAP_WEIGHT**2 * beyond @ slopes


def within_reach(sides: Sides, place: Array, units: Array) -> Array:
    """Move a place (7,) as little as may be, in units (7,), until all points are `NEAR` samples, or nearly so."""
    free, place = sides.common.free, sides.within(place[None])[0][0]
    for _ in range(STEPS):
        beyond, slopes = _beyond(sides, place)
        if not len(beyond):
            break
        matrix = slopes[:, free] * units[free]
        square = matrix.T @ matrix
        step = np.linalg.solve(square + RIDGE * np.trace(square) * np.eye(len(square)), -INWARDS * matrix.T @ beyond)
        place[free] = np.clip(place[free] + units[free] * step, sides.common.least[free], sides.common.most[free])
        place = sides.within(place[None])[0][0]
    return place


def with_all(sides: Sides, paths: tuple[Array, ...]) -> Sides:
    """The same with all points of the paths (m, 3) around their centre; their ellipsoids and times mean nothing."""
    journeys = (
        replace(
            one, path=path, profile=np.tile(np.eye(one.objective.spec.size), (len(path), 1, 1)),
            time=np.arange(len(path), dtype=float),
        )
        for one, path in zip(sides.journeys, paths, strict=True)
    )  # fmt: skip
    return replace(sides, journeys=tuple(journeys))
