"""Making singular ellipsoids positive-definite: the same object for domains, profiles, placement and tracking.

An outstretched arm cannot move along itself: one axis of its ellipsoid is zero, and the distance to every other
ellipsoid infinite. Two remedies are offered, and which one was used belongs to the adapter:

- damping ρ adds ε I with ε = ρ tr(mean of the domain) / d. It is smooth, has no unit, turns with the frame, and means
  damped least squares; one ε holds for a whole domain.
- a floor replaces eigenvalues below it (Reithmeir et al. 2022, footnote 1: 1e-4). It is not smooth, depends on units,
  and lets the floor's logarithm dominate distances.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.matrix_functions import apply
from maniport.util.validation import SPD_TOLERANCE, Array, as_number, as_positive_semidefinite, as_spd

HINT = (
    "Singular ellipsoids need regularization: give damping=0.01 (adds 1 % of the domain's mean eigenvalue) "
    "or eigenvalue_floor=1e-4 (lifts smaller eigenvalues)"
)


@dataclass(frozen=True)
class Regularization:
    """What is done to singular ellipsoids before they are compared: nothing, damping, or a floor."""

    damping: float | None = None  # ρ, relative to the mean eigenvalue of a domain
    eigenvalue_floor: float | None = None  # Smallest eigenvalue, in the unit of M
    epsilon: float = 0.0  # ε, what is added to all eigenvalues, in the unit of M

    def __post_init__(self) -> None:
        if self.damping is not None and self.eigenvalue_floor is not None:
            raise InvalidInputError(
                f"damping and eigenvalue_floor exclude each other; found {self.damping!r} and {self.eigenvalue_floor!r}"
            )
        for name in ("damping", "eigenvalue_floor"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, as_number(value, name, above=0.0))

    @classmethod
    def absolute(cls, epsilon: float) -> Self:
        """Return what adds ε [unit of M] to all eigenvalues, whatever the domain."""
        return cls(epsilon=as_number(epsilon, "epsilon", above=0.0))

    def fitted(self, domain: ArrayLike, name: str = "domain") -> Self:
        """Return the same with the ε of a domain, shape (n, d, d): ρ tr(mean) / d; zero without damping."""
        if self.damping is None:
            return self
        points = as_positive_semidefinite(domain, name)
        return replace(self, epsilon=float(self.damping * np.trace(points.mean(axis=0)) / points.shape[-1]))

    def apply(self, points: ArrayLike, name: str = "points", dimension: int | None = None) -> Array:
        """Return SPD matrices, shape (..., d, d), or raise `NotSPDError` with advice when nothing is to be done."""
        if self.eigenvalue_floor is not None:
            lowest = self.eigenvalue_floor
            matrices = as_positive_semidefinite(points, name, dimension)
            return apply(matrices, lambda values: np.maximum(values, lowest))
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
        if self.eigenvalue_floor is not None:
            return f"floor {self.eigenvalue_floor:g}"
        return f"damping of {self.epsilon:.3g}" if self.epsilon else "none"
