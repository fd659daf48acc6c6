"""The joint coordinates of an arm or a group, with samples and limits."""

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.manipulability import VELOCITY, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.util.notebook import NotebookDisplay
from maniport.util.sobol import sobol
from maniport.util.validation import Array, as_choice, as_count, as_finite, as_generator, as_numbers


class JointSpace(NotebookDisplay):
    """Configurations of an arm or a group, shape (..., dof); the attributes are described at `maniport.arms.Arm`."""

    def __init__(
        self,
        name: str,
        joint_names: tuple[str, ...],
        lower: Array,
        upper: Array,
        velocity_limits: Array | None,
        effort_limits: Array | None,
        joint_units: tuple[str, ...],
    ):
        self.name = name
        self.dof = len(joint_names)
        self.joint_names = joint_names
        self.joint_units = joint_units
        self.lower = np.array(lower, dtype=np.float64)
        self.upper = np.array(upper, dtype=np.float64)
        self.velocity_limits, self.effort_limits = (
            None
            if limits is None or np.all(np.isinf(limits))
            else np.array(limits, dtype=np.float64)
            for limits in (velocity_limits, effort_limits)
        )
        for array in (self.lower, self.upper, self.velocity_limits, self.effort_limits):
            if array is not None:
                array.setflags(write=False)

    def sample(self, n: int, random_state: Any = None, sequence: str = "sobol") -> Array:
        """Draw configurations that fill the joint limits.

        Parameters
        ----------
        n : int
            Number of configurations; powers of two keep the balance of a Sobol sequence.
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
        """Return whether configurations respect all joint limits (to 1e-6 rad or m), bool of shape (...)."""
        return ~self._outside(self.configurations(q)).any(axis=-1)

    def require_within_limits(
        self, q: ArrayLike, name: str = "q", *, single: bool = False
    ) -> Array:
        """Return configurations, or a single one, as an array; an error names the first joint outside its limits."""
        array = self.configurations(q, name)
        outside = self._outside(array)
        if single and array.ndim != 1:
            raise InvalidInputError(
                f"{name} must be one configuration, shape ({self.dof},); found shape {array.shape}"
            )
        if np.any(outside):
            index = tuple(np.argwhere(outside)[0].tolist())
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

    def checked_spec(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """Require numbers or limits of all joints for the ellipsoids of a specification."""
        if not isinstance(spec, EllipsoidSpec):
            raise InvalidInputError(
                f"spec must be an EllipsoidSpec, such as EllipsoidSpec('force'); found {spec!r}"
            )
        if isinstance(spec.joint_weights, str):
            self._limits(spec.kind)
        elif spec.joint_weights is not None:
            as_numbers(spec.joint_weights, "joint_weights", self.dof, above=0.0)
        return spec

    def _limits(self, kind: str) -> Array:
        """Return the velocity or effort limits (dof,) for a kind of ellipsoids, all finite and above 0."""
        if kind == "velocity":
            name = "velocity"
            limits = self.velocity_limits
        else:
            name = "effort"
            limits = self.effort_limits
        if limits is None or not np.all(np.isfinite(limits) & (limits > 0.0)):
            missing = []
            for i, n in enumerate(self.joint_names):
                if limits is None or not 0.0 < limits[i] < np.inf:
                    missing.append(n)
            raise InvalidInputError(
                f"joint_weights: {self.name!r} has no {name} limits above 0 for {', '.join(missing)}; add them to the "
                "robot's description, set them with Arm.with_limits, or give numbers"
            )
        return limits

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
        """Compute manipulability matrices of velocity or force.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        kind, part, joint_weights
            As in `EllipsoidSpec`; `InvalidInputError` when limits are not known.

        Returns
        -------
        ndarray, shape (..., d, d), of a group (..., n_arms, d, d)
            Exactly symmetric matrices. Singular ellipsoids of velocity are returned as they are; the
            force ellipsoid of a singular configuration raises `NotSPDError`.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights))
