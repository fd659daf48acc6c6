"""The rigid map between two domains, and what the methods that fit one share."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from maniport.spd.kernels import eigh, power_congruence
from maniport.spd.matrix_functions import MAX_EIGENVALUE, apply, congruence, roots
from maniport.transfer.adapter import RELEASED, DomainAdapter
from maniport.transfer.identifiability import Identifiability
from maniport.transfer.rotation_group import orthonormal
from maniport.util.validation import Array, as_choice, as_flag

if TYPE_CHECKING:
    from maniport.transfer.control import CompiledMap


@dataclass(frozen=True)
class RigidMap:
    """f(T) = B (W T W)^s Bᵀ with W = T̄^-½ and B = S̄^½ R (Reithmeir et al. 2022, steps 1 to 4)."""

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


def recenter(points: Array, mean: Array, ratio: float = 1.0) -> Array:
    """Return (P^-½ X P^-½)^s, the points about the identity, dilated by `ratio`."""
    whitened = congruence(roots(mean)[1], points)
    return whitened if ratio == 1.0 else apply(whitened, lambda values: values**ratio)


def transport_rotation(teacher_mean: Array, student_mean: Array) -> Array:
    """Rotation of recentered ellipsoids that parallel transport amounts to: the polar factor of S̄^-½ T̄^½."""
    return orthonormal(roots(student_mean)[1] @ roots(teacher_mean)[0])


class RigidAdapter(DomainAdapter):
    """Base of the adapters whose map is f(T) = B (W T W)^s Bᵀ, W = T̄^-½, B = S̄^½ R."""

    value_objects: ClassVar[dict[str, Any]] = {"identifiability_": Identifiability}

    scale: bool
    dispersion: str
    _kept: tuple[Any, RigidMap]

    def _fit(self, teacher: Array, student: Array) -> None:
        self._center(teacher, student)
        self._fit_rotation(teacher, student)
        self._settle()

    def _center(self, teacher: Array, student: Array) -> None:
        """Set means, dispersions and their ratio, and `rotation_` to that of parallel transport."""
        as_choice(self.dispersion, "dispersion", ("mean", "rms"))
        as_flag(self.scale, "scale")
        self._describe(teacher, student, self.dispersion)
        if self.scale:
            self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.rotation_ = transport_rotation(self.teacher_mean_, self.student_mean_)

    def _settle(self) -> None:
        """Set what follows from the finished map."""
        self.released_damping_ = 0.0
        if self.teacher_damping_ > 0.0:  # what every image of the map certainly carries
            certain = self._rigid_map().lowest_eigenvalue(self.teacher_damping_)
            self.released_damping_ = RELEASED * min(self.student_damping_, certain)

    @abstractmethod
    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        """Refine `rotation_`, which holds the start, and set the attributes that describe the fit."""

    def _recentered(self, teacher: Array, student: Array) -> tuple[Array, Array]:
        """Both domains about the identity, the teacher dilated to the student's dispersion."""
        return recenter(teacher, self.teacher_mean_, self.dispersion_ratio_), recenter(student, self.student_mean_)

    def _map_rotation(self) -> Array:
        """Polar factor of S̄^½ R T̄^-½."""
        return orthonormal(roots(self.student_mean_)[0] @ self.rotation_ @ roots(self.teacher_mean_)[1])

    def compiled(self) -> "CompiledMap":
        """Return the map as a callable for one ellipsoid at a time, for control loops.

        It maps as `transform` does, in about a microsecond for d = 3, and allocates nothing when it is given `out`.
        Take it once, after `fit`; a later `fit` does not change it.

        Raises
        ------
        NotFittedError
            Before `fit`.
        """
        self._dimension()
        from maniport.transfer.control import compiled_map, map_rigidly

        left, power, right = self._rigid_map().factors()
        if self.base_rotation_ is not None:
            left = left @ self.base_rotation_
        floor = 0.0 if self.eigenvalue_floor is None else float(self.eigenvalue_floor)
        numbers = np.array([power, self.teacher_damping_, floor, self.released_damping_])
        return compiled_map(map_rigidly, len(left), *map(np.ascontiguousarray, (left, right)), numbers)

    def _map(self, points: Array) -> tuple[Array, float]:
        return self._rigid_map().apply(points), self.released_damping_

    def _map_back(self, points: Array) -> Array:
        return self._rigid_map().invert(points)

    def _rigid_map(self) -> RigidMap:
        """Return the map of the fitted attributes, which is kept until they change."""
        parts = self.teacher_mean_, self.student_mean_, self.rotation_, float(self.dispersion_ratio_)
        made_of = (*(part.tobytes() for part in parts[:3]), parts[3])
        kept = self.__dict__.get("_kept")
        if kept is None or kept[0] != made_of:
            kept = self._kept = made_of, RigidMap(*parts)
        return kept[1]

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: all but the kept map."""
        return {name: value for name, value in self.__dict__.items() if name != "_kept"}
