"""Rigid maps f(T) = B (W T W)^s Bᵀ, W = T̄^-½, B = S̄^½ R; mean, parallel and scaled transport in closed form."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from maniport.spd.affine_invariant import nearest
from maniport.spd.kernels import congruence, power_congruence, roots
from maniport.spd.matrix_functions import apply
from maniport.transfer.adapter import DomainAdapter
from maniport.transfer.rotation_group import orthonormal
from maniport.util.validation import Array


@dataclass(frozen=True)
class RigidMap:
    """The map of steps 1 to 4 of Reithmeir et al. 2022."""

    teacher_mean: Array
    student_mean: Array
    rotation: Array
    ratio: float

    @cached_property
    def factors(self) -> tuple[Array, float, Array]:
        """W, s and B."""
        return (
            roots(self.teacher_mean)[1],
            self.ratio,
            np.asarray(roots(self.student_mean)[0] @ self.rotation),
        )

    def apply(self, points: Array) -> Array:
        """Map SPD matrices (..., d, d) of the teacher to the student."""
        left, power, right = self.factors
        return power_congruence(left, points, power, right)

    def invert(self, points: Array) -> Array:
        """Map SPD matrices (..., d, d) of the student to the teacher: T̄^½ (Rᵀ S̄^-½ S S̄^-½ R)^(1/s) T̄^½."""
        left = self.rotation.T @ roots(self.student_mean)[1]
        right = roots(self.teacher_mean)[0]
        return power_congruence(left, points, 1.0 / self.ratio, right)


def recenter(points: Array, mean: Array, ratio: float = 1.0) -> Array:
    """Return (P^-½ X P^-½)^s, the points about the identity, dilated by `ratio`."""
    whitened = congruence(roots(mean)[1], points)
    if ratio == 1.0:
        return whitened
    return apply(whitened, lambda values: values**ratio)


def transport_rotation(teacher_mean: Array, student_mean: Array) -> Array:
    """Rotation of recentered ellipsoids that parallel transport amounts to: the polar factor of S̄^-½ T̄^½."""
    return orthonormal(roots(student_mean)[1] @ roots(teacher_mean)[0])


class RigidAdapter(DomainAdapter):
    """Base of the adapters with a rigid map."""

    _rigid_map: RigidMap

    def _fit(self, teacher: Array, student: Array) -> None:
        self._describe(teacher, student)
        self.dispersion_ratio_ = self.student_dispersion_ / self.teacher_dispersion_
        self.rotation_ = transport_rotation(self.teacher_mean_, self.student_mean_)
        self._fit_rotation(teacher, student)

    @abstractmethod
    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        """Refine `rotation_`, which holds that of parallel transport, and set the attributes that describe the fit."""

    def _set_transport_cost(self, teacher: Array, student: Array) -> None:
        """Set the attributes of a fit in closed form, with the distances to the student's nearest ellipsoids."""
        self._settle()
        _, distances = nearest(self._map(teacher), student)
        self._set_closed_form("closed form", float(np.sqrt(np.mean(distances**2))))

    def _settle(self) -> None:
        parts = self.teacher_mean_, self.student_mean_, self.rotation_
        self._rigid_map = RigidMap(*parts, float(self.dispersion_ratio_))

    def _map_rotation(self) -> Array:
        """Polar factor of S̄^½ R T̄^-½."""
        left, _, right = self._rigid_map.factors
        return orthonormal(right @ left)

    def _map(self, points: Array) -> Array:
        return self._rigid_map.apply(points)

    def _map_back(self, points: Array) -> Array:
        return self._rigid_map.invert(points)


class MeanTransport(RigidAdapter):
    """Match the means only: f(T) = S̄^½ T̄^-½ T T̄^-½ S̄^½, without rotation and scaling.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`, which also rotates, by the polar factor of S̄^-½ T̄^½.
    """

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self.rotation_ = np.eye(teacher.shape[-1])
        self.dispersion_ratio_ = 1.0
        self._set_closed_form("closed form")


class ParallelTransport(RigidAdapter):
    """Move ellipsoids by the parallel transport from the teacher's mean to the student's, f(T) = E T Eᵀ.

    E = (S̄ T̄⁻¹)^½. The map is a congruence: distances between ellipsoids stay as they are, and so does the teacher's
    dispersion; `ScaledTransport` changes it to the student's. `base_rotation` determines the rotation, not the
    samples. After Yair, Ben-Chen and Talmon 2019 and Reithmeir et al. 2022, § IV-C.

    Parameters
    ----------
    damping : float, optional
        Add ε I, ε = damping · tr(mean of the domain) / d, to every ellipsoid; see `maniport.spd.regularization`.
        Default: none; then singular input is an error.
    base_rotation : array_like, shape (d, d), or (3, 3) for d = 6, optional
        R_b, rotation from the teacher's base frame to the student's, when the base orientation is known. The teacher's
        ellipsoids are first expressed in the student's frame, R_b T R_bᵀ. Default: the same frame.

    Attributes
    ----------
    cost_ : float
        Root mean squared distance from each mapped training ellipsoid to the nearest one of the student.

    References
    ----------
    Yair, Ben-Chen and Talmon, Parallel transport on the cone manifold of SPD matrices for domain adaptation, IEEE
    Trans. Signal Process. 67, 2019.
    """

    @classmethod
    def class_of(cls, fitted: Mapping[str, object]) -> type[DomainAdapter]:
        """Return `ScaledTransport` for a map with a dispersion, which earlier versions saved under this name."""
        if fitted["dispersion_ratio_"] != 1.0:
            return ScaledTransport
        return cls

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self.dispersion_ratio_ = 1.0
        self._set_transport_cost(teacher, student)


class ScaledTransport(RigidAdapter):
    """Parallel transport that also makes the dispersions equal: f(T) = S̄^½ Q (T̄^-½ T T̄^-½)^s Qᵀ S̄^½.

    Q is the rotation of `ParallelTransport`, and s the student's dispersion over the teacher's. With s = 1 both maps
    are the same. Steps 1, 2 and 4 of Reithmeir et al. 2022 with the rotation of their start; unlike there, the
    transported set is recentered with its own mean, and the transport is part of the map.

    Parameters
    ----------
    damping, base_rotation
        As in `ParallelTransport`.

    Attributes
    ----------
    cost_ : float
        As in `ParallelTransport`.

    References
    ----------
    Rodrigues, Jutten and Congedo, Riemannian Procrustes analysis: transfer learning for brain-computer interfaces, IEEE
    Trans. Biomed. Eng. 66, 2019: mean and dispersion.
    """

    def _fit_rotation(self, teacher: Array, student: Array) -> None:
        self._set_transport_cost(teacher, student)
