"""The contract of transfer methods: fit, transform, inverse_transform, score, save.

A method supplies `_fit`, `_map` and `_map_back`, and works on damped ellipsoids in the student's frame. Checks, base
rotation, damping and files are here.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotFittedError
from maniport.estimator import Estimator
from maniport.spd.affine_invariant import distance_unchecked, nearest
from maniport.spd.kernels import congruence, release
from maniport.spd.mean import dispersion, mean
from maniport.spd.regularization import Regularization, damped_again, without_damping
from maniport.transfer.adapter_file import METHODS_BY_CLASS, SCHEMA, Schema, save_adapter
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import (
    Array,
    as_finite,
    as_points,
    as_positive_semidefinite,
    as_rotation,
    as_spd,
)


class DomainAdapter(NotebookDisplay, Estimator, ABC):
    """Base of the maps from a teacher's domain of SPD matrices to a student's. Parameters: see `ParallelTransport`.

    Attributes
    ----------
    base_rotation_ : ndarray, shape (d, d), or None
        R_b, from the teacher's base frame to the student's; None where the frames are the same.
    rotation_ : ndarray, shape (d, d)
        R, from recentered teacher ellipsoids to the student's, both in the student's base frame.
    dispersion_ratio_ : float
        s, the student's dispersion over the teacher's.
    teacher_mean_, student_mean_ : ndarray, shape (d, d)
        Fréchet means of the damped domains, in the student's base frame.
    teacher_dispersion_, student_dispersion_ : float
        Dispersions of the damped domains.
    converged_, n_iter_, stop_reason_ : bool, int, str
        Convergence, number of iterations, and why the fit ended.
    cost_ : float
        Final cost; each method defines it.
    history_ : ndarray, shape (k + 1,)
        The cost at the start and after each of k iterations.
    teacher_damping_, student_damping_ : float
        ε that was added to each domain, in the unit of M; zero without damping. `transform` takes the student's off
        its images, see `maniport.spd.kernels.release`.
    """

    schema: ClassVar[Schema] = SCHEMA  # required attributes, with their shapes and checks

    def __init__(self, damping: float | None = None, base_rotation: ArrayLike | None = None):
        self.damping = damping
        self.base_rotation = base_rotation

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        METHODS_BY_CLASS[cls.__name__] = cls

    def __repr__(self) -> str:
        if not is_fitted(self):
            return super().__repr__()
        angle = np.degrees(rotation_angle(np.eye(len(self.map_rotation_)), self.map_rotation_))
        fit = f"rotation {angle:.1f}°, s = {self.dispersion_ratio_:.3g}; {self.stop_reason_}"
        return f"{super().__repr__()}  # fitted: {fit}"

    @abstractmethod
    def _fit(self, teacher: Array, student: Array) -> None:
        """Set the fitted attributes from two damped domains in one frame, shapes (n, d, d) and (m, d, d)."""

    @abstractmethod
    def _map(self, points: Array) -> Array:
        """Map damped teacher ellipsoids (n, d, d) in the student's frame to damped student ellipsoids."""

    @abstractmethod
    def _map_back(self, points: Array) -> Array:
        """Map damped student ellipsoids (n, d, d) to damped teacher ellipsoids in the student's frame."""

    def _settle(self) -> None:
        """Prepare what the map needs from the fitted attributes, after a fit or the reading of a file."""

    @classmethod
    def class_of(cls, fitted: Mapping[str, object]) -> "type[DomainAdapter]":
        """Return the class of the map that attributes from a file describe: this one, unless it was renamed since."""
        return cls

    def with_projector(self, make: Callable[[], object]) -> Self:
        """Return a copy with a projector onto the student's feasible set, if the method uses one and has none.

        Parameters
        ----------
        make : callable
            Makes the projector, such as `maniport.motion.FeasibleProjector`; not called where none is needed.
        """
        is_free = self.get_params().get("projector", self) is None
        if not is_free or getattr(self, "from_samples_", False):
            return self
        return copy(self).set_params(projector=make())

    def failures(self) -> tuple[str, ...]:
        """Return the checks that the fitted map fails, in words; empty where it may be used."""
        return ()

    def _map_rotation(self) -> Array:
        """Rotation of ellipsoids by the map in the student's frame, shape (d, d)."""
        return np.eye(self._dimension())

    def fit(self, teacher: ArrayLike, student: ArrayLike) -> Self:
        """Learn the map from samples of both domains; a failed fit changes nothing.

        Parameters
        ----------
        teacher, student : array_like, shapes (n, d, d) and (m, d, d)
            Samples of the reachable ellipsoids of both; m may differ from n.

        Raises
        ------
        NotSPDError
            When an ellipsoid is asymmetric, indefinite, or singular without damping.
        InvalidInputError
            When a domain has fewer than two ellipsoids or no dispersion, sizes differ, or a parameter is invalid.
        """
        damping = self._unfitted_damping()
        cloud_t, damping_t = _damped_domain(damping, teacher, "teacher")
        cloud_s, damping_s = _damped_domain(damping, student, "student", cloud_t.shape[-1])
        base_rotation = as_base_rotation(self.base_rotation, cloud_t.shape[-1])
        before = dict(vars(self))
        try:
            self.teacher_damping_ = damping_t
            self.student_damping_ = damping_s
            self.base_rotation_ = base_rotation
            self._fit(self._in_student_frame(cloud_t), cloud_s)
            self._settle()
        except BaseException:  # a mixture of two fits would map wrongly
            self.__dict__.clear()
            self.__dict__.update(before)
            raise
        return self

    def _unfitted_damping(self) -> Regularization:
        """Return the damping of `fit`, before it is scaled by the domains."""
        return Regularization(self.damping)

    def transform(self, points: ArrayLike) -> Array:
        """Map ellipsoids of the teacher to the student.

        Parameters
        ----------
        points : array_like, shape (..., d, d)
            The teacher's ellipsoids; they get the same damping as the teacher's domain.

        Returns
        -------
        ndarray, shape (..., d, d)
            SPD.

        Raises
        ------
        NotFittedError
            Before `fit`.
        NotSPDError, InvalidInputError
            When the size differs from that of `fit`, or an image is singular in floating-point numbers.
        """
        d = self._dimension()
        seen = self.teacher_side(points, "points")
        images = self._map(seen.reshape(-1, d, d))
        if self.student_damping_ > 0.0:
            images = release(images, float(self.student_damping_))
        return as_spd(images.reshape(seen.shape), "the image of points", copy=False)

    def inverse_transform(self, points: ArrayLike) -> Array:
        """Map ellipsoids of the student back to the teacher; undoes `transform`.

        Parameters
        ----------
        points : array_like, shape (..., d, d)
            The student's ellipsoids. Singular ones get the damping of the domain.

        Returns
        -------
        ndarray, shape (..., d, d)
            An ellipsoid that is no image keeps the teacher's damping if it would not be SPD without.

        Raises
        ------
        NotFittedError
            Before `fit`.
        NotInvertibleError
            When the method has no inverse.
        """
        d = self._dimension()
        regular = self.student_side(points)
        if self.student_damping_ > 0.0:
            regular = damped_again(
                as_positive_semidefinite(points, "points", d), float(self.student_damping_)
            )
        back = self._map_back(regular.reshape(-1, d, d))
        if self.base_rotation_ is not None:
            back = congruence(self.base_rotation_.T, back)
        return without_damping(back, float(self.teacher_damping_)).reshape(regular.shape)

    def errors(self, points: ArrayLike, truth: ArrayLike) -> Array:
        """Distances, shape (n,), from the teacher's `points`, (n, d, d), adapted, to the true ones in the same order.

        Measured between damped ellipsoids, as in `fit`; those of other dampings are not comparable.
        """
        mapped, target = self._compared(points, truth)
        if len(mapped) != len(target):
            raise InvalidInputError(
                f"points and truth must be equally many; found {len(mapped)} and {len(target)}"
            )
        return distance_unchecked(target, mapped)

    def score(self, teacher: ArrayLike, student: ArrayLike) -> float:
        """Minus the root mean squared distance from mapped samples to the nearest of the student's: larger is better.

        scikit-learn's model selection uses it. It cannot choose the damping: more damping makes every distance smaller.
        """
        return -float(np.sqrt(np.mean(nearest(*self._compared(teacher, student))[1] ** 2)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the fitted adapter to an ``.npz`` file; `load_adapter` reads it."""
        self._dimension()
        save_adapter(self, path)

    def _describe(self, teacher: Array, student: Array) -> None:
        """Set means and dispersions of damped domains, and the identity as the map."""
        self.teacher_mean_ = mean(teacher)
        self.student_mean_ = mean(student)
        self.teacher_dispersion_ = dispersion(teacher, self.teacher_mean_)
        self.student_dispersion_ = dispersion(student, self.student_mean_)
        self.rotation_ = np.eye(teacher.shape[-1])
        self.dispersion_ratio_ = 1.0

    def _set_closed_form(self, reason: str, cost: float = 0.0) -> None:
        """Set the convergence attributes of a fit without iterations."""
        self.cost_ = cost
        self.history_ = np.array([cost])
        self.converged_ = True
        self.n_iter_ = 0
        self.stop_reason_ = reason

    def _compared(self, teacher: ArrayLike, student: ArrayLike) -> tuple[Array, Array]:
        """Map the teacher's ellipsoids; return them and the student's, both damped."""
        d = self._dimension()
        mapped = self._map(as_points(self.teacher_side(teacher, "points"), "points", d, 1))
        return mapped, as_points(self.student_side(student, "student"), "student", d, 1)

    def teacher_side(self, points: ArrayLike, name: str = "points") -> Array:
        """Return the teacher's ellipsoids as the fit saw them: damped, in the student's frame; (..., d, d)."""
        d = self._dimension()
        return self._in_student_frame(
            Regularization(epsilon=float(self.teacher_damping_)).apply(points, name, d)
        )

    def student_side(self, points: ArrayLike, name: str = "points") -> Array:
        """Return the student's ellipsoids as the fit saw them: damped, shape (..., d, d)."""
        return self.student_regularization.apply(points, name, self._dimension())

    def _in_student_frame(self, points: Array) -> Array:
        """Express the teacher's ellipsoids in the student's frame, R_b T R_bᵀ."""
        if self.base_rotation_ is None:
            return points
        return congruence(self.base_rotation_, points)

    @property
    def map_rotation_(self) -> Array:
        """Rotation of ellipsoids by the map, from the teacher's base frame to the student's, shape (d, d).

        The path of the hand needs the same rotation. For d = 6 it is the base rotation, shape (3, 3).
        """
        d = self._dimension()
        if d == 6:
            base = np.eye(6) if self.base_rotation_ is None else self.base_rotation_
            return orthonormal(base[:3, :3] + base[3:, 3:])
        if self.base_rotation_ is None:
            return self._map_rotation()
        return self._map_rotation() @ self.base_rotation_

    @property
    def student_regularization(self) -> Regularization:
        """Regularization of the student's ellipsoids in the fit."""
        self._dimension()
        return Regularization(epsilon=float(self.student_damping_))

    def _dimension(self) -> int:
        if not hasattr(self, "teacher_mean_"):
            raise NotFittedError(
                f"this {type(self).__name__} is not fitted yet; call fit(teacher, student) first"
            )
        return len(self.teacher_mean_)


def is_fitted(adapter: DomainAdapter) -> bool:
    """Whether a fit has come to its end."""
    return hasattr(adapter, "stop_reason_")


def as_base_rotation(base_rotation: ArrayLike | None, d: int) -> Array | None:
    """Check a base rotation and return it for ellipsoids of size d; None for equal frames."""
    if base_rotation is None:
        return None
    if d == 6 and np.shape(base_rotation) == (3, 3):
        rotation = np.asarray(
            np.kron(np.eye(2), as_rotation(base_rotation, "base_rotation", 3)), dtype=np.float64
        )
    else:
        rotation = as_rotation(base_rotation, "base_rotation", d)
    if np.array_equal(rotation, np.eye(d)):
        return None
    return rotation


def _damped_domain(
    damping: Regularization, domain: ArrayLike, name: str, dimension: int | None = None
) -> tuple[Array, float]:
    """Return a domain's damped ellipsoids (n, d, d), which are not all equal, and the ε added to them."""
    points = as_finite(domain, name)
    if points.ndim != 3 or not points.size:
        points = as_points(points, name)  # raises, with the reason
    fitted = damping.fitted(points, name)
    cloud = as_points(fitted.apply(points, name, dimension), name)
    if np.abs(cloud - cloud[0]).max() <= 1e-12 * np.abs(cloud[0]).max():
        raise InvalidInputError(
            f"{name} has no dispersion: all {len(cloud)} ellipsoids are equal; a domain needs different ones"
        )
    return cloud, fitted.epsilon
