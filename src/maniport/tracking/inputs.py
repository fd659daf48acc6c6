"""What a motion is asked for with, checked: its times, rows for each of them, and limits of the joints."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.bodies import Arm
from maniport.errors import InvalidInputError
from maniport.validation import Array, as_choice


def size_of(part: str) -> int:
    """Number of rows of the ellipsoids of a part: 3, or 6 of the full ones."""
    return 6 if as_choice(part, "part", ("translation", "rotation", "full")) == "full" else 3


def require_rows(count: int, **arrays: tuple[Array | None, tuple[int, ...]]) -> None:
    """Raise unless each array that is there has one row for each of `count` times, of the shape that goes with it."""
    for name, (array, shape) in arrays.items():
        if array is not None and array.shape != (count, *shape):
            raise InvalidInputError(
                f"{name} must have shape {(count, *shape)}, one row for each of the {count} times; "
                f"found shape {array.shape}"
            )


def as_limits(arm: Arm, value: ArrayLike | None, name: str) -> Array:
    """Convert to one positive limit for each joint, shape (dof,); infinite where there is none."""
    limits = np.asarray(np.inf if value is None else value, dtype=np.float64)
    if limits.shape not in ((), (arm.dof,)) or not np.all(limits > 0):
        raise InvalidInputError(
            f"{name} must be positive, one number or {arm.dof} (infinity: no limit); found {value!r}"
        )
    return np.full(arm.dof, limits)
