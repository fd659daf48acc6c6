"""What is asked of a place, and of the paths that are put there, checked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.tracking.objective import Objective
from maniport.tracking.placement.journey import HEADING, SCALE, SIZE, TILT, YAW, Journey
from maniport.tracking.placement.workspace import as_workspace
from maniport.validation import Array, as_choice, as_metres, as_number, as_rotation, as_times, require_shape

SCALES = (0.5, 2.0)
FREE = "free"
SPEED = 0.1
"""At which the path is passed in the mean, in its own size, while places are compared [m/s]."""


def journeys_of(
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
        tips.append(as_metres(paths[i], f"path{each}"))
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


def given_place(scale: Any, yaw: Any, tilt: Any, offset: Any) -> tuple[Array, Array, Array]:
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
