"""A place that was found by some points of a path, improved by a motion through all of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from maniport.places import as_places
from maniport.steps import nobody
from maniport.tracking.objective import Objective
from maniport.tracking.placement.asked import given_place, journeys_of
from maniport.tracking.placement.placed_path import PlacedPath
from maniport.tracking.placement.placement import named, placed_of
from maniport.tracking.placement.sides import Sides
from maniport.tracking.placement.together import improved_together
from maniport.tracking.placement.workspace import as_workspace, table_below
from maniport.tracking.plan.pace import in_time, near_enough
from maniport.tracking.plan.planned_motion import PlannedMotion
from maniport.tracking.plan.planner import Planner
from maniport.tracking.search.node_floor import STARTS


def improve_place(
    placed: PlacedPath,
    motion: PlannedMotion,
    path: ArrayLike,
    profile: ArrayLike,
    rows: ArrayLike,
    planner: Planner,
    workspace: Sequence[Sequence[float | None]] | None = None,
) -> PlacedPath:
    """Move a path to where the motion that was planned along it can be better, both together.

    While a place is searched, motions go through some points of the path in slow time. Here all points count, and their
    times in the motion: those that the arm cannot come to draw the path to it. The base leans as it does.

    Parameters
    ----------
    placed : PlacedPath
    motion : PlannedMotion
        Through all n points of the path there.
    path, profile : array_like, shape (n, 3) and (n, d, d)
        All that `placed` has some points of, as `place_path` takes it.
    rows : array_like of int
        Which points these are.
    planner : Planner
        That planned the motion.
    workspace : three pairs of floats, optional
        As in `place_path`.
    """
    limits, atlas = planner.limits, planner.atlas
    objective = Objective(limits.arm, motion.spec, motion.damping)
    bounds, tilt = given_place(None, None, placed.tilt or None, None), placed.tilt
    (journey,), _, _ = journeys_of([objective], [path], [profile], None, placed.turn, bounds)
    room, at = as_workspace(workspace), motion.time - motion.time[0]
    if not tilt:
        room[0, 2] = max(room[0, 2], table_below(atlas.collisions, journey))
    offsets = (as_places(path, "path") - placed.centre) @ placed.turn.T
    journey = replace(journey, path=offsets, time=at, workspace=room)
    start = np.array([np.log(placed.scale), placed.yaw, tilt, placed.heading, *placed.offset])
    asked = in_time(limits, planner.collisions, motion.demonstrated_time, at)
    near = near_enough(journey.targets(start), at, motion.joint_positions, asked, motion.tip_tolerance)
    sides = Sides((journey.weighing(near.weight),), (atlas,))
    place, (q,) = improved_together(sides, sides, start, (near.q,), (near.asked,))
    some = np.asarray(rows)
    judged = replace(journey, path=journey.path[some], profile=journey.profile[some], time=at[some])
    moved = placed_of(judged, place, q[some], placed.centre, placed.turn, planner.bank, STARTS, nobody)
    here = named(place, judged.targets(place).distance(q[some]))
    return replace(moved, candidates=(here, *placed.candidates[1:]))
