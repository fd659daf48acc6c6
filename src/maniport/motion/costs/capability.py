"""Cost of too little force or speed along lines."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maniport.arms import Arm
from maniport.arms.directional import smooth_extents
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.directions import DirectionTarget
from maniport.motion.kernels import add_residual
from maniport.util.validation import Array, Rows


class CapabilityResiduals(NamedTuple):
    """Residuals along lines and their derivatives."""

    residual: Array  # (n, k)
    joint_changes: Array  # (n, k, dof)
    line_changes: Array  # (n, k, 3), along the components of the unit vectors


@dataclass(frozen=True, eq=False)
class CapabilityCost:
    """Cost 2 √w max(0, log E_ref − log E(q, u)) of smooth extents E along lines u.

    Its unit is that of the affine-invariant distance: along a semi-axis, an ellipsoid that is half as long has the
    distance 2 log 2 (its eigenvalues are squares), as an extent that is half of the reference has. Above the reference
    the cost is zero; else it would pull into singular configurations, at which forces are unbounded.
    """

    target: DirectionTarget

    def __getitem__(self, rows: Rows) -> "CapabilityCost":
        return CapabilityCost(self.target[rows])

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, k)."""
        return self.residuals(at, derivatives=False).residual

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, k, dof)."""
        return self.residuals(at).joint_changes

    def add_to(self, equations: NormalEquations, at: Configurations) -> None:
        """Add |r|², Jᵀr and JᵀJ."""
        residuals = self.residuals(at)
        sums = (equations.square, equations.gradient, equations.hessian)
        add_residual(residuals.residual, residuals.joint_changes, *sums)

    def residuals(self, at: Configurations, *, derivatives: bool = True) -> CapabilityResiduals:
        """Return residuals and, unless they are not wanted, their derivatives."""
        assert isinstance(at.robot, Arm)
        lines = self.target.lines  # a row for each configuration, or one for all
        extents = smooth_extents(
            at.robot,
            at.joint_positions,
            np.broadcast_to(lines, (len(at), *lines.shape[1:])),
            self.target.kind,
            jacobians=at.jacobians,
            derivatives=derivatives,
        )
        lacking = np.log(self.target.reference) - extents.logs
        scale = 2.0 * np.sqrt(self.target.weights)
        residual = scale * np.maximum(lacking, 0.0)
        slope = np.where(lacking > 0.0, -scale, 0.0)[..., None]
        if not derivatives:
            return CapabilityResiduals(residual, np.empty(0), np.empty(0))
        return CapabilityResiduals(
            residual, slope * extents.joint_changes, slope * extents.line_changes
        )
