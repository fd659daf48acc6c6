"""What two arms shall reach at the same times, as one descent over the joints of both takes it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maniport.bodies import Arms
from maniport.tracking.kernels import add_residual
from maniport.tracking.objective import Targets
from maniport.tracking.search.pointwise import STARTS, search_pointwise
from maniport.tracking.search.start_bank import StartBank
from maniport.validation import Array

PLACED, RELATIVE = "placed", "relative"
"""What is kept of the tips' paths: where they are, or the way from the left tip to the right one alone."""


@dataclass(frozen=True)
class BothTargets:
    """Targets of a left and of a right arm, in the joints of the pair: the cost is the sum of theirs."""

    arm: Arms
    each: tuple[Targets, Targets]
    way: Array | None = None  # (n, 3), target vector from the left to the right end effector [m]

    @classmethod
    def relative(cls, arm: Arms, each: tuple[Targets, Targets]) -> "BothTargets":
        """Those that keep of both paths the way from the left tip to the right one alone."""
        left, right = each
        assert left.positions is not None
        assert right.positions is not None
        free = replace(left, positions=None), replace(right, positions=None)
        return cls(arm, free, right.positions - left.positions)

    def __getitem__(self, rows: Any) -> "BothTargets":
        left, right = (one[rows] for one in self.each)
        return BothTargets(self.arm, (left, right), None if self.way is None else self.way[rows])

    def __len__(self) -> int:
        return len(self.each[0])

    def weighing(self, position_weight: float) -> "BothTargets":
        """The same with another weight of the tips' places [1/m]."""
        left, right = (one.weighing(position_weight) for one in self.each)
        return BothTargets(self.arm, (left, right), self.way)

    @property
    def position_weight(self) -> float:
        """What a metre counts for that a tip is beside its place, or the way between them beside what it shall be."""
        return self.each[0].objective.position_weight

    def distance(self, q: Array) -> Array:
        """Root of the sum of both arms' squared distances (n,)."""
        return np.asarray(np.hypot(*self.distances(q)))

    def distances(self, q: Array) -> tuple[Array, Array]:
        """Affine-invariant distance of target and achieved ellipsoids of each arm (n,)."""
        left, right = (one.distance(part) for one, part in zip(self.each, self.arm.split(q), strict=True))
        return left, right

    def beside(self, q: Array) -> Array:
        """By how much the way from tip to tip is another one than it shall be [m], shape (n, 3)."""
        assert self.way is not None
        tips = self.arm.forward(q)[:, :, :3, 3]
        return np.asarray(tips[:, 1] - tips[:, 0] - self.way)

    def evaluate(self, q: Array) -> tuple[Array, Array, Array]:
        """As `Targets.evaluate`, in the joints of both arms."""
        square = np.zeros(len(q))
        gradient, hessian = np.zeros(q.shape), np.zeros((*q.shape, q.shape[1]))
        for one, columns in zip(self.each, self.arm.columns, strict=True):
            length, slope, curvature = one.evaluate(q[:, columns])
            square += length**2
            gradient[:, columns] += slope
            hessian[:, columns[:, None], columns] += curvature
        if self.way is not None:
            away, moves = self.position_weight * self.beside(q), self.arm.jacobian(q)[:, :, :3]
            add_residual(away, self.position_weight * (moves[:, 1] - moves[:, 0]), gradient, hessian)
            square += np.sum(away**2, axis=1)
        return np.sqrt(square), gradient, hessian

    def tip_error(self, q: Array) -> Array | None:
        """Distance of each tip from its target [m], shape (n, 2), or of the way between them (n,); None without."""
        if self.way is not None:
            return np.asarray(np.linalg.norm(self.beside(q), axis=1))
        errors = [one.tip_error(part) for one, part in zip(self.each, self.arm.split(q), strict=True)]
        found = [error for error in errors if error is not None]
        return np.stack(found, axis=1) if found else None


def floors_of(targets: BothTargets, banks: Sequence[StartBank], known: Sequence[Array]) -> tuple[Array, Array]:
    """Smallest distances (n,) of the left and of the right arm, in sum of squares, at each point by itself."""
    starts = np.empty((len(targets), STARTS, targets.arm.dof))
    for one, bank, columns in zip(targets.each, banks, targets.arm.columns, strict=True):
        starts[..., columns] = bank.starts_for(one, STARTS)
    return targets.distances(search_pointwise(targets, starts, known).joint_positions)
