"""What an SPD matrix looks like: axes, lengths, volume and condition of the ellipsoid xᵀ M⁻¹ x = 1."""

from math import gamma, pi

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.kernels import eigh
from maniport.validation import Array, as_positive_semidefinite, as_spd


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
    """Semi-axis lengths, ascending, shape (..., d)."""
    return axes(points)[0]


def volume(points: ArrayLike) -> Array:
    """Volume of the ellipsoid (area for d = 2): that of the unit ball times the product of the semi-axes."""
    semi_axes = lengths(points)
    d = semi_axes.shape[-1]
    return np.asarray(pi ** (d / 2) / gamma(d / 2 + 1) * np.prod(semi_axes, axis=-1))


def condition(points: ArrayLike) -> Array:
    """Condition number λ_max / λ_min of SPD matrices, shape (...); 1 for a ball, large near a singularity."""
    values, _ = eigh(as_spd(points, "points"))
    return np.asarray(values[..., -1] / values[..., 0])
