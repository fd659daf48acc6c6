"""What a cost is, the normal equations that costs add to, and the check of a user's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.errors import InvalidInputError
from maniport.motion.configurations import Configurations
from maniport.motion.kernels import add_residual
from maniport.util.validation import Array, as_finite


@runtime_checkable
class Cost(Protocol):
    """One term of a motion problem: the sum of its squared residuals, at each waypoint.

    Weights are inside the residual, whose unit is that of a distance between ellipsoids: a cost of a position error has
    a weight in 1/m, one of an angle in 1/rad. The planner multiplies the squares by the time around a waypoint.
    Pass own costs as ``plan_motion(costs=[...])``; the controller takes the same objects.
    """

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, r).

        Parameters
        ----------
        at : Configurations
            n configurations of all joints, with their kinematics and times. The planner adds waypoints between those
            of the profile, and the controller has its own steps, so a cost is a function of ``at.time``, not of a row.
        """

    def jacobian(self, at: Configurations) -> Array:
        """Return the derivatives of the residuals with respect to the joints, shape (n, r, dof)."""


@runtime_checkable
class PositionErrorCost(Cost, Protocol):
    """A cost of a position error: the planner raises its weight until the error is within the position tolerance."""

    def with_weight(self, weight: float) -> Self:
        """Return the cost with another weight [1/m]."""

    def error(self, at: Configurations) -> Array:
        """Return the position error, shape (n,) [m]."""


@dataclass
class NormalEquations:
    """Sums over costs at n configurations, to which each cost adds in place."""

    ellipsoid_square: Array  # (n,), |r|² of ellipsoids; infinite where one is singular
    square: Array  # (n,), |r|² of all other costs
    gradient: Array  # (n, dof), Jᵀ r
    hessian: Array  # (n, dof, dof), Jᵀ J

    @classmethod
    def zeros(cls, count: int, dof: int) -> "NormalEquations":
        """Return the sums over no costs."""
        return cls(
            ellipsoid_square=np.zeros(count),
            square=np.zeros(count),
            gradient=np.zeros((count, dof)),
            hessian=np.zeros((count, dof, dof)),
        )

    @property
    def distance(self) -> Array:
        """Root of the sum of all squared residuals, shape (n,); may be infinite."""
        return np.sqrt(self.ellipsoid_square + self.square)

    def add(self, cost: Cost, at: Configurations) -> None:
        """Add a cost by its residuals and their derivatives."""
        jacobian = np.ascontiguousarray(cost.jacobian(at), dtype=np.float64)
        residual = np.ascontiguousarray(cost.residual(at), dtype=np.float64)
        add_residual(residual, jacobian, self.square, self.gradient, self.hessian)


def as_costs(costs: Sequence[Cost], robot: Arm | ArmGroup, time: Array) -> tuple[Cost, ...]:
    """Require costs with residuals (n, r) and Jacobians (n, r, dof), tried at two configurations."""
    middle = 0.5 * (robot.lower + robot.upper)
    at = Configurations(robot, np.tile(middle, (2, 1)), time[:2])

    for i, cost in enumerate(costs):
        if not isinstance(cost, Cost):
            raise InvalidInputError(
                f"costs[{i}] must have the methods residual and jacobian; found {cost!r}"
            )
        residual = as_finite(cost.residual(at), f"costs[{i}].residual")
        if residual.ndim != 2 or len(residual) != 2:
            raise InvalidInputError(
                f"costs[{i}].residual must have shape (2, r) here; found shape {residual.shape}"
            )
        if isinstance(cost, PositionErrorCost):
            shape = np.shape(cost.error(at))
            if shape != (2,):
                raise InvalidInputError(
                    f"costs[{i}].error must have shape (2,) here; found shape {shape}"
                )
        jacobian = as_finite(cost.jacobian(at), f"costs[{i}].jacobian")
        expected = (*residual.shape, robot.dof)
        if jacobian.shape != expected:
            raise InvalidInputError(
                f"costs[{i}].jacobian must have shape {expected} here; found {jacobian.shape}"
            )
    return tuple(costs)
