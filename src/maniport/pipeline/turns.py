"""How a robot's tip shall be turned along a path."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.motion import Placement
from maniport.motion.objective import POINTING
from maniport.util.progress import Progress
from maniport.util.validation import Array, as_finite, as_numbers


def turned_freely(progress: Progress | None) -> Progress | None:
    """Tell steps of the motion that is there to compare with by another name."""
    if progress is None:
        return None
    return lambda step, *told: progress(f"{step}, the tip turned freely", *told)


def turned_tips(
    rotations: ArrayLike | None, direction: ArrayLike | None, placement: Placement | None, count: int, keep: str
) -> Array:
    """How the tip shall be turned in the base frame, shape (n, 3, 3)."""
    if direction is None:
        assert rotations is not None
        found = as_finite(rotations, "rotations")
        return found if placement is None else np.asarray(placement.rotation @ placement.turn @ found)
    if rotations is not None:
        raise InvalidInputError("rotations and direction exclude one another")
    return np.tile(facing(direction, keep), (count, 1, 1))


def facing(direction: ArrayLike, keep: str) -> Array:
    """A rotation whose z axis points in a direction (3,), shape (3, 3)."""
    way = as_numbers(direction, "direction", 3)
    if not np.linalg.norm(way) > 0.0:
        raise InvalidInputError("direction must not be zero")
    if keep != POINTING:
        raise InvalidInputError(f"a direction says where the tip points; keep must be {POINTING!r}; found {keep!r}")
    z = way / np.linalg.norm(way)
    across = np.linalg.svd(z[None])[2][1]
    return np.stack([across, np.cross(z, across), z], axis=1)
