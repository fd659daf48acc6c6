"""The joint coordinates of an arm or a pair, with samples and limits, and the ellipsoids of what moves one frame."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.kinematics import Kinematics
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, manipulability, principal_axes, with_derivatives
from maniport.errors import InvalidInputError
from maniport.util.notebook import NotebookDisplay
from maniport.util.sampling import sobol
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
        self.name, self.dof, self.joint_names, self.joint_units = name, len(joint_names), joint_names, joint_units
        self.lower, self.upper = np.array(lower, dtype=np.float64), np.array(upper, dtype=np.float64)
        self.velocity_limits = None if velocity_limits is None else np.array(velocity_limits, dtype=np.float64)
        for array in (self.lower, self.upper, self.velocity_limits):
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

    def require_within_limits(self, q: ArrayLike, name: str = "q", *, single: bool = False) -> Array:
        """Return configurations, or a single one, as an array; an error names the first joint outside its limits."""
        array = self.configurations(q, name)
        outside = self._outside(array)
        if single and array.ndim != 1:
            raise InvalidInputError(f"{name} must be one configuration, shape ({self.dof},); found shape {array.shape}")
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

    def resolved(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """Return the specification with numbers instead of words for joint weights, one for each joint."""
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
        kind, part, joint_weights
            As in `EllipsoidSpec`; `InvalidInputError` when velocity limits are not known.

        Returns
        -------
        ndarray, shape (..., d, d), of a group (..., n_arms, d, d)
            Exactly symmetric matrices. Singular velocity ellipsoids are returned as they are; the force ellipsoid of a
            singular configuration raises `NotSPDError`.
        """
        return self.ellipsoids(q, EllipsoidSpec(kind, part, joint_weights))


class Manipulable(JointSpace):
    """A joint space that moves one frame: an arm, or two arms of a group as one."""

    frame: str
    base: str | None
    locked: Mapping[str, float]
    _parts: Sequence[tuple[float, Kinematics]]  # chains with the factors of their motions

    def forward(self, q: ArrayLike) -> Array:
        """Compute poses of the end effector in the base frame [m], shape (..., 4, 4)."""
        return self._motions(q, with_jacobians=False)[0]

    def motion(self, q: ArrayLike) -> tuple[Array, Array]:
        """Return the results of `forward` and `jacobian`."""
        return self._motions(q)[:2]

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute geometric Jacobians of the end effector, shape (..., 6, dof).

        Rows 0 to 2: linear velocity of its origin; rows 3 to 5: angular velocity; both in the base frame.
        """
        return self._motions(q)[1]

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices (..., d, d) of a specification; see `manipulability`."""
        return manipulability(self.jacobian(q), self.resolved(spec))

    def principal_axes(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
        """Compute semi-axis lengths (..., d), ascending, and directions (..., d, d), columns, of the ellipsoids.

        They come from the singular values of the Jacobian and are more accurate than an eigendecomposition of the
        matrix.
        """
        return principal_axes(self.jacobian(q), self.resolved(spec))

    def manipulability_jacobian(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the derivatives ``∂M/∂q_k`` of the manipulability matrices, shape (..., dof, d, d), symmetric.

        In closed form, see `maniport.arms.kernels.fill_derivatives`; units are those of M per radian or meter.
        """
        return self.differentials(q, spec)[2]

    def differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array]:
        """Return the results of `jacobian`, `ellipsoids` (up to rounding) and `manipulability_jacobian`."""
        return self.posed_differentials(q, spec)[1:]

    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """Return the results of `forward` and `differentials`."""
        poses, jacobians, of_joints = self._motions(q)
        chains = [(factor, own, chain.coupling) for (factor, chain), own in zip(self._parts, of_joints, strict=True)]
        flat = jacobians.reshape(-1, 6, self.dof)
        results = (array.reshape(*poses.shape[:-2], *array.shape[1:])
                   for array in with_derivatives(flat, chains, self.resolved(spec)))  # fmt: skip
        return poses, jacobians, next(results), next(results)

    def _motions(self, q: ArrayLike, with_jacobians: bool = True) -> tuple[Array, Array, list[Array]]:
        """Results of `forward` and `jacobian`, and Jacobians (n, 6, joints) in the joints of each chain."""
        array = self.configurations(q)
        flat, shape = array.reshape(-1, self.dof), array.shape[:-1]
        motions = [chain.motion(flat, with_jacobians) for _, chain in self._parts]
        poses = self._pose([poses for poses, _ in motions])
        coupled = [
            chain.coupled(own) if factor == 1.0 else factor * chain.coupled(own)
            for (factor, chain), (_, own) in zip(self._parts, motions, strict=True)
        ]
        jacobians = reduce(np.add, coupled)
        jacobians = jacobians.reshape(*shape, 6, self.dof) if with_jacobians else jacobians
        return poses.reshape(*shape, 4, 4), jacobians, [own for _, own in motions]

    def _pose(self, poses: Sequence[Array]) -> Array:
        """Poses of the frame, shape (n, 4, 4), from those of each chain."""
        return poses[0]
