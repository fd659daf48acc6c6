"""Cost of the distance between target and achieved ellipsoid."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from maniport.arms import EllipsoidSpec
from maniport.motion.configurations import Configurations
from maniport.motion.costs.cost import NormalEquations
from maniport.motion.kernels import add_log_residual, add_residual
from maniport.motion.targets import TargetTrajectory
from maniport.spd.kernels import compose, congruence, eigh
from maniport.spd.matrix_functions import apply, to_vector
from maniport.util.validation import SPD_TOLERANCE, Array, Rows

EQUAL_RATIO = 1e-8  # Relative difference of eigenvalues below which they count as equal


class Spectrum(NamedTuple):
    """Eigenvalues and eigenvectors of X, see `EllipsoidCost`."""

    values: Array  # (n, d), ascending; 1 where the achieved ellipsoid is singular
    vectors: Array  # (n, d, d), in columns
    singular: NDArray[np.bool_]  # (n,)
    achieved: Array  # M + ε I, (n, d, d)
    changes: Array  # (n, dof, d, d), derivatives of the achieved ellipsoid M; empty without them


@dataclass(frozen=True, eq=False)
class EllipsoidCost:
    """Cost W^½ vec(log X), X = (A + ε I)^-½ (M(q) + ε I) (A + ε I)^-½; a target A for each row of q, or one for all.

    vec is the Mandel form, so that |vec(log X)| is the affine-invariant distance.
    """

    spec: EllipsoidSpec
    shift: Array  # ε I, (d, d)
    damped: Array  # A + ε I of the target ellipsoids A, (n, d, d)
    whitening: Array  # its power -½, (n, d, d)
    root_weights: Array | None = None  # W^½, of the directions of the residual, (n, m, m)

    @classmethod
    def of(cls, target: TargetTrajectory) -> "EllipsoidCost":
        """Prepare the target ellipsoids of an arm."""
        damped = target.damped_ellipsoids
        whitening = apply(damped, lambda values: 1.0 / np.sqrt(values))
        root_weights = None
        if target.direction_weights is not None:
            root_weights = apply(
                target.direction_weights, lambda values: np.sqrt(np.maximum(values, 0.0))
            )
        return cls(target.spec, target.shift, damped, whitening, root_weights)

    def __getitem__(self, rows: Rows) -> "EllipsoidCost":
        root_weights = None if self.root_weights is None else self.root_weights[rows]
        return EllipsoidCost(
            self.spec, self.shift, self.damped[rows], self.whitening[rows], root_weights
        )

    def residual(self, at: Configurations) -> Array:
        """Return residuals, shape (n, d (d + 1) / 2), where nothing is singular."""
        return self._weighted_log(self.spectrum(at))

    def jacobian(self, at: Configurations) -> Array:
        """Return their derivatives, shape (n, d (d + 1) / 2, dof)."""
        return self._weighted_log_changes(self.spectrum(at, with_changes=True))

    def square(self, at: Configurations) -> Array:
        """Return |r|², shape (n,); infinite where an ellipsoid is singular."""
        spectrum = self.spectrum(at)
        if self.root_weights is None:
            residual = np.log(spectrum.values)
        else:
            residual = self._weighted_log(spectrum)
        return np.where(spectrum.singular, np.inf, np.sum(residual**2, axis=1))

    def distance(self, at: Configurations) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        return np.sqrt(replace(self, root_weights=None).square(at))

    def add_to(self, equations: NormalEquations, at: Configurations) -> None:
        """Add |r|², Jᵀr and JᵀJ."""
        spectrum = self.spectrum(at, with_changes=True)
        sums = (equations.ellipsoid_square, equations.gradient, equations.hessian)
        if self.root_weights is None:
            add_log_residual(
                spectrum.values, spectrum.vectors, self.whitening, spectrum.changes, *sums
            )
        else:
            add_residual(self._weighted_log(spectrum), self._weighted_log_changes(spectrum), *sums)
        equations.ellipsoid_square[spectrum.singular] = np.inf

    def log_changes(self, at: Configurations) -> Array:
        """Return derivatives of log X along each joint, shape (n, dof, d, d), where nothing is singular."""
        return self._log_changes(self.spectrum(at, with_changes=True))

    def spectrum(self, at: Configurations, *, with_changes: bool = False) -> Spectrum:
        """Return X at configurations, and the derivatives of the achieved ellipsoid.

        The achieved ellipsoid is the velocity ellipsoid, or its inverse where the kind is "force".
        """
        changes = np.empty(0)
        if with_changes:
            changes = at.ellipsoid_derivatives(self.spec.bounded)
        achieved = at.ellipsoids(self.spec.bounded)

        # one configuration, or one target, serves all of the other
        singular = np.zeros(max(len(achieved), len(self.whitening)), dtype=np.bool_)
        if self.spec.kind == "force":
            achieved, without_inverse = inverses(achieved)
            singular |= without_inverse
            if with_changes:
                changes = -achieved[:, None] @ changes @ achieved[:, None]

        shifted = achieved + self.shift
        values, vectors = eigh(congruence(self.whitening, shifted))
        singular |= values[:, 0] <= SPD_TOLERANCE * values[:, -1]
        values[singular] = 1.0
        return Spectrum(values, vectors, singular, shifted, changes)

    def _weighted_log(self, spectrum: Spectrum) -> Array:
        logs = to_vector(compose(np.log(spectrum.values), spectrum.vectors))
        if self.root_weights is None:
            return logs
        return np.asarray((self.root_weights @ logs[..., None])[..., 0])

    def _weighted_log_changes(self, spectrum: Spectrum) -> Array:
        rows = np.swapaxes(to_vector(self._log_changes(spectrum)), 1, 2)
        if self.root_weights is None:
            return rows
        return np.asarray(self.root_weights @ rows)

    def _log_changes(self, spectrum: Spectrum) -> Array:
        """Return derivatives of log X in the base frame, with divided differences of the logarithm."""
        rows = spectrum.values[:, :, None]
        columns = spectrum.values[:, None]

        # (log λ_i - log λ_j) / (λ_i - λ_j), and its limit where the two are equal
        ratio = rows / columns - 1.0
        equal = np.abs(ratio) < EQUAL_RATIO
        quotient = np.log1p(ratio) / np.where(equal, 1.0, ratio)
        slopes = np.where(equal, 1.0 - 0.5 * ratio, quotient) / columns

        frames = np.swapaxes(spectrum.vectors, -1, -2) @ self.whitening
        inner = slopes[:, None] * congruence(frames[:, None], spectrum.changes)
        return congruence(spectrum.vectors[:, None], inner)


def inverses(ellipsoids: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return inverses of ellipsoids (n, d, d), and which have none, shape (n,)."""
    values, vectors = eigh(ellipsoids)
    without_inverse = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
    values[without_inverse] = 1.0
    return compose(1.0 / values, vectors), without_inverse
