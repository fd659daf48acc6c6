"""A frame as it comes: where the points are, by place or by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from maniport.demonstrations.recording import MAX_POSITION
from maniport.errors import InvalidInputError, unknown_name
from maniport.validation import Array, require_shape


def as_frame(points: Any, names: tuple[str, ...]) -> Array | None:
    """Copy to places (n, 3) in the order of the names, nan where a point is not seen; None stays None."""
    if points is None:
        return None
    if isinstance(points, Mapping):
        for name in points:
            if name not in names:
                raise unknown_name("point", name, names, "in points")
        places = np.full((len(names), 3), np.nan)
        for i, name in enumerate(names):
            if points.get(name) is not None:
                place = _as_numbers(points[name], f"points[{name!r}]")
                require_shape(place, f"points[{name!r}]", (3,))
                places[i] = place
    else:
        places = _as_numbers(points, "points")
        require_shape(places, "points", (len(names), 3), ", a row for each of live.points")
    if (np.abs(places) > MAX_POSITION).any():
        found = np.nanmax(np.abs(places))
        raise InvalidInputError(
            f"points must be within ±{MAX_POSITION:g}, or nan where they are not seen; found {found:g}"
        )
    return places


def _as_numbers(value: Any, name: str) -> Array:
    """Convert to numbers; nan may be among them, and is what is masked."""
    try:
        if isinstance(value, np.ndarray) and value.dtype.kind == "c":
            raise TypeError
        if isinstance(value, np.ma.MaskedArray):
            value = np.ma.filled(value.astype(np.float64), np.nan)
        return np.array(value, dtype=np.float64, order="C")  # numba compiles anew for each order and read-only flag
    except (OverflowError, TypeError, ValueError):
        raise InvalidInputError(f"{name} must be numbers; found {value!r:.80}") from None
