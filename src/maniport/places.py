"""Positions in space, in metres: what is beyond the world is in another unit."""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_finite

FARTHEST = 1e4
"""No arm and no path is as large [m]."""


def as_places(value: ArrayLike, name: str) -> Array:
    """Convert to positions in space [m], of any shape, not farther away than anything that is meant."""
    places = as_finite(value, name)
    farthest = float(np.abs(places).max(initial=0.0))
    if farthest > FARTHEST:
        raise InvalidInputError(f"{name} must be in metres, within ±{FARTHEST:g}; found {farthest:g}")
    return places
