"""The contract of transfer methods: fit, transform, inverse_transform, score, save.

A method supplies `_fit`, `_map` and `_map_back`, and works on regularized ellipsoids in the student's frame.
Checks, base rotation, regularization and files are here.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

import maniport.transfer.ellipsoids as ellipsoids
from maniport.errors import InvalidInputError, NotFittedError
from maniport.estimator import Estimator, clone
from maniport.spd.affine_invariant import distance_unchecked
from maniport.spd.kernels import congruence, eigh
from maniport.spd.mean import dispersion, mean
from maniport.spd.neighbors import nearest
from maniport.spd.regularization import Regularization
from maniport.transfer.adapter_file import METHODS_BY_CLASS, SCHEMA, Schema, save_adapter
from maniport.transfer.rotation_group import orthonormal, rotation_angle
from maniport.util.notebook import NotebookDisplay
from maniport.util.validation import SPD_TOLERANCE, Array, as_points, as_positive_semidefinite

RELEASED = 1.0 - 1e-6  # Share of the damping that is subtracted from images; the rest keeps them SPD


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
        Fréchet means of the regularized domains, in the student's base frame.
    teacher_dispersion_, student_dispersion_ : float
        Dispersions of the regularized domains.
    converged_, n_iter_, stop_reason_ : bool, int, str
        Convergence, number of iterations, and why the fit ended.
    cost_ : float
        Final cost; each method defines it.
    history_ : ndarray, shape (k + 1,)
        The cost at the start and after each of k iterations.
    teacher_damping_, student_damping_ : float
        ε that was added to each domain, in the unit of M; zero without damping.
    released_damping_ : float
        Part of `student_damping_` that `transform` subtracts from the images, which leaves all of them
        positive-definite. Constant, so that the map is smooth and invertible; the length field is an exception.
    """

    schema: ClassVar[Schema] = SCHEMA  # attributes in files, with their shapes and checks
    value_objects: ClassVar[dict[str, Any]] = {}  # further attributes, by the class that reads them
    option_classes: ClassVar[tuple[type, ...]] = ()  # bases of the parameters that are objects

    _silent = False

    def __init__(
        self,
        damping: float | None = None,
        eigenvalue_floor: float | None = None,
        base_rotation: ArrayLike | None = None,
    ):
        self.damping = damping
        self.eigenvalue_floor = eigenvalue_floor
        self.base_rotation = base_rotation

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        METHODS_BY_CLASS[cls.__name__] = cls

    def __repr__(self) -> str:
        parameters = super().__repr__()
        if not is_fitted(self):
            return parameters
        angle = np.degrees(rotation_angle(np.eye(len(self.map_rotation_)), self.map_rotation_))
        rotation = [self.identifiability_.in_words()] if hasattr(self, "identifiability_") else []
        facts = [f"rotation {angle:.1f}°, s = {self.dispersion_ratio_:.3g}", self.stop_reason_, *rotation]
        return f"{parameters}  # fitted: {'; '.join(facts)}"

    @abstractmethod
    def _fit(self, teacher: Array, student: Array) -> None:
        """Set the fitted attributes from two regularized domains in one frame, shapes (n, d, d) and (m, d, d)."""

    @abstractmethod
    def _map(self, points: Array) -> tuple[Array, float]:
        """Map regularized teacher ellipsoids (n, d, d) in the student's frame; also return the damping to subtract."""

    @abstractmethod
    def _map_back(self, points: Array) -> Array:
        """Map damped student ellipsoids (n, d, d) to damped teacher ellipsoids in the student's frame."""

    def _images(self, points: Array) -> Array:
        """Map as `_map` does, and subtract the damping."""
        mapped, released = self._map(points)
        diagonals = np.einsum("...ii->...i", mapped)
        diagonals -= released
        return mapped

    def _damped_again(self, points: ArrayLike) -> Array:
        """Check the student's ellipsoids (..., d, d) and add the damping that `_images` subtracted."""
        return self._regularization(self.released_damping_).apply(points, "points", self._dimension())

    def _map_rotation(self) -> Array:
        """Rotation of ellipsoids by the map in the student's frame, shape (d, d)."""
        return np.eye(self._dimension())

    def fit(self, teacher: ArrayLike, student: ArrayLike) -> Self:
        """Learn the map from samples of both domains.

        Parameters
        ----------
        teacher : array_like, shape (n, d, d)
            Samples of the teacher's reachable ellipsoids.
        student : array_like, shape (m, d, d)
            Samples of the student's reachable ellipsoids; m may differ from n.

        Raises
        ------
        NotSPDError
            When an ellipsoid is asymmetric, indefinite, or singular without regularization.
        InvalidInputError
            When a domain has fewer than two ellipsoids or no dispersion, sizes differ, or a parameter is invalid.
        """
        return self._fit_or_restore(teacher, student, self._fit)

    def fit_transform(self, teacher: ArrayLike, student: ArrayLike) -> Array:
        """Learn the map as `fit` does, and return the teacher's samples mapped, shape (n, d, d)."""
        return self.fit(teacher, student).transform(teacher)

    def _fit_or_restore(self, teacher: ArrayLike, student: ArrayLike, learn: Callable[[Array, Array], None]) -> Self:
        """Check, regularize and rotate both domains and `learn` from them; a failure changes nothing."""
        cloud_t, damping_t = ellipsoids.regularized(self._regularization(), teacher, "teacher")
        cloud_s, damping_s = ellipsoids.regularized(self._regularization(), student, "student", cloud_t.shape[-1])
        base_rotation = ellipsoids.as_base_rotation(self.base_rotation, cloud_t.shape[-1])
        before = dict(vars(self))
        try:
            self.teacher_damping_, self.student_damping_, self.base_rotation_ = damping_t, damping_s, base_rotation
            learn(self._in_student_frame(cloud_t), cloud_s)
        except BaseException:  # a mixture of two fits would map wrongly
            self.__dict__.clear()
            self.__dict__.update(before)
            raise
        return self

    def transform(self, points: ArrayLike) -> Array:
        """Map ellipsoids of the teacher to the student.

        Parameters
        ----------
        points : array_like, shape (..., d, d)
            The teacher's ellipsoids; they get the same regularization as the teacher's domain.

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
        images = self._images(seen.reshape(-1, d, d)).reshape(seen.shape)
        ellipsoids.require_positive(images)
        return images

    def inverse_transform(self, points: ArrayLike) -> Array:
        """Map ellipsoids of the student back to the teacher; undoes `transform`.

        Parameters
        ----------
        points : array_like, shape (..., d, d)
            The student's ellipsoids. Singular ones are regularized as the domain was.

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
        if self.eigenvalue_floor is not None:  # only singular input is raised: images may lie below the floor
            student = as_positive_semidefinite(points, "points", d)
            regular = self.student_regularization.apply(student, "points", d)
            lowest = eigh(student)[0][..., 0]
            keep = lowest > SPD_TOLERANCE * np.trace(student, axis1=-2, axis2=-1)
            regular = np.where(keep[..., None, None], student, regular)
        else:
            regular = self._damped_again(points)
        back = self._map_back(regular.reshape(-1, d, d))
        if self.base_rotation_ is not None:
            back = congruence(self.base_rotation_.T, back)
        return ellipsoids.without_damping(back, self.teacher_damping_).reshape(regular.shape)

    def compiled(self) -> Callable[[Array], Array]:
        """Return the map of one ellipsoid (d, d) at a time, as a callable: `maniport.transfer.control.CompiledMap`."""
        self._dimension()
        return self.transform

    def errors(self, points: ArrayLike, truth: ArrayLike) -> Array:
        """Distances, shape (n,), from the teacher's `points`, (n, d, d), adapted, to the true ones in the same order.

        Measured between regularized ellipsoids, as in `fit`; those of other regularizations are not comparable.
        """
        mapped, target = self._compared(points, truth)
        if len(mapped) != len(target):
            raise InvalidInputError(f"points and truth must be equally many; found {len(mapped)} and {len(target)}")
        return distance_unchecked(target, mapped)

    def gaps(self, points: ArrayLike, cloud: ArrayLike) -> Array:
        """Distance from each adapted ellipsoid to the nearest of a cloud of the student's, shape (n,).

        Measured between regularized ellipsoids; gaps below the cloud's own spacing are noise.
        """
        mapped, student = self._compared(points, cloud)
        return nearest(mapped, student)[1]

    def score(self, teacher: ArrayLike, student: ArrayLike) -> float:
        """Minus the root mean squared gap (see `gaps`): larger is better, as in scikit-learn's model selection.

        It cannot choose the damping: more damping makes all ellipsoids rounder and every gap smaller.
        """
        return -float(np.sqrt(np.mean(self.gaps(teacher, student) ** 2)))

    def silent(self) -> Self:
        """Return an unfitted clone that learns the same map, without `identifiability_`, reports and their warnings."""
        copy: Self = clone(self)
        copy._silent = True
        return copy

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the fitted adapter to an ``.npz`` file; `load_adapter` reads it."""
        self._dimension()
        save_adapter(self, path)

    def _describe(self, teacher: Array, student: Array, spread: str = "mean") -> None:
        """Set means and dispersions of regularized domains, and the identity as the map."""
        self.teacher_mean_, self.student_mean_ = mean(teacher), mean(student)
        self.teacher_dispersion_ = dispersion(teacher, self.teacher_mean_, spread)
        self.student_dispersion_ = dispersion(student, self.student_mean_, spread)
        self.rotation_, self.dispersion_ratio_, self.released_damping_ = np.eye(teacher.shape[-1]), 1.0, 0.0

    def _set_closed_form(self, reason: str, cost: float = 0.0) -> None:
        """Set the convergence attributes of a fit without iterations."""
        self.cost_, self.history_ = cost, np.array([cost])
        self.converged_, self.n_iter_, self.stop_reason_ = True, 0, reason

    def _compared(self, teacher: ArrayLike, student: ArrayLike) -> tuple[Array, Array]:
        """Map the teacher's ellipsoids; return them and the student's, both with the student's regularization."""
        d = self._dimension()
        mapped, _ = self._map(as_points(self.teacher_side(teacher, "points"), "points", d, 1))
        return mapped, as_points(self.student_side(student, "student"), "student", d, 1)

    def teacher_side(self, points: ArrayLike, name: str = "points") -> Array:
        """Return the teacher's ellipsoids as the fit saw them: regularized, in the student's frame; (..., d, d)."""
        return self._in_student_frame(self.teacher_regularization.apply(points, name, self._dimension()))

    def student_side(self, points: ArrayLike, name: str = "points") -> Array:
        """Return the student's ellipsoids as the fit saw them: regularized, shape (..., d, d)."""
        return self.student_regularization.apply(points, name, self._dimension())

    def _in_student_frame(self, points: Array) -> Array:
        """Express the teacher's ellipsoids in the student's frame, R_b T R_bᵀ."""
        return points if self.base_rotation_ is None else congruence(self.base_rotation_, points)

    @property
    def map_rotation_(self) -> Array:
        """Rotation of ellipsoids by the map, from the teacher's base frame to the student's, shape (d, d).

        The path of the hand needs the same rotation. For d = 6 it is the base rotation, shape (3, 3).
        """
        d = self._dimension()
        if d == 6:
            base = np.eye(6) if self.base_rotation_ is None else self.base_rotation_
            return orthonormal(base[:3, :3] + base[3:, 3:])
        return self._map_rotation() if self.base_rotation_ is None else self._map_rotation() @ self.base_rotation_

    @property
    def teacher_regularization(self) -> Regularization:
        """Regularization of the teacher's ellipsoids in the fit."""
        self._dimension()
        return self._regularization(self.teacher_damping_)

    @property
    def student_regularization(self) -> Regularization:
        """Regularization of the student's ellipsoids in the fit."""
        self._dimension()
        return self._regularization(self.student_damping_)

    def _regularization(self, epsilon: float = 0.0) -> Regularization:
        return ellipsoids.regularization_of(self.damping, self.eigenvalue_floor, float(epsilon))

    def _dimension(self) -> int:
        if not hasattr(self, "teacher_mean_"):
            raise NotFittedError(f"this {type(self).__name__} is not fitted yet; call fit(teacher, student) first")
        return len(self.teacher_mean_)


def is_fitted(adapter: DomainAdapter) -> bool:
    """Whether a fit has come to its end, by its last attribute."""
    return hasattr(adapter, "released_damping_")
