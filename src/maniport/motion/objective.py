"""Objective of an arm: the costs of its ellipsoid, end-effector position and orientation, evaluated together.

The cost of joint positions q is f(q) = |r_ellipsoid|² + |r_position|² + |r_orientation|². Searches, placement,
controller and planner use it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.kernels import add_log_residual, add_residual
from maniport.spd.kernels import compose, congruence, eigh, roots
from maniport.spd.matrix_functions import apply, to_vector
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_points, as_square

Damping = float | Regularization | None  # How ellipsoids are damped before they are compared; see `as_damping`

SEARCH_WEIGHT = 50.0
"""Weight of the position error in searches of configurations [1/m]: soft, since a stiff weight makes local minima where
the position is right and the ellipsoid is not."""
FOLLOWING_WEIGHT = 200.0
"""The same of the controller: the position error stays within half a millimeter; a stiffer weight disturbs control
steps, which use first derivatives only."""
EXACT_WEIGHT = 1000.0
"""The same of the pointwise optimum, with a position error of less than 0.1 mm."""

POINTING, WHOLE = "pointing", "whole"
"""Which axes of the end effector's orientation count: z, mostly along a gripper's fingers, or all."""
ORIENTATION_WEIGHT = 10.0  # 6° have the same cost as a distance of 1 between ellipsoids [1/rad]

HINT = "Give a damping, such as 0.01: ε I is added to target and achieved ellipsoids"


def as_damping(damping: Damping, ellipsoids: Callable[[], Array], positive: bool = False) -> Regularization:
    """Convert to a damping whose ε [unit of M] is known."""
    own = damping if isinstance(damping, Regularization) else Regularization(damping)
    if own.damping is not None and own.epsilon == 0.0:
        return own.fitted(ellipsoids(), "ellipsoids")
    if positive and own.epsilon == 0.0:
        raise InvalidInputError(f"damping must be above 0, since arms pass singular configurations; found {damping!r}")
    return own


def axis_weights(axes: str) -> tuple[float, float, float]:
    """Weights of the angles between the axes of the end effector and their targets [1/rad]."""
    if as_choice(axes, "orientation_axes", (POINTING, WHOLE)) == POINTING:
        return 0.0, 0.0, ORIENTATION_WEIGHT
    return (ORIENTATION_WEIGHT / math.sqrt(2.0),) * 3


@dataclass(frozen=True)
class Objective:
    """Weights of the costs of an arm."""

    arm: Arm
    spec: EllipsoidSpec
    damping: Regularization  # its ε is added to all eigenvalues before ellipsoids are compared
    position_weight: float = SEARCH_WEIGHT  # of the position error [1/m]
    axis_weights: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of angles between axes and their targets [1/rad]

    @classmethod
    def of(
        cls,
        arm: Arm,
        spec: EllipsoidSpec = VELOCITY,
        damping: Damping = DAMPING,
        position_weight: float = SEARCH_WEIGHT,
        *,
        positive: bool = False,
    ) -> "Objective":
        """Check arguments; `damping` as in `as_damping`, relative to the arm's ellipsoids at 4096 samples."""
        if not callable(getattr(arm, "ellipsoids", None)):
            raise InvalidInputError(f"arm must be an arm, such as maniport.load_arm('panda'); found {arm!r}")
        regularization = as_damping(damping, lambda: arm.ellipsoids(arm.sample(4096, 0), spec), positive)
        return cls(arm, spec, regularization, position_weight)

    @cached_property
    def shift(self) -> Array:
        """Matrix ε I, shape (d, d)."""
        return self.damping.epsilon * np.eye(self.spec.size)

    def damped(self, ellipsoids: Array) -> Array:
        """Add ε I."""
        return np.asarray(ellipsoids + self.shift)

    def undamped(self, damped: Array) -> Array:
        """Subtract ε I."""
        return np.asarray(damped - self.shift)

    def checked(self, ellipsoids: ArrayLike, name: str, minimum: int = 1) -> Array:
        """Convert target ellipsoids (n, d, d), which must be positive-definite with the damping."""
        damped = self.damped(as_square(ellipsoids, name, self.spec.size))
        label, hint = (f"{name} with damping", "") if self.damping.epsilon else (name, HINT)
        return self.undamped(as_points(damped, label, minimum=minimum, hint=hint))

    def differentials(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Poses, Jacobians, velocity ellipsoids and their derivatives at configurations (n, dof)."""
        return self.arm.posed_differentials(q, self.spec.bounded)

    def targets(
        self,
        ellipsoids: Array,
        positions: Array | None = None,
        weights: Array | None = None,
        rotations: Array | None = None,
    ) -> "Targets":
        """Prepare target ellipsoids (n, d, d) and the other arrays of `Targets`; checked by the caller.

        `weights` (n, m, m) are those of the directions of the ellipsoids' residuals.
        """
        half = None if weights is None else apply(weights, lambda values: np.sqrt(np.maximum(values, 0.0)))
        return Targets(self, *roots(self.damped(ellipsoids)), positions, half, rotations)


class Linearization(NamedTuple):
    """Cost f of n configurations and its derivatives."""

    ellipsoid_square: Array  # (n,): |r_ellipsoid|²; infinite where an ellipsoid is singular
    pose_square: Array  # (n,): the sum of those of position and orientation
    gradient: Array  # (n, dof): half the gradient of f
    hessian: Array  # (n, dof, dof): Gauss-Newton Hessian of f
    poses: Array  # (n, 4, 4) of the end effector
    jacobian: Array  # (n, 6, dof) of the end effector


@dataclass(frozen=True)
class Targets:
    """Targets of an arm, one row for each, and their costs; make them with `Objective.targets`.

    With the target A and the achieved ellipsoid M(q), r_ellipsoid is W^½ vec(log X), X = (A + ε I)^-½ (M(q) + ε I)
    (A + ε I)^-½. vec is the Mandel form, so that |vec(log X)| is the affine-invariant distance. r_position is the
    weighted offset of the end effector. r_orientation has c_k (R(q) e_k − A_R e_k) for each axis k with a weight: with
    one axis its square is that of the angle between the two, to second order, with all three and c_k = c/√2 that of the
    rotation between them.
    """

    objective: Objective
    root: Array  # (n, d, d): (A + ε I)^½ of the target ellipsoids A
    whitening: Array  # (n, d, d): its inverse
    positions: Array | None = None  # (n, 3): target positions of the end effector [m]
    half: Array | None = None  # (n, m, m): W^½, weights of the directions of the ellipsoids' residuals
    rotations: Array | None = None  # (n, 3, 3): target rotations A_R of the end effector in the base frame

    def __getitem__(self, rows: Any) -> "Targets":
        rest = (None if own is None else own[rows] for own in (self.positions, self.half, self.rotations))
        return Targets(self.objective, self.root[rows], self.whitening[rows], *rest)

    def __len__(self) -> int:
        return len(self.whitening)

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.objective.arm

    def weighing(self, position_weight: float) -> "Targets":
        """Return the targets with another weight of the position error [1/m]."""
        return replace(self, objective=replace(self.objective, position_weight=position_weight))

    @property
    def axes(self) -> list[int]:
        """Axes of the end effector whose orientations have a cost."""
        return [] if self.rotations is None else [k for k, weight in enumerate(self.objective.axis_weights) if weight]

    @property
    def ellipsoids(self) -> Array:
        """A, without damping, shape (n, d, d)."""
        return self.objective.undamped(self.root @ self.root)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient (n, dof) and Gauss-Newton Hessian (n, dof, dof) of f; √f may be infinite."""
        parts = self.linearize(q)
        return np.sqrt(parts.ellipsoid_square + parts.pose_square), parts.gradient, parts.hessian

    def linearize(self, q: Array, differentials: tuple[Array, Array, Array, Array] | None = None) -> Linearization:
        """Evaluate f and its derivatives at configurations (n, dof); `differentials` as `Objective.differentials`."""
        poses, jacobian, velocity, changes = self.objective.differentials(q) if differentials is None else differentials
        gradient, hessian, square = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1])), np.zeros(len(q))
        values, vectors, singular, changes = self.spectrum(velocity, changes)
        if self.half is None:
            add_log_residual(values, vectors, self.whitening, changes, square, gradient, hessian)
        else:
            residual = self._weighted_log(values, vectors)
            rows = np.swapaxes(to_vector(self._log_changes(values, vectors, changes)), 1, 2)
            add_residual(residual, self.half @ rows, gradient, hessian)
            square += np.sum(residual**2, axis=1)
        residual = self.pose_residual(poses)
        add_residual(residual, self.pose_slopes(poses, jacobian), gradient, hessian)
        square[singular] = np.inf
        return Linearization(square, np.sum(residual**2, axis=1), gradient, hessian, poses, jacobian)

    def cost(self, q: Array) -> Array:
        """Cost f at q (n, dof), shape (n,)."""
        poses, velocity = self.arm.posed_ellipsoids(q, self.objective.spec.bounded)
        values, vectors, singular, _ = self.spectrum(velocity)
        rows = np.log(values) if self.half is None else self._weighted_log(values, vectors)
        square = np.where(singular, np.inf, np.sum(rows**2, axis=1))
        return np.asarray(square + np.sum(self.pose_residual(poses) ** 2, axis=1))

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        values, _, singular, _ = self.spectrum(self.arm.ellipsoids(q, self.objective.spec.bounded))
        return np.where(singular, np.inf, np.sqrt(np.sum(np.log(values) ** 2, axis=1)))

    def position_error(self, q: Array) -> Array | None:
        """Position error [m], shape (n,); None without target positions."""
        if self.positions is None:
            return None
        return np.asarray(np.linalg.norm(self.arm.forward(q)[:, :3, 3] - self.positions, axis=1))

    def orientation_error(self, q: Array) -> Array | None:
        """Largest angle between an axis with a weight and its target, shape (n,) [rad]; None without any."""
        if self.rotations is None or not self.axes:
            return None
        chords = np.linalg.norm((self.arm.forward(q)[:, :3, :3] - self.rotations)[:, :, self.axes], axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chords.max(axis=1), 1.0)))

    def pose_residual(self, poses: Array) -> Array:
        """Return r_position and r_orientation, shape (n, r), for poses (n, 4, 4) of the end effector."""
        parts, weights = [np.empty((len(poses), 0))], self.objective.axis_weights
        if self.positions is not None:
            parts.append(self.objective.position_weight * (poses[:, :3, 3] - self.positions))
        if self.rotations is not None:
            parts += [weights[k] * (poses[:, :3, k] - self.rotations[:, :, k]) for k in self.axes]
        return np.concatenate(parts, axis=1)

    def pose_slopes(self, poses: Array, jacobian: Array) -> Array:
        """Return their derivatives, shape (n, r, dof), for Jacobians (n, 6, dof)."""
        parts, weights = [jacobian[:, :0]], self.objective.axis_weights
        if self.positions is not None:
            parts.append(self.objective.position_weight * jacobian[:, :3])
        parts += [-weights[k] * np.cross(poses[:, :3, k, None], jacobian[:, 3:], axis=1) for k in self.axes]
        return np.concatenate(parts, axis=1)

    def logarithms(self, q: Array) -> Array:
        """Log X, shape (n, d, d), where nothing is singular."""
        return apply(
            congruence(self.whitening, self.objective.damped(self.arm.ellipsoids(q, self.objective.spec))), np.log
        )

    def log_changes(self, q: Array) -> Array:
        """Return derivatives of log X along each joint, shape (n, dof, d, d), where nothing is singular."""
        _, _, velocity, changes = self.objective.differentials(q)
        values, vectors, _, changes = self.spectrum(velocity, changes)
        return self._log_changes(values, vectors, changes)

    def spectrum(self, velocity: Array, changes: Array | None = None) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Eigenvalues (1 where M is singular) and -vectors of X, singularity, and derivatives of M for those given."""
        singular, achieved = np.zeros(len(velocity), bool), velocity
        if self.objective.spec.kind == "force":
            values, vectors = eigh(velocity)
            singular = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
            values[singular] = 1.0
            achieved = compose(1.0 / values, vectors)
            changes = None if changes is None else -achieved[:, None] @ changes @ achieved[:, None]
        values, vectors = eigh(congruence(self.whitening, self.objective.damped(achieved)))
        singular |= values[:, 0] <= SPD_TOLERANCE * values[:, -1]
        values[singular] = 1.0
        return values, vectors, singular, np.empty((0,)) if changes is None else changes

    def _weighted_log(self, values: Array, vectors: Array) -> Array:
        assert self.half is not None
        return np.asarray((self.half @ to_vector(compose(np.log(values), vectors))[..., None])[..., 0])

    def _log_changes(self, values: Array, vectors: Array, changes: Array) -> Array:
        """Return derivatives of log X in the base frame, with divided differences of the logarithm."""
        ratio, frames = values[:, :, None] / values[:, None] - 1.0, np.swapaxes(vectors, -1, -2) @ self.whitening
        near = np.abs(ratio) < 1e-8
        slopes = np.where(near, 1.0 - 0.5 * ratio, np.log1p(ratio) / np.where(near, 1.0, ratio)) / values[:, None]
        inner = slopes[:, None] * congruence(frames[:, None], changes)
        return congruence(vectors[:, None], inner)
