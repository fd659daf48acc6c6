"""Cost of an arm's ellipsoid, end-effector position and orientation at a configuration.

With a target ellipsoid A, a target position p of the end effector and the damping ε, the cost of joint positions q is

    f(q) = rᵀ W r + (w |p(q) − p|)²,   r = vec(log(X)),   X = (A + ε I)^-½ (M(q) + ε I) (A + ε I)^-½,

where vec is the Mandel form, so that |r| is the affine-invariant distance, and W, mostly the identity, weighs its
directions. A target rotation A adds Σ_k c_k² |R(q) e_k − A e_k|²: with one axis the squared angle between the two, to
second order, with all three and c_k = c/√2 that of the rotation between them. Searches, placement, seed configurations,
controller and planner use this cost.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.kernels import add_log_residual, add_residual, log_slopes
from maniport.spd.kernels import compose, congruence, eigh
from maniport.spd.matrix_functions import apply, roots, to_vector
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import SPD_TOLERANCE, Array, as_choice, as_number, as_points, as_square

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

HINT = "Give a damping, such as 0.01: ε I is added to target and achieved ellipsoids alike"


def axis_weights(keep: str, weight: float = ORIENTATION_WEIGHT) -> tuple[float, float, float]:
    """Weights of the angles between the axes of the end effector and their targets [1/rad]."""
    as_number(weight, "orientation_weight", above=0.0)
    if as_choice(keep, "orientation_axes", (POINTING, WHOLE)) == POINTING:
        return 0.0, 0.0, weight
    return (weight / math.sqrt(2.0),) * 3


def as_damping(damping: Damping, ellipsoids: Callable[[], Array], positive: bool = False) -> Regularization:
    """Convert to a damping whose ε [unit of M] is known."""
    asked = damping if isinstance(damping, Regularization) else Regularization(damping)
    if asked.eigenvalue_floor is not None:
        raise InvalidInputError(
            "damping must be a number, None or a Regularization by damping; found a floor of "
            f"{asked.eigenvalue_floor:g}, which has no derivative where it sets in. Regularization.absolute(...) adds "
            "a fixed amount"
        )
    if asked.damping is not None and asked.epsilon == 0.0:
        return asked.fitted(ellipsoids(), "ellipsoids")
    if positive and asked.epsilon == 0.0:
        raise InvalidInputError(f"damping must be above 0, since arms pass singular configurations; found {damping!r}")
    return asked


@dataclass(frozen=True)
class Objective:
    """Cost of an arm's configurations, of `track`, `plan_motion` and `nearest_feasible`.

    Attributes
    ----------
    arm : Arm
    spec : EllipsoidSpec
        Which ellipsoids.
    damping : Regularization
        Its ε is added to all eigenvalues before ellipsoids are compared.
    position_weight : float
        Weight of the position error [1/m].
    axis_weights : tuple of three floats
        c: weights of the angles between the axes of the end effector and their targets [1/rad].
    """

    arm: Arm
    spec: EllipsoidSpec
    damping: Regularization
    position_weight: float = SEARCH_WEIGHT
    axis_weights: tuple[float, float, float] = (0.0, 0.0, 0.0)

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
        known = as_damping(damping, lambda: arm.ellipsoids(arm.sample(4096, 0), spec), positive)
        return cls(arm, spec, known, position_weight)

    def keeping(self, keep: str, weight: float) -> "Objective":
        """Return the objective with a cost of orientations; see `axis_weights`."""
        return replace(self, axis_weights=axis_weights(keep, weight))

    @cached_property
    def _shift(self) -> Array:
        """Matrix ε I, shape (d, d)."""
        return self.damping.epsilon * np.eye(self.spec.size)

    def damped(self, ellipsoids: Array) -> Array:
        """Add ε I."""
        return np.asarray(ellipsoids + self._shift)

    def undamped(self, damped: Array) -> Array:
        """Subtract ε I."""
        return np.asarray(damped - self._shift)

    def checked(self, ellipsoids: ArrayLike, name: str, minimum: int = 1) -> Array:
        """Convert target ellipsoids to damped ones, shape (n, d, d), which are positive-definite.

        Raises
        ------
        InvalidInputError, NotSPDError
            When they are not.
        """
        damped = self.damped(as_square(ellipsoids, name, self.spec.size))
        label, hint = (f"{name} with damping", "") if self.damping.epsilon else (name, HINT)
        return as_points(damped, label, minimum=minimum, hint=hint)

    def targets(
        self,
        ellipsoids: Array,
        positions: Array | None = None,
        weights: Array | None = None,
        rotations: Array | None = None,
    ) -> "Targets":
        """Prepare target ellipsoids (n, d, d) and the other arrays of `Targets`; checked by the caller."""
        root, whitening = roots(self.damped(ellipsoids))
        return Targets(self, root, whitening, positions, weights, rotations)


class Linearization(NamedTuple):
    """Cost f of n configurations and its derivatives."""

    ellipsoid_square: Array  # (n,): rᵀ W r; infinite where an ellipsoid is singular
    pose_square: Array  # (n,): weighted squared errors of position and orientation
    gradient: Array  # (n, dof): half the gradient of f
    hessian: Array  # (n, dof, dof): Gauss-Newton Hessian of f
    poses: Array | None  # (n, 4, 4) of the end effector; None where neither position nor orientation has a target


@dataclass(frozen=True)
class Targets:
    """Targets of an arm, one row for each; make them with `Objective.targets`."""

    objective: Objective
    root: Array  # (n, d, d): (A + ε I)^½ of the target ellipsoids A, and its inverse
    whitening: Array  # (n, d, d): (A + ε I)^½ of the target ellipsoids A, and its inverse
    positions: Array | None = None  # (n, 3): target positions of the end effector [m]
    weights: Array | None = None  # (n, m, m): W
    rotations: Array | None = None  # (n, 3, 3): A: target rotations of the end effector in the base frame

    def __getitem__(self, rows: Any) -> "Targets":
        rest = (None if one is None else one[rows] for one in (self.positions, self.weights, self.rotations))
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
    def turned(self) -> bool:
        """Whether orientations have a cost."""
        return self.rotations is not None and any(self.objective.axis_weights)

    @property
    def ellipsoids(self) -> Array:
        """A, without damping, shape (n, d, d)."""
        return self.objective.undamped(self.root @ self.root)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient (n, dof) and Gauss-Newton Hessian (n, dof, dof) of f; √f may be infinite."""
        parts = self.linearize(q)
        return np.sqrt(parts.ellipsoid_square + parts.pose_square), parts.gradient, parts.hessian

    def linearize(self, q: Array) -> "Linearization":
        """Evaluate f and its derivatives at configurations (n, dof)."""
        values, vectors, singular, changes, jacobian, tips = self.differentials(q)
        square, gradient, hessian = np.zeros(len(q)), np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        if self.weights is None:
            add_log_residual(values, vectors, self.whitening, changes, square, gradient, hessian)
        else:
            rows, residual = (
                to_vector(self._log_changes(values, vectors, changes)),
                to_vector(compose(np.log(values), vectors)),
            )
            pull = (self.weights @ residual[..., None])[..., 0]
            gradient += (rows @ pull[..., None])[..., 0]
            hessian += rows @ self.weights @ np.swapaxes(rows, -1, -2)
            square += np.sum(residual * pull, axis=1)
        pose_square = np.zeros(len(q))
        for away, moves in self.pose_residuals(q, tips, jacobian):
            add_residual(away, moves, gradient, hessian)
            pose_square += np.sum(away**2, axis=1)
        return Linearization(np.where(singular, np.inf, square), pose_square, gradient, hessian, tips)

    def log_changes(self, q: Array) -> Array:
        """Derivatives of log X along each joint, shape (n, dof, d, d), where nothing is singular."""
        values, vectors, _, changes, *_ = self.differentials(q)
        return self._log_changes(values, vectors, changes)

    def _log_changes(self, values: Array, vectors: Array, changes: Array) -> Array:
        """Derivatives of log X in the base frame; as in `add_log_residual`."""
        frames = np.swapaxes(vectors, -1, -2) @ self.whitening
        inner = frames[:, None] @ changes @ np.swapaxes(frames, -1, -2)[:, None]
        turned = log_slopes(values)[:, None] * inner
        return np.asarray(vectors[:, None] @ turned @ np.swapaxes(vectors, -1, -2)[:, None])

    def cost(self, q: Array) -> Array:
        """Cost f at q (n, dof), shape (n,)."""
        if self.weights is None:
            square = self.distance(q) ** 2
        else:
            residual = to_vector(self.logarithms(q))
            square = np.einsum("ni,nij,nj->n", residual, self.weights, residual)
        for away, _ in self.pose_residuals(q):
            square = square + np.sum(away**2, axis=1)
        return np.asarray(square)

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        velocity = self.objective.arm.ellipsoids(q, self.objective.spec.velocity)
        values, _, _, singular = self._spectrum(velocity)
        return np.where(singular, np.inf, np.sqrt(np.sum(np.log(values) ** 2, axis=1)))

    def logarithms(self, q: Array) -> Array:
        """Log X, shape (n, d, d), where nothing is singular."""
        achieved = self.objective.arm.ellipsoids(q, self.objective.spec)
        return apply(congruence(self.whitening, self.objective.damped(achieved)), np.log)

    def tip_offset(self, q: Array) -> Array:
        """Vector from the target position to the end effector [m], shape (n, 3)."""
        assert self.positions is not None
        return np.asarray(self.objective.arm.forward(q)[:, :3, 3] - self.positions)

    def pose_residuals(
        self, q: Array, tips: Array | None = None, jacobian: Array | None = None
    ) -> Iterator[tuple[Array, Array]]:
        """Weighted residuals (n, 3) of position and axes; with Jacobians (n, 6, dof) also their derivatives."""
        if self.positions is None and self.rotations is None:
            return
        tips = self.objective.arm.forward(q) if tips is None else tips
        no_slopes = np.empty((len(q), 3, 0))
        if self.positions is not None:
            weight = self.objective.position_weight
            moves = no_slopes if jacobian is None else weight * jacobian[:, :3]
            yield weight * (tips[:, :3, 3] - self.positions), moves
        if self.rotations is not None:
            for k in np.flatnonzero(self.objective.axis_weights):
                weight, axis = self.objective.axis_weights[k], tips[:, :3, k]
                turns = no_slopes if jacobian is None else -weight * np.cross(axis[..., None], jacobian[:, 3:], axis=1)
                yield weight * (axis - self.rotations[:, :, k]), turns

    def axis_angles(self, q: Array) -> Array | None:
        """Largest angle between a constrained axis and its target (n,) [rad]; None without orientations."""
        counting = np.flatnonzero(self.objective.axis_weights)
        if self.rotations is None or not self.turned:
            return None
        chords = np.linalg.norm(self.objective.arm.forward(q)[:, :3, counting] - self.rotations[:, :, counting], axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chords.max(axis=1), 1.0)))

    def tip_error(self, q: Array) -> Array | None:
        """Position error [m], shape (n,); None without target positions."""
        return None if self.positions is None else np.linalg.norm(self.tip_offset(q), axis=1)

    def differentials(self, q: Array) -> tuple[Array, Array, NDArray[np.bool_], Array, Array, Array | None]:
        """Eigenvalues, -vectors, singularity of X; derivatives of M; Jacobians and poses of the end effector."""
        arm, spec, tips = self.objective.arm, self.objective.spec.velocity, None
        if self.positions is None and self.rotations is None:
            jacobian, velocity, changes = arm.differentials(q, spec)
        else:
            tips, jacobian, velocity, changes = arm.posed_differentials(q, spec)
        values, vectors, inverse, singular = self._spectrum(velocity)
        if inverse is not None:
            changes = -inverse[:, None] @ changes @ inverse[:, None]
        return values, vectors, singular, changes, jacobian, tips

    def _spectrum(self, velocity: Array) -> tuple[Array, Array, Array | None, NDArray[np.bool_]]:
        """Eigenvalues (1 where M is singular) and -vectors of X; M⁻¹ of the velocity for a force."""
        inverse, singular, achieved = None, np.zeros(len(velocity), bool), velocity
        if self.objective.spec.kind == "force":
            values, vectors = eigh(velocity)
            singular = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
            values[singular] = 1.0
            achieved = inverse = compose(1.0 / values, vectors)
        values, vectors = eigh(congruence(self.whitening, self.objective.damped(achieved)))
        singular |= values[:, 0] <= SPD_TOLERANCE * values[:, -1]
        values[singular] = 1.0
        return values, vectors, inverse, singular
