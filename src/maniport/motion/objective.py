"""Objective of an arm: the costs of its ellipsoid, end-effector position and orientation, evaluated together.

The cost of joint positions q is f(q) = |r_ellipsoid|² + |r_position|² + |r_orientation|², with the residuals of
`maniport.motion.costs`. Searches, placement, seed configurations, controller and planner use it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from maniport.arms import VELOCITY, Arm, EllipsoidSpec
from maniport.errors import InvalidInputError
from maniport.motion.costs.ellipsoid import EllipsoidCost
from maniport.motion.costs.orientation import OrientationCost
from maniport.motion.costs.position import PoseCost, PositionCost
from maniport.motion.kernels import add_residual
from maniport.spd.kernels import roots
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array, as_points, as_square

Damping = float | Regularization | None  # How ellipsoids are damped before they are compared; see `as_damping`

SEARCH_WEIGHT = 50.0
"""Weight of the position error in searches of configurations [1/m]: soft, since a stiff weight makes local minima where
the position is right and the ellipsoid is not."""
FOLLOWING_WEIGHT = 200.0
"""The same of the controller: the position error stays within half a millimeter; a stiffer weight disturbs control
steps, which use first derivatives only."""
EXACT_WEIGHT = 1000.0
"""The same of the pointwise optimum, with a position error of less than 0.1 mm."""

HINT = "Give a damping, such as 0.01: ε I is added to target and achieved ellipsoids"


def as_damping(damping: Damping, ellipsoids: Callable[[], Array], positive: bool = False) -> Regularization:
    """Convert to a damping whose ε [unit of M] is known."""
    own = damping if isinstance(damping, Regularization) else Regularization(damping)
    if own.damping is not None and own.epsilon == 0.0:
        return own.fitted(ellipsoids(), "ellipsoids")
    if positive and own.epsilon == 0.0:
        raise InvalidInputError(f"damping must be above 0, since arms pass singular configurations; found {damping!r}")
    return own


@dataclass(frozen=True)
class Objective:
    """Weights of the costs of an arm, of `track`, `plan_motion` and `nearest_feasible`.

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
        Weights of the angles between the axes of the end effector and their targets [1/rad].
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
        """Convert target ellipsoids to damped ones, shape (n, d, d), which must be positive-definite."""
        damped = self.damped(as_square(ellipsoids, name, self.spec.size))
        label, hint = (f"{name} with damping", "") if self.damping.epsilon else (name, HINT)
        return as_points(damped, label, minimum=minimum, hint=hint)

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
        """Prepare target ellipsoids (n, d, d) and the other arrays of `Targets`; checked by the caller."""
        return Targets(self, *roots(self.damped(ellipsoids)), positions, weights, rotations)


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
    """Targets of an arm, one row for each, and their costs; make them with `Objective.targets`."""

    objective: Objective
    root: Array  # (n, d, d): (A + ε I)^½ of the target ellipsoids A
    whitening: Array  # (n, d, d): its inverse
    positions: Array | None = None  # (n, 3): target positions of the end effector [m]
    weights: Array | None = None  # (n, m, m): weights of the directions of the ellipsoids
    rotations: Array | None = None  # (n, 3, 3): target rotations of the end effector in the base frame

    def __getitem__(self, rows: Any) -> "Targets":
        rest = (None if own is None else own[rows] for own in (self.positions, self.weights, self.rotations))
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

    @property
    def ellipsoid_cost(self) -> EllipsoidCost:
        """Cost of the ellipsoids."""
        own = self.objective
        return EllipsoidCost(own.arm, own.spec, own.shift, self.root, self.whitening, self.weights)

    @property
    def orientation_cost(self) -> OrientationCost | None:
        """Cost of the orientations; None where they have none."""
        own, rotations = self.objective, self.rotations
        return OrientationCost(own.arm, rotations, own.axis_weights) if self.turned and rotations is not None else None

    @property
    def pose_costs(self) -> tuple[PoseCost, ...]:
        """Costs of position and orientation, as far as there are any."""
        costs: list[PoseCost] = []
        if self.positions is not None:
            costs.append(PositionCost(self.arm, self.positions, self.objective.position_weight))
        orientation = self.orientation_cost
        return tuple(costs) if orientation is None else (*costs, orientation)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient (n, dof) and Gauss-Newton Hessian (n, dof, dof) of f; √f may be infinite."""
        parts = self.linearize(q)
        return np.sqrt(parts.ellipsoid_square + parts.pose_square), parts.gradient, parts.hessian

    def linearize(self, q: Array, differentials: tuple[Array, Array, Array, Array] | None = None) -> "Linearization":
        """Evaluate f and its derivatives at configurations (n, dof); `differentials` as `Objective.differentials`."""
        poses, jacobian, velocity, changes = self.objective.differentials(q) if differentials is None else differentials
        gradient, hessian, pose_square = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1])), np.zeros(len(q))
        square = self.ellipsoid_cost.add(velocity, changes, gradient, hessian)
        for cost in self.pose_costs:
            residual = cost.at(poses)
            add_residual(residual, cost.slopes(poses, jacobian), gradient, hessian)
            pose_square += np.sum(residual**2, axis=1)
        return Linearization(square, pose_square, gradient, hessian, poses, jacobian)

    def cost(self, q: Array) -> Array:
        """Cost f at q (n, dof), shape (n,)."""
        poses, velocity = self.arm.posed_ellipsoids(q, self.objective.spec.bounded)
        square = self.ellipsoid_cost.square(velocity)
        for cost in self.pose_costs:
            square += np.sum(cost.at(poses) ** 2, axis=1)
        return square

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        return self.ellipsoid_cost.distance(q)

    def position_error(self, q: Array) -> Array | None:
        """Position error [m], shape (n,); None without target positions."""
        if self.positions is None:
            return None
        return np.asarray(np.linalg.norm(self.arm.forward(q)[:, :3, 3] - self.positions, axis=1))
