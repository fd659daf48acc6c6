"""Damping, which makes singular ellipsoids positive-definite: the same for domains, profiles, placement and tracking.

An outstretched arm cannot move along itself: one axis of its ellipsoid is zero, and the distance to every other
ellipsoid infinite. Damping ρ adds ε I with ε = ρ tr(mean of the domain) / d, one ε for a whole domain. It is smooth,
has no unit, turns with the frame, and means damped least squares.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.spd.kernels import compose, eigh
from maniport.spd.kernels.loops import KAPPA
from maniport.spd.matrix_functions import apply
from maniport.util.validation import (
    SPD_TOLERANCE,
    Array,
    as_number,
    as_positive_semidefinite,
    as_spd,
)

HINT = "Singular ellipsoids need regularization: give damping=0.01 (adds 1 % of the domain's mean eigenvalue)"


@dataclass(frozen=True)
class Regularization:
    """Damping of ellipsoids before they are compared, or none."""

    damping: float | None = None  # ρ, relative to the mean eigenvalue of a domain
    epsilon: float = 0.0  # ε, what is added to all eigenvalues, in the unit of M

    def __post_init__(self) -> None:
        if self.damping is not None:
            object.__setattr__(self, "damping", as_number(self.damping, "damping", above=0.0))

    def fitted(self, domain: ArrayLike, name: str = "domain") -> Self:
        """Return the same with the ε of a domain, shape (n, d, d): ρ tr(mean) / d; zero without damping."""
        if self.damping is None:
            return self
        points = as_positive_semidefinite(domain, name)
        return replace(
            self, epsilon=float(self.damping * np.trace(points.mean(axis=0)) / points.shape[-1])
        )

    def apply(self, points: ArrayLike, name: str = "points", dimension: int | None = None) -> Array:
        """Return SPD matrices, shape (..., d, d), or raise `NotSPDError` with advice when nothing is to be done."""
        if self.damping is None and self.epsilon == 0.0:
            return as_spd(points, name, dimension, hint=HINT)
        damped = as_positive_semidefinite(points, name, dimension)  # an array of its own
        diagonals = np.einsum("...ii->...i", damped)
        diagonals += self.epsilon
        if self.epsilon > 4.0 * SPD_TOLERANCE * damped.shape[-1] * diagonals.max(initial=0.0):
            return damped  # no eigenvalue was below zero but for rounding, so that all are above it now
        return as_spd(damped, name, dimension)

    def __str__(self) -> str:
        if self.damping is not None:
            return f"damping {self.damping:g}"
        if self.epsilon:
            return f"damping of {self.epsilon:.3g}"
        return "none"


def damped_again(points: Array, epsilon: float) -> Array:
    """Undo `maniport.spd.kernels.release`; eigenvalues of zero become ε."""
    values, vectors = eigh(points)
    flat = values <= SPD_TOLERANCE * values.sum(axis=-1, keepdims=True)
    lengths = np.where(flat, np.sqrt(KAPPA) * epsilon, values)
    return compose(
        np.where(flat, epsilon, lengths * (lengths + epsilon) / (lengths + KAPPA * epsilon)),
        vectors,
    )


def without_damping(points: Array, damping: float) -> Array:
    """Subtract ε I from each matrix (n, d, d) where a positive semidefinite one remains."""
    if damping == 0.0:
        return points
    bare = points - damping * np.eye(points.shape[-1])
    lowest = eigh(bare)[0][:, 0]
    rounding = (lowest < 0) & (lowest >= -1e-9 * np.trace(points, axis1=-2, axis2=-1))
    bare[rounding] = apply(bare[rounding], lambda values: np.maximum(values, 0.0))
    return np.where((rounding | (lowest >= 0))[:, None, None], bare, points)
