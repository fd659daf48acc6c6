"""What two arms shall reach at the same times, as one descent over the joints of both takes it."""

from dataclasses import dataclass

import numpy as np

from maniport.bodies import Arms
from maniport.tracking.objective import Targets
from maniport.validation import Array


@dataclass(frozen=True)
class BothTargets:
    """Targets of a left and of a right arm, in the joints of the pair: the cost is the sum of theirs.

    Attributes
    ----------
    arm : Arms
    each : (Targets, Targets)
        Of ``arm.left`` and ``arm.right``, one row for each point.
    """

    arm: Arms
    each: tuple[Targets, Targets]

    def weighing(self, position_weight: float) -> "BothTargets":
        """The same with another weight of the tips' places [1/m]."""
        left, right = (one.weighing(position_weight) for one in self.each)
        return BothTargets(self.arm, (left, right))

    def cost(self, q: Array) -> Array:
        """Squared residuals at q (n, dof), shape (n,)."""
        left, right = (one.cost(part) for one, part in zip(self.each, self.arm.split(q), strict=True))
        return np.asarray(left + right)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As `Targets.evaluate`, in the joints of both arms."""
        square = np.zeros(len(q))
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        for one, columns in zip(self.each, self.arm.columns, strict=True):
            length, slope, curvature = one.evaluate(q[:, columns])
            square += length**2
            gradient[:, columns] += slope
            hessian[:, columns[:, None], columns] += curvature
        return np.sqrt(square), gradient, hessian

    def tip_error(self, q: Array) -> Array | None:
        """Distance of each tip from its target [m], shape (n, 2); None without paths."""
        errors = [one.tip_error(part) for one, part in zip(self.each, self.arm.split(q), strict=True)]
        found = [error for error in errors if error is not None]
        return np.stack(found, axis=1) if found else None
