"""Checked arguments of placements: fixed numbers and workspace."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion.placement.problem import HEADING, SCALE, SIZE, TILT, YAW
from maniport.motion.plan.reachability_map import ReachabilityMap
from maniport.util.validation import Array, as_choice, as_number

FREE = "free"  # A tilt that is searched


def fixed_place(scale: Any, yaw: Any, tilt: Any, offset: Any) -> tuple[Array, Array, Array]:
    """Fixed numbers of a placement (7,), nan where free, and lower and upper bounds of placements."""
    fixed, scales = np.full(SIZE, np.nan), (0.5, 2.0)
    if isinstance(scale, tuple | list):
        if len(scale) != 2:
            raise InvalidInputError(f"scale must be one number or a range (low, high); found {scale!r}")
        low = as_number(scale[0], "scale[0]", above=0.0)
        scales = (low, as_number(scale[1], "scale[1]", above=low))
    elif scale is not None:
        number = as_number(scale, "scale", above=0.0)
        fixed[SCALE], scales = np.log(number), (number, number)
    if yaw is not None:
        fixed[YAW] = as_number(yaw, "yaw")
    if tilt is None:
        fixed[[TILT, HEADING]] = 0.0
    elif isinstance(tilt, str):
        as_choice(tilt, "tilt", [FREE])
    else:
        fixed[TILT] = as_number(tilt, "tilt", minimum=0.0, maximum=np.pi)
    if offset is not None:
        values = list(offset) if np.ndim(offset) == 1 else []
        if len(values) != 3:
            raise InvalidInputError(f"offset must be three numbers, None where free; found {offset!r}")
        for i, value in enumerate(values):
            fixed[4 + i] = np.nan if value is None else as_number(value, f"offset[{i}]")
    infinite = [np.inf] * 3
    lower = np.array([np.log(scales[0]), -np.pi, 0.0, -np.pi, *np.negative(infinite)])
    return fixed, lower, np.array([np.log(scales[1]), np.pi, np.pi, np.pi, *infinite])


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


def table_height(collisions: Collisions | None, fixed: Array) -> float:
    """Height of a table that the path stays above [m]."""
    if collisions is None or collisions.table is None:
        return -np.inf
    if fixed[TILT] != 0.0:
        raise InvalidInputError(
            "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two out, or "
            "give workspace"
        )
    return collisions.table


def require_reach(reachability_map: ReachabilityMap, bounds: Array, tolerance: float = 0.02) -> None:
    """Raise unless a sample of the arm comes into the workspace, within a tolerance [m]."""
    tips = reachability_map.reach
    if np.linalg.norm(tips - np.clip(tips, *bounds), axis=1).min() > tolerance:
        wanted, reached = (
            ", ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in zip("xyz", *ends, strict=True))
            for ends in (bounds, (tips.min(axis=0), tips.max(axis=0)))
        )
        raise InvalidInputError(
            f"workspace: {reachability_map.arm.name!r} reaches nothing in {wanted} m: its end effector "
            f"{reachability_map.arm.frame!r} reaches {reached} m at most, and not everywhere between"
        )
