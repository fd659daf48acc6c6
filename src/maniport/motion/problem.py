"""Motion problems: what a trajectory or a control step minimizes, within limits and free of collisions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from maniport.arms import Arm, ArmGroup, as_group
from maniport.arms.collisions import Collisions
from maniport.errors import InvalidInputError
from maniport.motion.kernels import add_residual
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.motion.trajectory import interpolated
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


def as_costs(costs: Sequence[Cost], arm: Arm | ArmGroup, time: Array) -> tuple[Cost, ...]:
    """Require costs with residuals (m, r) and Jacobians (m, r, dof), tried at two configurations."""
    q = np.tile(0.5 * (arm.lower + arm.upper), (2, 1))
    for i, cost in enumerate(costs):
        if not isinstance(cost, Cost):
            raise InvalidInputError(f"costs[{i}] must have the methods residual and jacobian; found {cost!r}")
        residual = as_finite(cost.residual(q, time[:2]), f"costs[{i}].residual")
        if residual.ndim != 2 or len(residual) != 2:
            raise InvalidInputError(f"costs[{i}].residual must have shape (2, r) here; found shape {residual.shape}")
        jacobian, expected = as_finite(cost.jacobian(q, time[:2]), f"costs[{i}].jacobian"), (*residual.shape, arm.dof)
        if jacobian.shape != expected:
            raise InvalidInputError(f"costs[{i}].jacobian must have shape {expected} here; found {jacobian.shape}")
    return tuple(costs)


@dataclass(frozen=True, eq=False)
class RelativePositionCost:
    """Cost w (p_j − p_i − v(t)) of the vector between the end effectors of two arms of a group.

    As for paths, the planner raises its weight until the error is within the position tolerance.
    """

    group: ArmGroup
    pair: tuple[int, int]  # i and j
    time: Array  # (n,) [s]
    vectors: Array  # v at these times in the base frame, linear between them (n, 3) [m]
    position_weight: float = 1000.0  # w [1/m]

    def weighing(self, position_weight: float) -> "RelativePositionCost":
        """Return the cost with another weight [1/m]."""
        return replace(self, position_weight=position_weight)

    def error(self, q: Array, time: Array) -> Array:
        """Return the relative position error, shape (m,) [m]."""
        return np.asarray(np.linalg.norm(self._offset(q, time), axis=1))

    def residual(self, q: Array, time: Array) -> Array:
        """Return weighted offsets, shape (m, 3)."""
        return self.position_weight * self._offset(q, time)

    def jacobian(self, q: Array, time: Array) -> Array:
        """Return their derivatives, shape (m, 3, dof)."""
        i, j = self.pair
        jacobians = self.group.jacobian(q)[:, :, :3]
        return np.asarray(self.position_weight * (jacobians[:, j] - jacobians[:, i]))

    def at(self, time: Array) -> Array:
        """Return the target vectors at times (m,), shape (m, 3) [m]."""
        return interpolated(self.time, self.vectors, time)

    def _offset(self, q: Array, time: Array) -> Array:
        i, j = self.pair
        origins = self.group.forward(q)[:, :, :3, 3]
        return np.asarray(origins[:, j] - origins[:, i] - self.at(time))


@dataclass(frozen=True)
class MotionProblem:
    """Costs at the waypoints of a motion, one row for each, with limits and collisions."""

    time: Array  # (n,), in the demonstration [s]
    targets: tuple[Targets, ...]  # of each arm; their costs are evaluated together, which computes the kinematics once
    limits: MotionLimits
    collisions: Collisions | None = None
    costs: tuple[Cost, ...] = ()  # further ones

    @property
    def arm(self) -> Any:
        """The arm, or the group of arms, with the margin of the limits."""
        return self.limits.arm

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: Any) -> "MotionProblem":
        return replace(self, time=self.time[rows], targets=tuple(own[rows] for own in self.targets))

    def weighing(self, position_weight: float) -> "MotionProblem":
        """Return the problem with another weight of position errors [1/m]."""
        costs = (own.weighing(position_weight) if isinstance(own, RelativePositionCost) else own for own in self.costs)
        return replace(self, targets=tuple(own.weighing(position_weight) for own in self.targets), costs=tuple(costs))

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """Return the root of the cost (n,), half its gradient (n, dof) and its Gauss-Newton Hessian (n, dof, dof)."""
        if len(self.targets) == 1 and not self.costs:
            return self.targets[0].evaluate(q)
        square = np.zeros(len(q))
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        for own, columns in zip(self.targets, as_group(self.arm).columns, strict=True):
            length, slope, curvature = own.evaluate(q[:, columns])
            square += length**2
            gradient[:, columns] += slope
            hessian[:, columns[:, None], columns] += curvature
        for cost in self.costs:
            residual = np.ascontiguousarray(cost.residual(q, self.time), dtype=np.float64)
            jacobian = np.ascontiguousarray(cost.jacobian(q, self.time), dtype=np.float64)
            add_residual(residual, jacobian, gradient, hessian)
            square += np.sum(residual**2, axis=1)
        return np.sqrt(square), gradient, hessian

    def position_error(self, q: Array) -> Array | None:
        """Return all position errors [m], shape (n, number of them); None where no position has a cost."""
        parts = zip(self.targets, as_group(self.arm).columns, strict=True)
        errors = [error for own, columns in parts if (error := own.position_error(q[:, columns])) is not None]
        errors += [own.error(q, self.time) for own in self.costs if isinstance(own, RelativePositionCost)]
        return np.stack(errors, axis=1) if errors else None
