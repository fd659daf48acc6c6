"""The rigid map between two domains: recentre, dilate, rotate, move to the student's mean."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from maniport.spd.kernels import eigh, power_congruence
from maniport.spd.matrix_functions import MAX_EIGENVALUE, apply, congruence, roots
from maniport.transfer.rotation_group import orthonormal
from maniport.validation import Array


@dataclass(frozen=True)
class RigidMap:
    """f(T) = B (W T W)^s Bᵀ with W = T̄^-½ and B = S̄^½ R (Reithmeir et al. 2022, steps 1 to 4).

    T̄ and S̄ are the Fréchet means of the domains, R acts on recentred ellipsoids, all of shape (d, d), and s = c_S / c_T
    is the student's dispersion over the teacher's.
    """

    teacher_mean: Array
    student_mean: Array
    rotation: Array
    ratio: float

    @cached_property
    def _teacher_roots(self) -> tuple[Array, Array]:
        return roots(self.teacher_mean)

    @cached_property
    def _student_roots(self) -> tuple[Array, Array]:
        return roots(self.student_mean)

    @cached_property
    def _spread(self) -> Array:
        return np.asarray(self._student_roots[0] @ self.rotation)

    def apply(self, points: Array) -> Array:
        """Map SPD matrices (..., d, d) of the teacher to the student."""
        left, power, right = self.factors()
        return power_congruence(left, points, power, right)

    def invert(self, points: Array) -> Array:
        """Map SPD matrices (..., d, d) of the student to the teacher: T̄^½ (Rᵀ S̄^-½ S S̄^-½ R)^(1/s) T̄^½."""
        left, right = self.rotation.T @ self._student_roots[1], self._teacher_roots[0]
        return power_congruence(left, points, 1.0 / self.ratio, right)

    def factors(self) -> tuple[Array, float, Array]:
        """Return W, s and B."""
        return self._teacher_roots[1], self.ratio, self._spread

    def lowest_eigenvalue(self, damping: float) -> float:
        """Return a bound that no eigenvalue of f(T + ε I) falls below, whatever the ellipsoid T; ε = `damping`."""
        # the largest eigenvalue of the inverse image keeps digits that the smallest of the image would lose
        with np.errstate(over="ignore"):
            inverse = apply(self.teacher_mean / damping, lambda values: np.minimum(values**self.ratio, MAX_EIGENVALUE))
        inverse = congruence(self._student_roots[1] @ self.rotation, inverse)
        spectrum, _ = eigh(self.teacher_mean)
        highest = float(eigh(inverse)[0][-1]) * kantorovich(float(spectrum[-1] / spectrum[0]), self.ratio)
        return 1.0 / highest


def kantorovich(condition: float, power: float) -> float:
    """Kantorovich constant K(h, p) of Furuta (J. Inequal. Appl. 2, 1998) for condition h; one for p ≤ 1 or h = 1."""
    h, p = condition, power
    if p - 1.0 < 1e-9 or h - 1.0 < 1e-9:
        return 1.0
    if p * np.log(h) > 600.0:  # beyond floating-point numbers
        return float("inf")
    gap = (h**p - h) / (p - 1.0)
    return float(gap / (h - 1.0) * ((h**p - 1.0) / (p * gap)) ** p)


def recentre(points: Array, mean: Array, ratio: float = 1.0) -> Array:
    """Return (P^-½ X P^-½)^s, the points about the identity, dilated by `ratio`."""
    whitened = congruence(roots(mean)[1], points)
    return whitened if ratio == 1.0 else apply(whitened, lambda values: values**ratio)


def transport_rotation(teacher_mean: Array, student_mean: Array) -> Array:
    """Rotation of recentred ellipsoids that parallel transport amounts to: the polar factor of S̄^-½ T̄^½."""
    return orthonormal(roots(student_mean)[1] @ roots(teacher_mean)[0])
