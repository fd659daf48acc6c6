"""What a cost is, and the check of a user's own."""

from collections.abc import Sequence
from typing import Protocol, Self, runtime_checkable

import numpy as np

from maniport.arms import Arm, ArmGroup
from maniport.errors import InvalidInputError
from maniport.util.validation import Array, as_finite


@runtime_checkable
class Cost(Protocol):
    """One term of a motion problem: the sum of its squared residuals, at each waypoint.

    Weights are inside the residual, whose unit is that of a distance between ellipsoids: a cost of a position error has
    a weight in 1/m, one of an angle in 1/rad. The planner multiplies the squares by the time around a waypoint.
    Pass own costs as ``plan_motion(costs=[...])``; the controller takes the same objects.
    """

    def residual(self, q: Array, time: Array) -> Array:
        """Return residuals, shape (m, r).

        Parameters
        ----------
        q : ndarray, shape (m, dof)
            Configurations of all joints of the group.
        time : ndarray, shape (m,)
            Time in the demonstration of each configuration [s]. The planner adds waypoints between those of the
            profile, and the controller has its own steps, so a cost is a function of time and not of a row.
        """

    def jacobian(self, q: Array, time: Array) -> Array:
        """Return the derivatives of the residuals with respect to the joints, shape (m, r, dof)."""


@runtime_checkable
class ToleranceCost(Cost, Protocol):
    """A cost of a position error: the planner raises its weight until the error is within the position tolerance."""

    def weighing(self, position_weight: float) -> Self:
        """Return the cost with another weight [1/m]."""

    def error(self, q: Array, time: Array) -> Array:
        """Return the position error, shape (m,) [m]."""


def as_costs(costs: Sequence[Cost], arm: Arm | ArmGroup, time: Array) -> tuple[Cost, ...]:
    """Require costs with residuals (m, r) and Jacobians (m, r, dof), tried at two configurations."""
    q = np.tile(0.5 * (arm.lower + arm.upper), (2, 1))
    for i, cost in enumerate(costs):
        if not isinstance(cost, Cost):
            raise InvalidInputError(
                f"costs[{i}] must have the methods residual and jacobian; found {cost!r}"
            )
        residual = as_finite(cost.residual(q, time[:2]), f"costs[{i}].residual")
        if residual.ndim != 2 or len(residual) != 2:
            raise InvalidInputError(
                f"costs[{i}].residual must have shape (2, r) here; found shape {residual.shape}"
            )
        if isinstance(cost, ToleranceCost) and (shape := np.shape(cost.error(q, time[:2]))) != (2,):
            raise InvalidInputError(
                f"costs[{i}].error must have shape (2,) here; found shape {shape}"
            )
        jacobian, expected = (
            as_finite(cost.jacobian(q, time[:2]), f"costs[{i}].jacobian"),
            (*residual.shape, arm.dof),
        )
        if jacobian.shape != expected:
            raise InvalidInputError(
                f"costs[{i}].jacobian must have shape {expected} here; found {jacobian.shape}"
            )
    return tuple(costs)
