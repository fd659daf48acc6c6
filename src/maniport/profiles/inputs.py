"""What a profile model may be fitted to: inputs, labels of demonstrations, and how many components they allow."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.validation import Array, as_count, as_finite, require_shape


def as_inputs(value: ArrayLike, count: int | None, columns: int | None = None) -> Array:
    """Convert to inputs, shape (n, p)."""
    array = as_finite(value, "inputs")
    if array.ndim not in (1, 2) or not array.size:
        raise InvalidInputError(f"inputs must have shape (n,) or (n, p), n and p at least 1; found {array.shape}")
    array = array[:, None] if array.ndim == 1 else array
    if count is not None and len(array) != count:
        raise InvalidInputError(f"inputs and ellipsoids must be equally many; found {len(array)} and {count}")
    if columns is not None and array.shape[1] != columns:
        raise InvalidInputError(f"inputs must have {columns} columns, as in fit; found {array.shape[1]}")
    if columns is None and np.all(array == array[0]):
        raise InvalidInputError(f"inputs must not all be equal; found {array[0].tolist()} {len(array)} times")
    return array


def count_demonstrations(groups: ArrayLike | None, points: int) -> int | None:
    """Count the labels that tell the demonstrations apart; None when there are none."""
    if groups is None:
        return None
    labels = np.asarray(groups)
    require_shape(labels, "groups", (points,), ", a label for each point")
    try:
        count = len(np.unique(labels))
    except TypeError as error:
        raise InvalidInputError(f"groups must be labels of one kind, such as whole numbers: {error}") from None
    if count < 2:
        raise InvalidInputError("groups must tell at least 2 demonstrations apart: one says nothing about agreement")
    return count


def points_each(d: int, inputs: int = 1) -> int:
    """How many ellipsoids d × d each component needs at least, with so many inputs."""
    return inputs + d * (d + 1) // 2 + 1


def component_counts(wanted: Any, most: Any, x: Array, points: Array) -> range:
    """Numbers of components to try: the wanted one, or with None all up to `most` that the points allow."""
    d, p = points.shape[-1], x.shape[1]
    each = points_each(d, p)
    room = len(x) // each
    if wanted is None:
        low, high = 1, min(as_count(most, "max_components"), max(room, 1))
    else:
        low = high = as_count(wanted, "n_components")
    if high > room:
        raise InvalidInputError(
            f"{high} component{'s' if high > 1 else ''} need{'s' if high == 1 else ''} at least {high * each} "
            f"ellipsoids, {each} each for {p} input{'s' if p > 1 else ''} and {d}×{d} matrices; found {len(x)}"
        )
    return range(low, high + 1)
