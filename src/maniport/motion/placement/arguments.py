"""Checked arguments of placements: paths, given numbers and workspace."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion.objective import Objective
from maniport.motion.placement.problem import HEADING, SCALE, SIZE, TILT, YAW, PlacementProblem
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.util.validation import Array, as_choice, as_metres, as_number, as_rotation, as_times, require_shape

FREE = "free"  # A tilt that is searched


def problems_of(
    objectives: Sequence[Objective],
    paths: Sequence[ArrayLike],
    profiles: Sequence[ArrayLike],
    time: ArrayLike | None,
    turn: ArrayLike | None,
    bounds: tuple[Array, Array, Array],
    workspace: Array,
) -> tuple[tuple[PlacementProblem, ...], Array, Array]:
    """Make placement problems of checked arguments; return them, the center of the paths, and the rotation `turn`."""
    targets, positions = [], []
    for i, objective in enumerate(objectives):
        index = "" if len(objectives) == 1 else f"s[{i}]"
        targets.append(objective.undamped(objective.checked(profiles[i], f"profile{index}")))
        require_shape(targets[i], f"profile{index}", targets[0].shape, ", as many as of the first arm")
        positions.append(as_metres(paths[i], f"path{index}"))
        require_shape(
            positions[i], f"path{index}", (len(targets[0]), 3), ", one point for each ellipsoid of the profile"
        )
    rotation = np.eye(3) if turn is None else as_rotation(turn, "turn", 3)
    passed = np.arange(len(positions[0]), dtype=float) if time is None else as_times(time, count=len(positions[0]))
    if len(passed) > 1:  # placements are compared at a mean speed of 0.1 m/s, whatever the demonstrated one
        length = max(np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in positions)
        passed = (passed - passed[0]) * max(length / 0.1, 1.0) / (passed[-1] - passed[0])
    center = np.concatenate(positions).mean(axis=0)
    problems = tuple(
        PlacementProblem(objective, (path - center) @ rotation.T, ellipsoids, passed, *bounds, workspace)
        for objective, path, ellipsoids in zip(objectives, positions, targets, strict=True)
    )
    return problems, center, rotation


def given_place(scale: Any, yaw: Any, tilt: Any, offset: Any) -> tuple[Array, Array, Array]:
    """A placement (7,) as far as it is given, nan where free, and bounds of placements."""
    given, scales = np.full(SIZE, np.nan), (0.5, 2.0)
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


def table_height(collisions: Collisions | None, given: Array) -> float:
    """Height of a table that the path stays above [m]."""
    if collisions is None or collisions.table is None:
        return -np.inf
    if given[TILT] != 0.0:
        raise InvalidInputError(
            "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two out, or "
            "give workspace"
        )
    return collisions.table


def require_reach(reachability_map: ReachabilityMap, bounds: Array, tolerance: float = 0.02) -> None:
    """Raise unless a sample of the arm comes into the workspace, within a tolerance [m]."""
    tips = reachability_map.reach
    if np.linalg.norm(tips - np.clip(tips, *bounds), axis=1).min() > tolerance:
        asked, reached = (
            ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", *ends, strict=True))
            for ends in (bounds, (tips.min(axis=0), tips.max(axis=0)))
        )
        raise InvalidInputError(
            f"workspace: {reachability_map.arm.name!r} reaches nothing in {asked} m: its end effector "
            f"{reachability_map.arm.frame!r} reaches {reached} m at most, and not everywhere between"
        )
