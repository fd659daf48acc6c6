"""Making singular ellipsoids positive-definite, the same way for domain and profile.

An outstretched arm cannot move along itself: one axis of its ellipsoid is zero, and the distance to every other
ellipsoid infinite. Two remedies are offered, and which one was used belongs to the adapter:

- damping ρ adds ε I with ε = ρ tr(mean of the domain) / d. It is smooth, has no unit, turns with the frame, and means
  damped least squares; one ε holds for a whole domain.
- a floor replaces eigenvalues below it (Reithmeir et al. 2022, footnote 1: 1e-4). It is not smooth, depends on units,
  and lets the floor's logarithm dominate distances.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError
from maniport.spd.matrix_functions import apply
from maniport.validation import SPD_TOLERANCE, Array, as_number, as_positive_semidefinite, as_spd

HINT = (
    "Singular ellipsoids need regularisation: give damping=0.01 (adds 1 % of the domain's mean axis) "
    "or floor=1e-4 (lifts smaller eigenvalues)"
)


@dataclass(frozen=True)
class Regularization:
    """What is done to singular ellipsoids: nothing, damping, or a floor.

    Attributes
    ----------
    damping : float or None
        ρ, relative.
    floor : float or None
        Smallest eigenvalue, in the unit of M.
    """

    damping: float | None = None
    floor: float | None = None

    def __post_init__(self) -> None:
        if self.damping is not None and self.floor is not None:
            raise InvalidInputError(
                f"damping and floor exclude one another; found damping={self.damping!r} and floor={self.floor!r}"
            )
        for name in ("damping", "floor"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, as_number(value, name, above=0.0))

    def amount(self, domain: ArrayLike, name: str) -> float:
        """Return ε for a domain, in the unit of M: what damping adds to every ellipsoid of it; else zero."""
        if self.damping is None:
            return 0.0
        points = as_positive_semidefinite(domain, name)
        return float(self.damping * np.trace(points.mean(axis=0)) / points.shape[-1])

    def apply(self, points: ArrayLike, amount: float, name: str, dimension: int | None = None) -> Array:
        """Return SPD matrices, shape (..., d, d), or raise `NotSPDError` with advice when there is no remedy."""
        if self.damping is None and self.floor is None:
            return as_spd(points, name, dimension, hint=HINT)
        matrices = as_positive_semidefinite(points, name, dimension)
        if self.floor is not None:
            lowest = self.floor
            return apply(matrices, lambda values: np.maximum(values, lowest))
        damped = matrices + amount * np.eye(matrices.shape[-1])
        traces = np.trace(damped, axis1=-2, axis2=-1)
        if amount > 4.0 * SPD_TOLERANCE * np.max(traces, initial=0.0):
            return damped  # no eigenvalue was below zero but for rounding, so that all are above it now
        return as_spd(damped, name, dimension)

    def __str__(self) -> str:
        if self.damping is not None:
            return f"damping {self.damping:g}"
        return "none" if self.floor is None else f"floor {self.floor:g}"
