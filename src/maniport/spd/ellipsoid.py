"""What an SPD matrix looks like: axes, lengths and volume of the ellipsoid xᵀ M⁻¹ x = 1."""

from math import gamma, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.spd.kernels import eigh
from maniport.util.validation import Array, as_positive_semidefinite, as_scalar


def axes(points: ArrayLike) -> tuple[Array, Array]:
    """Semi-axis lengths and directions.

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        Positive semidefinite; a singular ellipsoid has axes of length zero.

    Returns
    -------
    lengths : ndarray, shape (..., d)
        Square roots of the eigenvalues, ascending, in the unit of √M.
    directions : ndarray, shape (..., d, d)
        Unit columns in the order of the lengths. Signs carry no meaning, nor do directions of equal lengths.
    """
    values, vectors = eigh(as_positive_semidefinite(points, "points"))
    return np.sqrt(np.maximum(values, 0.0)), vectors


def lengths(points: ArrayLike) -> Array:
    """Semi-axis lengths, ascending, shape (..., d).

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        Positive semidefinite.

    Returns
    -------
    ndarray, shape (..., d)
    """
    return axes(points)[0]


def volume(points: ArrayLike) -> Array | np.float64:
    """Volume of the ellipsoid (area for d = 2): that of the unit ball times the product of the semi-axes.

    Parameters
    ----------
    points : array_like, shape (..., d, d)
        Positive semidefinite.

    Returns
    -------
    ndarray, shape (...), or float for one ellipsoid
    """
    semi_axes = lengths(points)
    volumes = unit_ball_volume(semi_axes.shape[-1]) * np.prod(semi_axes, axis=-1)
    return as_scalar(np.asarray(volumes))


def unit_ball_volume(d: int) -> float:
    """Volume of the unit ball in d dimensions: π for d = 2, 4π/3 for d = 3."""
    return float(pi ** (d / 2) / gamma(d / 2 + 1))


def line_angles(first: Array, other: Array) -> Array:
    """Angles between lines along unit vectors (..., d), shape (...) [rad], at most π/2."""
    along = np.einsum("...i,...i->...", first, other)
    # the arc tangent keeps small angles, which the arc cosine would lose
    across = np.linalg.norm(first - along[..., None] * other, axis=-1)
    return np.asarray(np.arctan2(across, np.abs(along)))


def axis_angles(points: Array, others: Array, which: int) -> Array:
    """Angles [degrees] between the major (−1) or minor (0) axes of ellipsoids (n, d, d), where both are distinct."""
    values, vectors = eigh(points)
    other_values, other_vectors = eigh(others)
    clear = _distinct(values, which) & _distinct(other_values, which)
    return np.degrees(line_angles(vectors[clear][..., which], other_vectors[clear][..., which]))


def _distinct(values: Array, which: int) -> NDArray[np.bool_]:
    """Whether the first or last of ascending eigenvalues (n, d) differs from the next one by more than 5 %."""
    if which == -1:
        high = values[:, -1]
        low = values[:, -2]
    else:
        high = values[:, 1]
        low = values[:, 0]
    return np.asarray(high - low > 0.05 * high)


def axis_over_time(points: Array, which: int, like: Array | None = None) -> Array:
    """Return unit vectors along the major (−1) or minor (0) axes; nan where semi-axes have a ratio above 0.97.

    Signs are continuous, but change where an axis is more than 120° from that of `like`.
    """
    semi_axes, directions = axes(points)
    if which == -1:
        short = semi_axes[:, -2]
        long = semi_axes[:, -1]
    else:
        short = semi_axes[:, 0]
        long = semi_axes[:, 1]
    defined = np.flatnonzero(short < 0.97 * long)
    vectors = np.full(directions.shape[:2], np.nan)
    if len(defined) == 0:
        return vectors
    kept = directions[defined, :, which]
    turned = np.sum(kept[1:] * kept[:-1], axis=1) < 0
    kept[1:] *= np.where(np.cumsum(turned) % 2, -1.0, 1.0)[:, None]
    kept *= np.sign(kept[0, np.argmax(np.abs(kept[0]))])
    if like is not None:
        agreement = np.sum(kept * like[defined], axis=1)
        sign = 1.0
        allowed = 0.0
        for k in np.flatnonzero(np.isfinite(agreement)):
            if sign * agreement[k] < allowed:
                kept[k:] *= -1.0
                sign = -sign
            allowed = -0.5
    vectors[defined] = kept
    return vectors
