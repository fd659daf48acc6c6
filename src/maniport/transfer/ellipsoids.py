"""Checks, base rotation and regularization of ellipsoids before and after the map of a method."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import eigh
from maniport.spd.matrix_functions import apply
from maniport.spd.regularization import Regularization
from maniport.util.validation import SPD_TOLERANCE, Array, as_finite, as_points, as_rotation, vouched


def as_base_rotation(base_rotation: ArrayLike | None, d: int) -> Array | None:
    """Check a base rotation and return it for ellipsoids of size d; None for equal frames."""
    if base_rotation is None:
        return None
    if d == 6 and np.shape(base_rotation) == (3, 3):
        rotation = np.asarray(np.kron(np.eye(2), as_rotation(base_rotation, "base_rotation", 3)), dtype=np.float64)
    else:
        rotation = as_rotation(base_rotation, "base_rotation", d)
    return None if np.array_equal(rotation, np.eye(d)) else rotation


_checked_once = lru_cache(maxsize=32, typed=True)(Regularization)  # the checks take a sixth of mapping one ellipsoid


def regularization_of(damping: Any, eigenvalue_floor: Any, epsilon: float) -> Regularization:
    """Return a regularization that is checked once, not again for each ellipsoid."""
    try:
        return _checked_once(damping, eigenvalue_floor, epsilon)
    except TypeError:  # what cannot be hashed is no number either
        return Regularization(damping, eigenvalue_floor, epsilon)


def regularized(
    remedy: Regularization, domain: ArrayLike, name: str, dimension: int | None = None
) -> tuple[Array, float]:
    """Return a domain's regularized ellipsoids (n, d, d), which are not all equal, and the ε added to them."""
    points = as_finite(domain, name)
    if points.ndim != 3 or not points.size:
        points = as_points(points, name)  # raises, with the reason
    fitted = remedy.fitted(points, name)
    cloud = as_points(fitted.apply(points, name, dimension), name)
    if np.abs(cloud - cloud[0]).max() <= 1e-12 * np.abs(cloud[0]).max():
        raise InvalidInputError(
            f"{name} has no dispersion: all {len(cloud)} ellipsoids are equal; a domain needs different ones"
        )
    return cloud, fitted.epsilon


def without_damping(points: Array, damping: float) -> Array:
    """Subtract ε I from each matrix (n, d, d) where a positive semidefinite one remains."""
    if damping == 0.0:
        return points
    bare = points - damping * np.eye(points.shape[-1])
    lowest = eigh(bare)[0][:, 0]
    rounding = (lowest < 0) & (lowest >= -1e-9 * np.trace(points, axis1=-2, axis2=-1))
    bare[rounding] = apply(bare[rounding], lambda values: np.maximum(values, 0.0))
    return np.where((rounding | (lowest >= 0))[:, None, None], bare, points)


def require_positive(images: Array) -> None:
    """Raise when an image is singular up to `SPD_TOLERANCE`."""
    if vouched(images, None, SPD_TOLERANCE, copy=False) is not None:
        return
    values, _ = eigh(images)
    shares = values[..., 0] / values.sum(axis=-1)
    if not np.all(shares > SPD_TOLERANCE):
        index = np.unravel_index(np.argmin(shares), shares.shape)
        place = f"[{', '.join(str(int(i)) for i in index)}]" if index else ""
        raise NotSPDError(
            f"points{place} has an image whose eigenvalues are too far apart for floating-point numbers: "
            f"the largest is {values[index][-1]:.3g}, and the smallest is lost in its rounding"
        )
