"""What bounds the place of a path: a workspace, a table, and where the arm comes at all."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.bodies.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.tracking.placement.journey import TILT, Journey
from maniport.tracking.plan.atlas import Atlas
from maniport.validation import Array, as_number

NEAR = 0.02
"""A workspace is within reach when it is so near to where the tip is at a sample [m]."""


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


def table_below(apart: Collisions | None, journey: Journey) -> float:
    """Height of a table that the path stays above [m]."""
    if apart is None or apart.table is None:
        return -np.inf
    if journey.given[TILT] != 0.0:
        raise InvalidInputError(
            "collisions: a table is level in the frame of the base, which tilt lets lean; leave one of the two out, or "
            "give workspace"
        )
    return apart.table


def require_reach(atlas: Atlas, bounds: Array) -> None:
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
