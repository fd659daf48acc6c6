"""Where in an arm's workspace a path lets the arm make the target ellipsoids best."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import VELOCITY, Arm, EllipsoidSpec
from maniport.bodies.collisions import Collisions
from maniport.defaults import DAMPING
from maniport.errors import InvalidInputError
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.effort import FULL, as_effort
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.placement.asked import given_place, journeys_of
from maniport.tracking.placement.journey import HEADING, OFFSET, SCALE, TILT, YAW, Journey, mounts, wrapped
from maniport.tracking.placement.placed_path import Place, PlacedPath
from maniport.tracking.placement.placement_search import best_places
from maniport.tracking.placement.reach import with_all
from maniport.tracking.placement.sides import Sides
from maniport.tracking.placement.workspace import as_workspace, require_reach, table_below
from maniport.tracking.plan.atlas import Atlas
from maniport.tracking.search.node_floor import node_floor
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import (
    Array,
    as_count,
    as_generator,
    as_metres,
)

REACHED = 1e-3
"""How far beside its point the tip may be and still count as there [m]."""
SEARCHED = 0.85
"""The fraction done when the places have been found, all but the node floor."""


def place_path(
    path: ArrayLike,
    profile: ArrayLike,
    arm: Arm,
    *,
    time: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | None = None,
    whole: ArrayLike | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Collisions | bool | None = None,
    atlas: Atlas | None = None,
    bank: StartBank | None = None,
    effort: str = FULL,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> PlacedPath:
    """Find scale, turn, offset and, if asked for, a tilt of the base that let an arm make target ellipsoids best.

    Most of the distance that remains is decided by where the path lies. Thousands of places are compared by samples of
    the arm; from different ones of the best a motion is planned through some points of the path, and place and motion
    are improved together. The best is taken; of those as good, to 5 % of the cost, the one that turns the path least.
    The ellipsoids turn with the path, as if the whole task were done in another direction in front of the robot.

    Parameters
    ----------
    path : array_like, shape (n, 3)
        Hand positions of the teacher in its base frame [m].
    profile : array_like, shape (n, d, d)
        Target ellipsoids of the arm, one for each point, as an adapter gives them.
    arm : Arm
    time : array_like, shape (n,), optional
        When the points are passed [s]: what lasts counts for more. Default: all points count alike.
    turn : array_like, shape (3, 3), optional
        Rotation that the adapter turned the ellipsoids by, and the path is yet to be turned by. Default: the identity.
    scale : float or (float, float), optional
        Factor of the path's size to keep, or the range to search. Default: from 0.5 to 2.
    yaw : float, optional
        Turn about the vertical to keep [rad]. Default: free.
    tilt : float or "free", optional
        By how much the base leans, to the side that serves best [rad]; "free" is upright where leaning gains nothing.
    offset : sequence of three floats, optional
        Where the path's centre shall be in the arm's base frame [m]; None leaves a coordinate free. Default: free.
    workspace : three pairs of floats, optional
        ``((x0, x1), (y0, y1), (z0, z1))``: where the path may be in the base frame [m]; None or ±inf: open.
    whole : array_like, shape (m, 3), optional
        All points of a path that has only some: the arm shall reach each without a collision, else perhaps not all.
    spec, damping, bank, progress
        As in `maniport.tracking.nearest_feasible`; the bank serves the node floor.
    collisions : Collisions or bool, optional
        What planned motions are kept apart from; True: the arm itself. The path stays above a table.
    atlas : maniport.tracking.Atlas, optional
        Samples of this arm and these ellipsoids, and what it is kept apart from. Default: new ones (0.4 s).
    effort, rank, random_state : optional
        How much is tried, as in `maniport.tracking.PlanControl`; which of the `candidates` to take, from 1, of which
        only the first has all of `whole` in reach; same seed, same place.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When a value is wrong, the arm reaches nothing in the workspace, the path does not fit, or `rank` is too high.

    See Also
    --------
    PlacedPath, plan_motion
    """
    return place_paths(
        (path,), (profile,), (arm,), wholes=None if whole is None else (whole,), collisions=(collisions,),
        atlases=(atlas,), banks=(bank,), time=time, turn=turn, scale=scale, yaw=yaw, tilt=tilt, offset=offset,
        workspace=workspace, spec=spec, damping=damping, effort=effort, rank=rank, random_state=random_state,
        progress=progress,
    )[0]  # fmt: skip


def place_paths(
    paths: Sequence[ArrayLike],
    profiles: Sequence[ArrayLike],
    arms: Sequence[Arm],
    *,
    time: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    scale: float | tuple[float, float] | None = None,
    yaw: float | None = None,
    tilt: float | str | None = None,
    offset: Sequence[float | None] | ArrayLike | None = None,
    workspace: Sequence[Sequence[float | None]] | None = None,
    wholes: Sequence[ArrayLike] | None = None,
    spec: EllipsoidSpec = VELOCITY,
    damping: Damping = DAMPING,
    collisions: Sequence[Collisions | bool | None] | None = None,
    atlases: Sequence[Atlas | None] | None = None,
    banks: Sequence[StartBank | None] | None = None,
    effort: str = FULL,
    rank: int = 1,
    random_state: Any = 0,
    progress: Progress | None = None,
) -> tuple[PlacedPath, ...]:
    """Find one place for the paths of several arms, such as those of both hands, which keep their relation.

    As `place_path` for one arm. All paths are scaled, turned and moved alike, about the mean of all their points; a
    place costs what it costs the arms in sum. Collisions between the arms are not looked at.

    Parameters
    ----------
    paths : sequence of array_like, shape (n, 3)
        Hand positions in one frame, one path for each arm [m].
    profiles : sequence of array_like, shape (n, d, d)
        Target ellipsoids along each.
    arms : sequence of Arm
        That answer in one frame, such as those of `maniport.load_arms`.
    wholes, collisions, atlases, banks : sequence, optional
        One for each arm, as `whole`, `collisions`, `atlas` and `bank` of `place_path`.
    time, turn, scale, yaw, tilt, offset, workspace, spec, damping, effort, rank, random_state, progress
        As in `place_path`; all for all arms.

    Returns
    -------
    tuple of PlacedPath
        One for each arm, with the same scale, turn and offset.

    Raises
    ------
    NotSPDError, InvalidInputError
        As `place_path`; also when there are not as many of each as there are arms.
    """
    generator, much, count = as_generator(random_state), as_effort(effort), len(arms)
    chosen = as_count(rank, "rank") - 1
    _require_each(count, paths=paths, profiles=profiles, wholes=wholes, collisions=collisions)
    _require_each(count, atlases=atlases, banks=banks)
    objectives = [Objective.of(arm, spec, damping) for arm in arms]
    given = given_place(scale, yaw, tilt, offset)
    journeys, centre, rotation = journeys_of(objectives, paths, profiles, time, turn, given)
    bounds, step = as_workspace(workspace), Step(progress, "place the path")
    known, lots = _known(arms, spec, generator, atlases, banks, collisions)
    for journey, atlas in zip(journeys, known, strict=True):
        bounds[0, 2] = max(bounds[0, 2], table_below(atlas.collisions, journey))
    for atlas in known:
        require_reach(atlas, bounds)
    sides = Sides(tuple(replace(one, workspace=bounds) for one in journeys), tuple(known))
    whole = None
    if wholes is not None:
        whole = with_all(sides, tuple((as_metres(one, "whole") - centre) @ rotation.T for one in wholes))
    found = best_places(sides, whole, generator, much, between(step, 0.1, SEARCHED))
    if chosen >= len(found):
        raise InvalidInputError(f"rank must be at most {len(found)}, as many as places were found; found {rank}")
    tells, placed = pieces(between(step, SEARCHED, 1.0), *[1.0] * count), []
    for i, (journey, bank, tell) in enumerate(zip(journeys, lots, tells, strict=True)):
        ranking = tuple(named(one.place, one.distance[i]) for one in found)
        place, q = found[chosen].place, found[chosen].q[i]
        one = placed_of(journey, place, q, centre, rotation, bank, much.floor_starts, tell)
        placed.append(replace(one, candidates=ranking))
    floors = ", ".join(f"{np.median(one.distance):.2f}" for one in placed)
    step.end(f"scale {placed[0].scale:.3f}, node floor {floors} (median)")
    return tuple(placed)


def _require_each(count: int, **every: Sequence[Any] | None) -> None:
    """Require one of each kind for each of so many arms, where it is given at all."""
    for name, given in every.items():
        if given is not None and len(given) != count:
            raise InvalidInputError(f"{name} must be {count}, one for each arm; found {len(given)}")


def _known(
    arms: Sequence[Arm],
    spec: EllipsoidSpec,
    generator: np.random.Generator,
    atlases: Sequence[Atlas | None] | None,
    banks: Sequence[StartBank | None] | None,
    collisions: Sequence[Collisions | bool | None] | None,
) -> tuple[list[Atlas], list[StartBank]]:
    """What is known of each arm: given, or made."""
    known, lots = [], []
    for i, arm in enumerate(arms):
        lots.append(StartBank.given_or_built(banks[i] if banks else None, arm, spec, generator))
        atlas, apart = atlases[i] if atlases else None, collisions[i] if collisions else None
        known.append(Atlas(arm, spec, random_state=generator, collisions=apart) if atlas is None else atlas)
        known[i].require_fits(arm, spec)
    return known, lots


def placed_of(
    journey: Journey, place: Array, known: Array, centre: Array, turn: Array, bank: StartBank, starts: int, tell: Part
) -> PlacedPath:
    """What a place (7,) is worth to an arm at every point of its path, a motion (m, dof) through some being known."""
    tips, profile = (values[0] for values in journey.placed(place[None]))
    rows = journey.rows(len(known))
    along = np.stack([np.interp(np.arange(len(tips)), rows, column) for column in known.T], axis=1)
    floor = node_floor(journey.targets(place), bank, along, tell=tell, n_starts=starts)
    error = floor.position_error
    assert error is not None
    there = named(place, floor.distance)
    return PlacedPath(
        path=tips,
        profile=profile,
        spec=journey.objective.spec,
        scale=there.scale,
        yaw=there.yaw,
        tilt=there.tilt,
        heading=there.heading,
        mount=mounts(place[None])[0],
        offset=there.offset,
        centre=centre,
        turn=turn,
        distance=floor.distance,
        position_error=error,
        reachable=error <= REACHED,
        joint_positions=floor.joint_positions,
    )


def named(place: Array, distance: Array) -> Place:
    """A place (7,) by its numbers, with the distances of a motion there."""
    scale, yaw, heading = float(np.exp(place[SCALE])), float(wrapped(place[YAW])), float(wrapped(place[HEADING]))
    tilt = float(place[TILT])
    return Place(scale, yaw, tilt, heading if tilt else 0.0, place[OFFSET], distance)
