"""The joint coordinates of an arm or a pair, with samples and limits, and the ellipsoids of what moves one frame."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability, principal_axes
from maniport.errors import InvalidInputError
from maniport.util.notebook import NotebookDisplay
from maniport.util.sobol import sobol
from maniport.util.validation import Array, as_choice, as_count, as_finite, as_generator


class JointSpace(NotebookDisplay):
    """Configurations of an arm or a pair, shape (..., dof); the attributes are described at `maniport.arms.Arm`."""

    def __init__(
        self,
        name: str,
        joint_names: tuple[str, ...],
        lower: Array,
        upper: Array,
        velocity_limits: Array | None,
        joint_units: tuple[str, ...],
    ):
        self.name = name
        self.dof = len(joint_names)
        self.joint_names = joint_names
        self.lower = _read_only(lower)
        self.upper = _read_only(upper)
        self.velocity_limits = None if velocity_limits is None else _read_only(velocity_limits)
        self.joint_units = joint_units

    def sample(self, n: int, random_state: Any = None, sequence: str = "sobol") -> Array:
        """Draw configurations that fill the joint limits.

        Parameters
        ----------
        n : int
            How many. Powers of two keep the balance of a Sobol sequence and are the best choice; other numbers take
            the first n points of the sequence.
        random_state : None, int or numpy.random.Generator
            Seed: the same seed gives the same bits, and the first points are the same for every n.
        sequence : {"sobol", "uniform"}
            Scrambled Sobol points, which cover the limits more evenly, or independent uniform ones.

        Returns
        -------
        ndarray, shape (n, dof)
        """
        count = as_count(n, "n")
        as_choice(sequence, "sequence", ("sobol", "uniform"))
        generator = as_generator(random_state)
        if sequence == "uniform":
            unit = generator.random((count, self.dof))
        else:
            unit = sobol(self.dof, (count - 1).bit_length(), generator)[:count]
        return np.clip(self.lower + unit * (self.upper - self.lower), self.lower, self.upper)

    def within_limits(self, q: ArrayLike) -> Any:
        """Whether configurations respect all joint limits (to 1e-6 rad or m), bool of shape (...)."""
        return ~self._outside(self.configurations(q, "q")).any(axis=-1)

    def require_within_limits(self, q: ArrayLike, name: str = "q", *, single: bool = False) -> Array:
        """Return configurations, or a single one, as an array if they respect the joint limits (to 1e-6 rad or m).

        Raises
        ------
        InvalidInputError
            Naming the first joint outside, its index, value and limits.
        """
        array = self.configurations(q, name)
        outside = self._outside(array)
        if single and array.ndim != 1:
            raise InvalidInputError(f"{name} must be one configuration, shape ({self.dof},); found shape {array.shape}")
        if np.any(outside):
            index = tuple(int(i) for i in np.argwhere(outside)[0])
            j = index[-1]
            raise InvalidInputError(
                f"{name}[{', '.join(map(str, index))}] = {array[index]:.6g} lies outside the limits "
                f"{self.lower[j]:.6g} to {self.upper[j]:.6g} of joint {self.joint_names[j]!r} of {self.name!r} "
                f"({int(outside.sum())} of {outside.size} values lie outside)"
            )
        return array

    def _outside(self, q: Array, tolerance: float = 1e-6) -> Any:
        return (q < self.lower - tolerance) | (q > self.upper + tolerance)

    def configurations(self, q: ArrayLike, name: str = "q") -> Array:
        """Require finite configurations, shape (..., dof), within limits or not; `name` is for messages."""
        array = as_finite(q, name)
        if array.ndim < 1 or array.shape[-1] != self.dof:
            raise InvalidInputError(
                f"{name} must have shape (..., {self.dof}), one value for each joint of {self.name!r} "
                f"({', '.join(self.joint_names)}); found shape {array.shape}"
            )
        return array

    def resolved(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """The same ellipsoids with numbers for joint weights, one for each joint, where it has words."""
        if not isinstance(spec, EllipsoidSpec):
            raise InvalidInputError(f"spec must be an EllipsoidSpec, such as EllipsoidSpec('force'); found {spec!r}")
        if isinstance(spec.joint_weights, str):
            speeds = self.velocity_limits
            if speeds is None or not np.all(np.isfinite(speeds)):
                unknown = [n for i, n in enumerate(self.joint_names) if speeds is None or not np.isfinite(speeds[i])]
                who = f"{self.name!r} has no velocity limits for {', '.join(unknown)}"
                raise InvalidInputError(f"joint_weights: {who}; give numbers instead")
            return replace(spec, joint_weights=speeds)
        spec.weights(self.dof)
        return spec

    @abstractmethod
    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices (..., d, d) that a specification describes; see `manipulability`."""

    def manipulability(
        self,
        q: ArrayLike,
        kind: str = "velocity",
        part: str = "translation",
        joint_weights: ArrayLike | str | None = None,
    ) -> Array:
        """Compute manipulability matrices ``J W² Jᵀ`` (velocity) or their inverses (force).

        Parameters
        ----------
        q : array_like, shape (..., dof)
            Configurations.
        kind, part, joint_weights
            Which ellipsoids, as in `EllipsoidSpec`. Singular velocity ellipsoids are returned as they are.

        Returns
        -------
        ndarray, shape (..., d, d), of a group (..., n_arms, d, d)
            Exactly symmetric matrices.

        Raises
        ------
        InvalidInputError
            When an argument has a wrong shape or value, or the velocity limits are not known.
        NotSPDError
            For the force ellipsoid of a singular configuration.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights))


class Manipulable(JointSpace):
    """A joint space that moves one frame: an arm, or both arms of a pair as one."""

    frame: str
    base: str | None
    locked: Mapping[str, float]

    @abstractmethod
    def forward(self, q: ArrayLike) -> Array:
        """Poses of the frame, shape (..., 4, 4) [m]."""

    @abstractmethod
    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobians of the frame, shape (..., 6, dof), linear rows first."""

    @abstractmethod
    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """What `forward` gives, and then what `differentials` does."""

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Manipulability matrices (..., d, d) of a specification; see `manipulability`."""
        return manipulability(self.jacobian(q), self.resolved(spec))

    def principal_axes(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
        """Semi-axis lengths (..., d), ascending, and directions (..., d, d), columns, of the ellipsoids.

        They come from the singular values of the Jacobian and are more accurate than an eigendecomposition of the
        matrix.
        """
        return principal_axes(self.jacobian(q), self.resolved(spec))

    def manipulability_jacobian(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Derivatives ``∂M/∂q_k`` of the manipulability matrices, shape (..., dof, d, d), exactly symmetric.

        In closed form, see `maniport.arms.manipulability_jacobian`; units are those of M for each radian or metre.
        """
        return self.differentials(q, spec)[2]

    def differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array]:
        """Return the results of `jacobian`, `ellipsoids` (up to rounding) and `manipulability_jacobian` at once."""
        return self.posed_differentials(q, spec)[1:]


def _read_only(array: Array) -> Array:
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy
