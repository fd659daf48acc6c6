"""The joint coordinates of an arm or a pair, with samples and limits, and the ellipsoids of what moves one frame."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property, reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms.kinematics import DynamicsTerms, Kinematics
from maniport.arms.manipulability import VELOCITY, EllipsoidSpec, Weighting, manipulability, with_derivatives
from maniport.errors import InvalidInputError
from maniport.util.notebook import NotebookDisplay
from maniport.util.sampling import sobol
from maniport.util.validation import Array, as_choice, as_count, as_finite, as_generator, as_numbers

LEAST_TORQUE = 0.05  # smallest share of an effort limit that gravity leaves, so that ellipsoids stay defined


class JointSpace(NotebookDisplay):
    """Configurations of an arm or a pair, shape (..., dof); the attributes are described at `maniport.arms.Arm`."""

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
        self.name, self.dof, self.joint_names, self.joint_units = name, len(joint_names), joint_names, joint_units
        self.lower, self.upper = np.array(lower, dtype=np.float64), np.array(upper, dtype=np.float64)
        self.velocity_limits, self.effort_limits = (
            None if limits is None else np.array(limits, dtype=np.float64)
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

    def checked_spec(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """Require numbers or limits of all joints for the ellipsoids of a specification."""
        if not isinstance(spec, EllipsoidSpec):
            raise InvalidInputError(f"spec must be an EllipsoidSpec, such as EllipsoidSpec('force'); found {spec!r}")
        if isinstance(spec.joint_weights, str):
            self._limits(spec.kind)
        elif spec.joint_weights is not None:
            as_numbers(spec.joint_weights, "joint_weights", self.dof, above=0.0)
        return spec

    def _limits(self, kind: str) -> Array:
        """Return the velocity or effort limits (dof,) for a kind of ellipsoids, all finite and above 0."""
        name, limits = ("velocity", self.velocity_limits) if kind == "velocity" else ("effort", self.effort_limits)
        if limits is None or not np.all(np.isfinite(limits) & (limits > 0.0)):
            missing = [n for i, n in enumerate(self.joint_names) if limits is None or not 0.0 < limits[i] < np.inf]
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
        """Compute manipulability matrices of velocity, force or acceleration.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        kind, part, joint_weights
            As in `EllipsoidSpec`; `InvalidInputError` when limits or masses are not known.

        Returns
        -------
        ndarray, shape (..., d, d), of a group (..., n_arms, d, d)
            Exactly symmetric matrices. Singular ellipsoids of velocity and acceleration are returned as they are; the
            force ellipsoid of a singular configuration raises `NotSPDError`.
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

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute geometric Jacobians of the end effector, shape (..., 6, dof).

        Rows 0 to 2: linear velocity of its origin; rows 3 to 5: angular velocity; both in the base frame.
        """
        return self._motions(q)[1]

    def ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> Array:
        """Compute the manipulability matrices (..., d, d) of a specification; see `manipulability`."""
        return self.posed_ellipsoids(q, spec)[1]

    def posed_ellipsoids(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array]:
        """Return the results of `forward` and `ellipsoids`."""
        poses, jacobians, _ = self._motions(q)
        weighting = self._weighting(np.asarray(q, dtype=np.float64).reshape(-1, self.dof), spec)
        return poses, manipulability(weighting.shaped(poses.shape[:-2]).rows(jacobians, spec)[1], spec.kind)

    def checked_spec(self, spec: EllipsoidSpec) -> EllipsoidSpec:
        """Require numbers or limits, and masses where they count, for the ellipsoids of a specification."""
        if super().checked_spec(spec).kind == "acceleration" and self._inertia_fault:
            raise InvalidInputError(
                f"kind 'acceleration' needs masses, and the description of {self.name!r} {self._inertia_fault}; choose "
                "'velocity' or 'force'"
            )
        return spec

    @cached_property
    def _inertia_fault(self) -> str:
        """Why the joint-space inertia cannot be inverted; empty where it can."""
        terms = self._dynamics_terms(self.sample(1, 0), gravity=False, inertia=True, changes=False)
        if terms is None:
            return "has none"
        values, vectors = np.linalg.eigh(terms.inertia[0])
        free = values[0] <= 1e-12 * values[-1]
        return f"has none that {self.joint_names[int(np.abs(vectors[:, 0]).argmax())]} accelerates" if free else ""

    def _weighting(self, q: Array, spec: EllipsoidSpec, changes: bool = False) -> Weighting:
        """Weights of the joints at configurations (n, dof), and derivatives where `changes` is set."""
        weights = self.checked_spec(spec).joint_weights
        scale, slopes, limited = None, None, isinstance(weights, str)
        if weights is not None:
            scale = self._limits(spec.kind) if limited else np.array(weights, dtype=np.float64)
        if spec.kind == "velocity":
            return Weighting(scale)
        accelerated = spec.kind == "acceleration"
        terms = None
        if limited or accelerated:
            terms = self._dynamics_terms(q, gravity=limited, inertia=accelerated, changes=changes)
        if scale is not None and limited and terms is not None:
            limits, held = scale, np.abs(terms.gravity)
            scale = np.maximum(limits - held, LEAST_TORQUE * limits)
            if changes:
                slopes = -np.sign(terms.gravity)[..., None] * terms.gravity_changes
                slopes[scale > limits - held] = 0.0
                slopes *= scale[..., None] if accelerated else -(scale[..., None] ** -3)
        if not accelerated:
            return Weighting(None if scale is None else 1.0 / scale, slopes)
        assert terms is not None  # checked above
        return Weighting(scale, slopes, terms.inertia, terms.inertia_changes if changes else None)

    @abstractmethod
    def _dynamics_terms(self, q: Array, gravity: bool, inertia: bool, changes: bool) -> DynamicsTerms | None:
        """Gravity torques and joint-space inertia at configurations (n, dof); None without masses."""

    def gravity_torques(self, q: ArrayLike) -> Array:
        """Compute the joint torques that hold the arm against gravity, shape (..., dof) [N m] or [N].

        `InvalidInputError` for an arm without masses.
        """
        array = self.configurations(q)
        terms = self._dynamics_terms(array.reshape(-1, self.dof), gravity=True, inertia=False, changes=False)
        if terms is None:
            raise InvalidInputError(f"the description of {self.name!r} has no masses")
        return terms.gravity.reshape(array.shape)

    def posed_differentials(self, q: ArrayLike, spec: EllipsoidSpec = VELOCITY) -> tuple[Array, Array, Array, Array]:
        """Return the results of `forward`, `jacobian` and `ellipsoids`, and derivatives of the latter.

        Derivatives ``∂M/∂q_k`` have shape (..., dof, d, d), symmetric, in closed form; see
        `maniport.arms.kernels.fill_derivatives`. Units are those of M per radian or meter.
        """
        poses, jacobians, of_joints = self._motions(q)
        chains = [(factor, own, chain.coupling) for (factor, chain), own in zip(self._parts, of_joints, strict=True)]
        flat = jacobians.reshape(-1, 6, self.dof)
        weighting = self._weighting(np.asarray(q, dtype=np.float64).reshape(-1, self.dof), spec, changes=True)
        results = (array.reshape(*poses.shape[:-2], *array.shape[1:])
                   for array in with_derivatives(flat, chains, spec, weighting))  # fmt: skip
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
