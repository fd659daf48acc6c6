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
from maniport.places import as_places
from maniport.steps import Part, Progress, Step, between, pieces
from maniport.tracking.effort import FULL, as_effort
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.placement.journey import HEADING, OFFSET, SCALE, SIZE, TILT, YAW, Journey, mounts, wrapped
from maniport.tracking.placement.placed_path import Place, PlacedPath
from maniport.tracking.placement.placement_search import Planned, best_places
from maniport.tracking.placement.reach import with_all
from maniport.tracking.placement.sides import Sides
from maniport.tracking.placement.workspace import as_workspace, require_reach, table_below
from maniport.tracking.plan.atlas import Atlas
from maniport.tracking.search.node_floor import node_floor
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import (
    Array,
    as_choice,
    as_generator,
    as_number,
    as_rotation,
    as_times,
    require_shape,
)

SCALES = (0.5, 2.0)
FREE = "free"
REACHED = 1e-3
"""How far beside its point the tip may be and still count as there [m]."""
SPEED = 0.1
"""At which the path is passed in the mean, in its own size, while places are compared [m/s]."""
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
    random_state: Any = 0,
    progress: Progress | None = None,
) -> PlacedPath:
    """Find scale, turn, offset and, if asked for, a tilt of the base that let an arm make target ellipsoids best.

    A position and an ellipsoid ask more of an arm of six or seven joints than it can give; most of the distance that
    remains is decided by where the path lies. Thousands of places are compared by samples of the arm; from different
    ones of the best a motion is planned through some points of the path, and place and motion are improved together.
    The place with the best motion is taken; of those as good, to 5 % of the cost, the one that turns the path least.
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
        All points of the path, where it has only some: the arm shall reach each without a collision. Without it a few
        points may be out of reach where that is better for the others.
    spec, damping, bank, progress
        As in `maniport.tracking.nearest_feasible`; the bank serves the node floor.
    collisions : Collisions or bool, optional
        What planned motions are kept apart from; True: the arm itself. The path stays above a table.
    atlas : maniport.tracking.Atlas, optional
        Samples of this arm and these ellipsoids, and what it is kept apart from. Default: new ones (0.4 s).
    effort, random_state : optional
        How much is tried, as in `maniport.tracking.PlanControl`; thorough is full here. Same seed, same place.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When another argument has a wrong value, the arm reaches nothing in the workspace, or the path does not fit in.

    See Also
    --------
    PlacedPath, plan_motion
    """
    return place_paths(
        (path,), (profile,), (arm,), time=time, turn=turn, scale=scale, yaw=yaw, tilt=tilt, offset=offset,
        workspace=workspace, wholes=None if whole is None else (whole,), spec=spec, damping=damping,
        collisions=(collisions,), atlases=(atlas,), banks=(bank,), effort=effort, random_state=random_state,
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
    time, turn, scale, yaw, tilt, offset, workspace, spec, damping, effort, random_state, progress
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
    each = {"paths": paths, "profiles": profiles, "wholes": wholes, "collisions": collisions}
    for name, given in (each | {"atlases": atlases, "banks": banks}).items():
        if given is not None and len(given) != count:
            raise InvalidInputError(f"{name} must be {count}, one for each arm; found {len(given)}")
    objectives = [Objective.of(arm, spec, damping) for arm in arms]
    journeys, centre, rotation = _journeys(objectives, paths, profiles, time, turn, _given(scale, yaw, tilt, offset))
    bounds, step, known, lots = as_workspace(workspace), Step(progress, "place the path"), [], []
    for i, arm in enumerate(arms):
        lots.append(StartBank.given_or_built(banks[i] if banks else None, arm, spec, generator))
        atlas, apart = atlases[i] if atlases else None, collisions[i] if collisions else None
        known.append(Atlas(arm, spec, random_state=generator, collisions=apart) if atlas is None else atlas)
        known[i].require_fits(arm, spec)
    for journey, atlas in zip(journeys, known, strict=True):
        bounds[0, 2] = max(bounds[0, 2], table_below(atlas.collisions, journey))
    for atlas in known:
        require_reach(atlas, bounds)
    sides = Sides(tuple(replace(one, workspace=bounds) for one in journeys), tuple(known))
    whole = None
    if wholes is not None:
        whole = with_all(sides, tuple((as_places(one, "whole") - centre) @ rotation.T for one in wholes))
    found = best_places(sides, whole, generator, much, between(step, 0.1, SEARCHED))
    tells = pieces(between(step, SEARCHED, 1.0), *[1.0] * count)
    placed = tuple(
        _placed(journeys[i], i, found, centre, rotation, lots[i], much.floor_starts, tells[i]) for i in range(count)
    )
    floors = ", ".join(f"{np.median(one.distance):.2f}" for one in placed)
    step.end(f"scale {placed[0].scale:.3f}, node floor {floors} (median)")
    return placed


def _journeys(
    objectives: Sequence[Objective],
    paths: Sequence[ArrayLike],
    profiles: Sequence[ArrayLike],
    time: ArrayLike | None,
    turn: ArrayLike | None,
    place: tuple[Array, Array, Array],
) -> tuple[tuple[Journey, ...], Array, Array]:
    """What is asked for, checked, in an open workspace; the paths' centre, and the turn."""
    targets, tips = [], []
    for i, objective in enumerate(objectives):
        each = "" if len(objectives) == 1 else f"s[{i}]"
        targets.append(objective.undamped(objective.checked(profiles[i], f"profile{each}")))
        require_shape(targets[i], f"profile{each}", targets[0].shape, ", as many as of the first arm")
        tips.append(as_places(paths[i], f"path{each}"))
        require_shape(tips[i], f"path{each}", (len(targets[0]), 3), ", one point for each ellipsoid of the profile")
    rotation = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    passed = np.arange(len(tips[0]), dtype=float) if time is None else as_times(time, count=len(tips[0]))
    if len(passed) > 1:  # how fast the path is passed shall not matter
        length = max(np.linalg.norm(np.diff(one, axis=0), axis=1).sum() for one in tips)
        passed = (passed - passed[0]) * max(length / SPEED, 1.0) / (passed[-1] - passed[0])
    centre = np.concatenate(tips).mean(axis=0)
    journeys = tuple(
        Journey(objective, (one - centre) @ rotation.T, ellipsoids, passed, *place, as_workspace(None))
        for objective, one, ellipsoids in zip(objectives, tips, targets, strict=True)
    )
    return journeys, centre, rotation


def _placed(
    journey: Journey, i: int, found: list[Planned], centre: Array, turn: Array, bank: StartBank, starts: int, tell: Part
) -> PlacedPath:
    """What the first place is worth to the arm `i` at every point of its path."""
    place, known = found[0].place, found[0].q[i]
    tips, profile = (values[0] for values in journey.placed(place[None]))
    rows = journey.rows(len(known))
    along = np.stack([np.interp(np.arange(len(tips)), rows, column) for column in known.T], axis=1)
    floor = node_floor(journey.targets(place), bank, along, tell=tell, n_starts=starts)
    error = floor.position_error
    assert error is not None
    candidates = tuple(_named(one.place, one.distance[i]) for one in found)
    first = candidates[0]
    return PlacedPath(
        path=tips,
        profile=profile,
        spec=journey.objective.spec,
        scale=first.scale,
        yaw=first.yaw,
        tilt=first.tilt,
        heading=first.heading,
        mount=mounts(place[None])[0],
        offset=first.offset,
        centre=centre,
        turn=turn,
        distance=floor.distance,
        position_error=error,
        reachable=error <= REACHED,
        joint_positions=floor.joint_positions,
        candidates=candidates,
    )


def _named(place: Array, distance: Array) -> Place:
    scale, yaw, heading = float(np.exp(place[SCALE])), float(wrapped(place[YAW])), float(wrapped(place[HEADING]))
    tilt = float(place[TILT])
    return Place(scale, yaw, tilt, heading if tilt else 0.0, place[OFFSET], distance)


def _given(scale: Any, yaw: Any, tilt: Any, offset: Any) -> tuple[Array, Array, Array]:
    """A place (7,) as far as it is given, nan where free, and the bounds of places."""
    given, scales = np.full(SIZE, np.nan), SCALES
    if isinstance(scale, tuple | list):
        if len(scale) != 2:
            raise InvalidInputError(f"scale must be one number or a range (low, high); found {scale!r}")
        low = as_number(scale[0], "scale[0]", above=0.0)
        scales = (low, as_number(scale[1], "scale[1]", above=low))
    elif scale is not None:
        number = as_number(scale, "scale", above=0.0)
        given[SCALE], scales = np.log(number), (number, number)
    if yaw is not None:
        given[YAW] = as_number(yaw, "yaw")
    if tilt is None:
        given[[TILT, HEADING]] = 0.0
    elif isinstance(tilt, str):
        as_choice(tilt, "tilt", [FREE])
    else:
        given[TILT] = as_number(tilt, "tilt", minimum=0.0, maximum=np.pi)
    if offset is not None:
        values = list(offset) if np.ndim(offset) == 1 else []
        if len(values) != 3:
            raise InvalidInputError(f"offset must be three numbers, None where free; found {offset!r}")
        for i, value in enumerate(values):
            given[4 + i] = np.nan if value is None else as_number(value, f"offset[{i}]")
    endless = [np.inf] * 3
    least = np.array([np.log(scales[0]), -np.pi, 0.0, -np.pi, *np.negative(endless)])
    return given, least, np.array([np.log(scales[1]), np.pi, np.pi, np.pi, *endless])
