"""What a student that turns about an axis sees of an ellipsoid: the same six numbers, however it is turned about it.

A student whose first joint goes round makes every ellipsoid turned about that joint's axis, too. How much to lengthen
an axis of an ellipsoid is then the same for all ellipsoids that such a turn makes one another, and a field that is told
no more than what they share needs to see each only once.
"""

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.kernels import congruence
from maniport.spd.matrix_functions import from_vector, to_vector
from maniport.validation import Array, as_numbers

SIZE = 3
"""Ellipsoids of this size have an axis."""
NO_AXIS = np.zeros(0)
SOFTENED = 0.5
"""By the field's width: how near the axis features no longer change at once, so that they are smooth there."""
ROOT2 = 2.0**0.5


def as_axis(axis: ArrayLike | None, name: str, size: int) -> Array:
    """Return a unit vector, shape (3,), or none, shape (0,), for None."""
    if axis is None:
        return NO_AXIS
    direction = as_numbers(axis, name, 3)
    length = np.linalg.norm(direction)
    if size != SIZE or not length > 0.0:
        raise InvalidInputError(
            f"{name} must be None or, for 3×3 ellipsoids, a direction; found {axis!r} for d = {size}"
        )
    return direction / length


def harmonics(axis: Array) -> Array:
    """Orthogonal matrix (6, 6) that takes vec L to how its parts change in a turn about the axis; (0, 6) for none."""
    if not len(axis):
        return np.zeros((0, SIZE * (SIZE + 1) // 2))
    across = np.cross(axis, np.eye(SIZE)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis])
    xx, yy, zz, xy, xz, yz = to_vector(congruence(frame, from_vector(np.eye(SIZE * (SIZE + 1) // 2)))).T
    return np.stack([zz, (xx + yy) / ROOT2, xz, yz, (xx - yy) / ROOT2, xy])


def features(parts: Array, soft: float) -> Array:
    """What no turn about the axis changes of `harmonics` (n, 6), as smooth functions, shape (n, 6)."""
    along, mean, a, b, c, e = parts.T
    once, twice, both = _radii(parts, soft)
    together, against = (a * a - b * b) * c + 2.0 * a * b * e, 2.0 * a * b * c - (a * a - b * b) * e
    scale = 1.0 / (once * both)
    return np.stack([along, mean, once, twice, together * scale, against * scale], axis=1)


def features_changing(parts: Array, soft: float) -> Array:
    """Derivatives of `features` by `harmonics`, shape (n, 6, 6)."""
    _, _, a, b, c, e = parts.T
    once, twice, both = _radii(parts, soft)
    scale, found = 1.0 / (once * both), np.zeros((len(parts), 6, 6))
    found[:, 0, 0] = found[:, 1, 1] = 1.0
    found[:, 2, 2:4] = parts[:, 2:4] / once[:, None]
    found[:, 3, 4:6] = parts[:, 4:6] / twice[:, None]
    zero = np.zeros_like(a)
    shrinking = np.stack([a / once**2, b / once**2, zero, zero], axis=1)
    shrinking += np.stack([a, b, 4.0 * c, 4.0 * e], axis=1) / both[:, None] ** 2
    squares, product = a * a - b * b, 2.0 * a * b
    rates = (
        (squares * c + product * e, [2.0 * (a * c + b * e), 2.0 * (a * e - b * c), squares, product]),
        (product * c - squares * e, [2.0 * (b * c - a * e), 2.0 * (a * c + b * e), product, -squares]),
    )
    for row, (value, rate) in enumerate(rates, start=4):
        found[:, row, 2:] = scale[:, None] * (np.stack(rate, axis=1) - value[:, None] * shrinking)
    return found


def _radii(parts: Array, soft: float) -> tuple[Array, Array, Array]:
    once, twice = (np.sum(parts[:, first : first + 2] ** 2, axis=1) for first in (2, 4))
    return np.sqrt(once + soft**2), np.sqrt(twice + soft**2), np.sqrt(once + 4.0 * twice + soft**2)
