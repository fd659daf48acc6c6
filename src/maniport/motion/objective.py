"""Objective of an arm: the costs of its ellipsoid, end-effector position and orientation, evaluated together.

The cost of joint positions q is f(q) = |r_ellipsoid|² + |r_position|² + |r_orientation|². Searches, placement,
controller and planner use it.
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
from maniport.motion.costs.position import PositionCost
from maniport.motion.kernels import add_residual
from maniport.spd.matrix_functions import apply
from maniport.spd.regularization import Regularization
from maniport.util.defaults import DAMPING
from maniport.util.validation import Array, as_points, as_square

Damping = (
    float | Regularization | None
)  # How ellipsoids are damped before they are compared; see `as_damping`

SEARCH_WEIGHT = 50.0
"""Weight of the position error in searches of configurations [1/m]: soft, since a stiff weight makes local minima where
the position is right and the ellipsoid is not."""
FOLLOWING_WEIGHT = 200.0
"""The same of the controller: the position error stays within half a millimeter; a stiffer weight disturbs control
steps, which use first derivatives only."""
EXACT_WEIGHT = 1000.0
"""The same of the pointwise optimum, with a position error of less than 0.1 mm."""

HINT = "Give a damping, such as 0.01: ε I is added to target and achieved ellipsoids"


def as_damping(
    damping: Damping, ellipsoids: Callable[[], Array], positive: bool = False
) -> Regularization:
    """Convert to a damping whose ε [unit of M] is known."""
    own = damping if isinstance(damping, Regularization) else Regularization(damping)
    if own.damping is not None and own.epsilon == 0.0:
        return own.fitted(ellipsoids(), "ellipsoids")
    if positive and own.epsilon == 0.0:
        raise InvalidInputError(
            f"damping must be above 0, since arms pass singular configurations; found {damping!r}"
        )
    return own


@dataclass(frozen=True)
class Objective:
    """Weights of the costs of an arm."""

    arm: Arm
    spec: EllipsoidSpec
    damping: Regularization  # its ε is added to all eigenvalues before ellipsoids are compared
    position_weight: float = SEARCH_WEIGHT  # of the position error [1/m]
    axis_weights: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  # of angles between axes and their targets [1/rad]

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
            raise InvalidInputError(
                f"arm must be an arm, such as maniport.load_arm('panda'); found {arm!r}"
            )
        regularization = as_damping(
            damping, lambda: arm.ellipsoids(arm.sample(4096, 0), spec), positive
        )
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
        half = (
            None
            if weights is None
            else apply(weights, lambda values: np.sqrt(np.maximum(values, 0.0)))
        )
        damped = self.damped(ellipsoids)
        whitening = apply(damped, lambda values: 1.0 / np.sqrt(values))
        cost = EllipsoidCost(self.arm, self.spec, self.shift, damped, whitening, half)
        return Targets(self, cost, positions, rotations)


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
    """Targets of an arm, one row for each; make them with `Objective.targets`.

    Its costs `EllipsoidCost`, `PositionCost` and `OrientationCost` are evaluated together, so that the kinematics are
    computed once.
    """

    objective: Objective
    ellipsoid: EllipsoidCost
    positions: Array | None = None  # (n, 3): target positions of the end effector [m]
    rotations: Array | None = (
        None  # (n, 3, 3): target rotations of the end effector in the base frame
    )

    def __getitem__(self, rows: Any) -> "Targets":
        rest = (None if own is None else own[rows] for own in (self.positions, self.rotations))
        return Targets(self.objective, self.ellipsoid[rows], *rest)

    def __len__(self) -> int:
        return len(self.ellipsoid.whitening)

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.objective.arm

    def weighing(self, position_weight: float) -> "Targets":
        """Return the targets with another weight of the position error [1/m]."""
        return replace(self, objective=replace(self.objective, position_weight=position_weight))

    @property
    def orientation(self) -> OrientationCost | None:
        """Cost of the orientation; None without one."""
        weights, rotations = self.objective.axis_weights, self.rotations
        return (
            None
            if rotations is None or not any(weights)
            else OrientationCost(self.arm, rotations, weights)
        )

    @cached_property
    def pose_costs(self) -> list[PositionCost | OrientationCost]:
        """Costs of the pose of the end effector."""
        weight, positions, turned = self.objective.position_weight, self.positions, self.orientation
        position = None if positions is None else PositionCost(self.arm, positions, weight)
        return [cost for cost in (position, turned) if cost is not None]

    @property
    def ellipsoids(self) -> Array:
        """A, without damping, shape (n, d, d)."""
        return self.objective.undamped(self.ellipsoid.damped)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """√f (n,), half the gradient (n, dof) and Gauss-Newton Hessian (n, dof, dof) of f; √f may be infinite."""
        parts = self.linearize(q)
        return np.sqrt(parts.ellipsoid_square + parts.pose_square), parts.gradient, parts.hessian

    def linearize(
        self, q: Array, differentials: tuple[Array, Array, Array, Array] | None = None
    ) -> Linearization:
        """Evaluate f and its derivatives at configurations (n, dof); `differentials` as `Objective.differentials`."""
        poses, jacobian, velocity, changes = (
            self.objective.differentials(q) if differentials is None else differentials
        )
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        square = self.ellipsoid.add(velocity, changes, gradient, hessian)
        pose_square = self.add_pose(q, (poses, jacobian), gradient, hessian)
        return Linearization(square, pose_square, gradient, hessian, poses, jacobian)

    def add_pose(
        self, q: Array, motion: tuple[Array, Array], gradient: Array, hessian: Array
    ) -> Array:
        """Add Jᵀr and JᵀJ of `pose_costs` for the results of `Arm.motion`; return |r|², shape (n,)."""
        square = np.zeros(len(q))
        for cost in self.pose_costs:
            rows = np.ascontiguousarray(cost.jacobian(q, motion=motion))
            add_residual(cost.residual(q, poses=motion[0]), rows, square, gradient, hessian)
        return square

    def cost(self, q: Array) -> Array:
        """Cost f at q (n, dof), shape (n,)."""
        poses, velocity = self.arm.posed_ellipsoids(q, self.objective.spec.bounded)
        square = self.ellipsoid.square(velocity)
        for cost in self.pose_costs:
            square += np.sum(cost.residual(q, poses=poses) ** 2, axis=1)
        return square

    def distance(self, q: Array) -> Array:
        """As `EllipsoidCost.distance`."""
        return self.ellipsoid.distance(q)

    def position_error(self, q: Array) -> Array | None:
        """Position error [m], shape (n,); None without target positions."""
        if self.positions is None:
            return None
        return np.asarray(np.linalg.norm(self.arm.forward(q)[:, :3, 3] - self.positions, axis=1))

    def orientation_error(self, q: Array) -> Array | None:
        """As `OrientationCost.error`; None without that cost."""
        return None if (cost := self.orientation) is None else cost.error(q)
