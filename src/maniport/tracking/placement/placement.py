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
from maniport.steps import Part, Progress, Step, between
from maniport.tracking.effort import FULL, as_effort
from maniport.tracking.objective import Damping, Objective
from maniport.tracking.placement.journey import HEADING, OFFSET, SCALE, SIZE, TILT, YAW, Journey, mounts, wrapped
from maniport.tracking.placement.placed_path import Place, PlacedPath
from maniport.tracking.placement.placement_search import Planned, best_places
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
NEAR = 0.02
"""A workspace is within reach when it is so near to where the tip is at a sample [m]."""
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
    spec, damping, bank, progress
        As in `maniport.tracking.nearest_feasible`; the bank serves the node floor.
    collisions : Collisions or bool, optional
        What planned motions are kept apart from; True: the arm itself. The path stays above a table.
    atlas : maniport.tracking.Atlas, optional
        Samples of this arm and these ellipsoids, and what it is kept apart from. Default: new ones (0.4 s).
    effort : {"full", "quick"}
        How much is tried, as in `maniport.tracking.PlanControl`.
    random_state : None, int or numpy.random.Generator
        Same seed, same place.

    Raises
    ------
    NotSPDError
        When an ellipsoid is asymmetric or, with the damping, not positive-definite.
    InvalidInputError
        When another argument has a wrong value, the arm reaches nothing in the workspace, or the path does not fit in.
    """
    generator, objective, much = as_generator(random_state), Objective.of(arm, spec, damping), as_effort(effort)
    journey, centre, rotation = _journey(objective, path, profile, time, turn, _given(scale, yaw, tilt, offset))
    bounds = as_workspace(workspace)
    bank, step = StartBank.given_or_built(bank, arm, spec, generator), Step(progress, "place the path")
    atlas = Atlas(arm, spec, random_state=generator, collisions=collisions) if atlas is None else atlas
    atlas.require_fits(arm, spec)
    bounds[0, 2] = max(bounds[0, 2], _table(atlas.collisions, journey))
    _require_reach(atlas, bounds)
    found = best_places(replace(journey, workspace=bounds), atlas, generator, much, between(step, 0.1, SEARCHED))
    result = _placed(journey, found, centre, rotation, bank, much.floor_starts, between(step, SEARCHED, 1.0))
    step.end(f"scale {result.scale:.3f}, node floor {np.median(result.distance):.2f} (median)")
    return result


def _journey(
    objective: Objective,
    path: ArrayLike,
    profile: ArrayLike,
    time: ArrayLike | None,
    turn: ArrayLike | None,
    place: tuple[Array, Array, Array],
) -> tuple[Journey, Array, Array]:
    """What is asked for, checked, in an open workspace; the path's centre, and the turn."""
    targets, tips = objective.undamped(objective.checked(profile, "profile")), as_places(path, "path")
    require_shape(tips, "path", (len(targets), 3), ", one point for each ellipsoid of the profile")
    rotation = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    passed = np.arange(len(tips), dtype=float) if time is None else as_times(time, count=len(tips))
    if len(tips) > 1:  # how fast the path is passed shall not matter
        length = np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()
        passed = (passed - passed[0]) * max(length / SPEED, 1.0) / (passed[-1] - passed[0])
    centre = tips.mean(axis=0)
    return (
        Journey(objective, (tips - centre) @ rotation.T, targets, passed, *place, as_workspace(None)),
        centre,
        rotation,
    )


def _placed(
    journey: Journey, found: list[Planned], centre: Array, turn: Array, bank: StartBank, starts: int, tell: Part
) -> PlacedPath:
    """What the first place is worth at every point of the path."""
    place, known = found[0].place, found[0].q
    tips, profile = (values[0] for values in journey.placed(place[None]))
    rows = journey.rows(len(known))
    along = np.stack([np.interp(np.arange(len(tips)), rows, column) for column in known.T], axis=1)
    floor = node_floor(journey.targets(place), bank, along, tell=tell, n_starts=starts)
    error = floor.position_error
    assert error is not None
    candidates = tuple(_named(one.place, one.distance) for one in found)
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


def as_workspace(workspace: Any) -> Array:
    """Convert to lower and upper bounds of a path, shape (2, 3), infinite where it is open."""
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
    if workspace is None:
        return bounds
    pairs = list(workspace) if isinstance(workspace, Sequence | np.ndarray) else []
    if len(pairs) != 3 or not all(isinstance(pair, Sequence | np.ndarray) and len(pair) == 2 for pair in pairs):
        raise InvalidInputError(
            f"workspace must be ((x0, x1), (y0, y1), (z0, z1)), None where open; found {workspace!r}"
        )
    for i, (low, high) in enumerate(pairs):
        if low not in (None, -np.inf):
            bounds[0, i] = as_number(low, f"workspace[{i}][0]")
        if high not in (None, np.inf):
            bounds[1, i] = as_number(high, f"workspace[{i}][1]", above=bounds[0, i])
    return bounds


def _table(apart: Collisions | None, journey: Journey) -> float:
    """Height of a table that the path stays above [m]."""
    if apart is None or apart.table is None:
        return -np.inf
    if journey.given[TILT] != 0.0:
        raise InvalidInputError(
            "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two out, or "
            "give workspace"
        )
    return apart.table


def _require_reach(atlas: Atlas, bounds: Array) -> None:
    """Raise unless the arm's tip comes into the workspace."""
    tips = atlas.reach
    if np.linalg.norm(tips - np.clip(tips, *bounds), axis=1).min() > NEAR:
        asked, reached = (
            ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", *ends, strict=True))
            for ends in (bounds, (tips.min(axis=0), tips.max(axis=0)))
        )
        raise InvalidInputError(
            f"workspace: {atlas.arm.name!r} reaches nothing in {asked} m: its tip at {atlas.arm.frame!r} comes to "
            f"{reached} m at most, and not everywhere between"
        )
