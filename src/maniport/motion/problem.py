"""Motion problems: what a trajectory or a control step minimizes, within limits and free of collisions."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.arms import as_group
from maniport.arms.collisions import Collisions
from maniport.motion.costs.cost import Cost, ToleranceCost
from maniport.motion.kernels import add_residual
from maniport.motion.motion_limits import MotionLimits
from maniport.motion.objective import Targets
from maniport.util.validation import Array


@dataclass(frozen=True)
class MotionProblem:
    """Costs at the waypoints of a motion, one row for each, with limits and collisions."""

    time: Array  # (n,), in the demonstration [s]
    targets: tuple[
        Targets, ...
    ]  # of each arm; their costs are evaluated together, which computes the kinematics once
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
        costs = (
            own.weighing(position_weight) if isinstance(own, ToleranceCost) else own
            for own in self.costs
        )
        return replace(
            self,
            targets=tuple(own.weighing(position_weight) for own in self.targets),
            costs=tuple(costs),
        )

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
            add_residual(residual, jacobian, square, gradient, hessian)
        return np.sqrt(square), gradient, hessian

    def position_error(self, q: Array) -> Array | None:
        """Return all position errors [m], shape (n, number of them); None where no position has a cost."""
        parts = zip(self.targets, as_group(self.arm).columns, strict=True)
        errors = [
            error
            for own, columns in parts
            if (error := own.position_error(q[:, columns])) is not None
        ]
        errors += [own.error(q, self.time) for own in self.costs if isinstance(own, ToleranceCost)]
        return np.stack(errors, axis=1) if errors else None
