"""Cost of the distance between target and achieved ellipsoid."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, EllipsoidSpec
from maniport.motion.kernels import add_log_residual, add_residual, fill_spectrum
from maniport.spd.kernels import compose, congruence, eigh
from maniport.spd.matrix_functions import to_vector
from maniport.util.validation import SPD_TOLERANCE, Array


@dataclass(frozen=True, eq=False)
class EllipsoidCost:
    """Cost W^½ vec(log X), X = (A + ε I)^-½ (M(q) + ε I) (A + ε I)^-½; a target A for each row of q, or one for all.

    vec is the Mandel form, so that |vec(log X)| is the affine-invariant distance. `Objective.targets` makes them.
    """

    arm: Arm
    spec: EllipsoidSpec
    shift: Array  # ε I, (d, d)
    damped: Array  # A + ε I of the target ellipsoids A, (n, d, d)
    whitening: Array  # its power -½, (n, d, d)
    half: Array | None = None  # W^½, weights of the directions of the residual, (n, m, m)

    def __getitem__(self, rows: Any) -> "EllipsoidCost":
        half = None if self.half is None else self.half[rows]
        return EllipsoidCost(
            self.arm, self.spec, self.shift, self.damped[rows], self.whitening[rows], half
        )

    def residual(self, q: Array, time: Array | None = None) -> Array:
        """Return residuals, shape (n, d (d + 1) / 2), where nothing is singular."""
        return self._weighted_log(*self.spectrum(self.arm.ellipsoids(q, self.spec.bounded))[:2])

    def jacobian(self, q: Array, time: Array | None = None) -> Array:
        """Return their derivatives, shape (n, d (d + 1) / 2, dof)."""
        rows = np.swapaxes(to_vector(self.log_changes(q)), 1, 2)
        return rows if self.half is None else np.asarray(self.half @ rows)

    def square(self, velocity: Array) -> Array:
        """Return |r|² (n,) at velocity ellipsoids (n, d, d); infinite where an ellipsoid is singular."""
        values, vectors, singular, _ = self.spectrum(velocity)
        rows = np.log(values) if self.half is None else self._weighted_log(values, vectors)
        return np.where(singular, np.inf, np.sum(rows**2, axis=1))

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        return np.sqrt(replace(self, half=None).square(self.arm.ellipsoids(q, self.spec.bounded)))

    def add(self, velocity: Array, changes: Array, gradient: Array, hessian: Array) -> Array:
        """Add Jᵀr (n, dof) and JᵀJ (n, dof, dof); return |r|² as `square`.

        `changes` (n, dof, d, d) are the derivatives of the velocity ellipsoids.
        """
        square = np.zeros(len(velocity))
        values, vectors, singular, changes = self.spectrum(velocity, changes)
        if self.half is None:
            add_log_residual(values, vectors, self.whitening, changes, square, gradient, hessian)
        else:
            residual = self._weighted_log(values, vectors)
            rows = np.swapaxes(to_vector(self._log_changes(values, vectors, changes)), 1, 2)
            add_residual(residual, self.half @ rows, square, gradient, hessian)
        square[singular] = np.inf
        return square

    def log_changes(self, q: Array) -> Array:
        """Return derivatives of log X along each joint, shape (n, dof, d, d), where nothing is singular."""
        _, _, velocity, changes = self.arm.posed_differentials(q, self.spec.bounded)
        values, vectors, _, changes = self.spectrum(velocity, changes)
        return self._log_changes(values, vectors, changes)

    def spectrum(
        self, velocity: Array, changes: Array | None = None
    ) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Eigenvalues (1 where M is singular) and -vectors of X, singularity, and derivatives of M for those given."""
        achieved, singular = (
            velocity,
            np.zeros(max(len(velocity), len(self.whitening)), dtype=np.bool_),
        )
        if self.spec.kind == "force":
            values, vectors = eigh(velocity)
            flat = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
            values[flat], singular[:] = 1.0, flat
            achieved = compose(1.0 / values, vectors)
            changes = None if changes is None else -achieved[:, None] @ changes @ achieved[:, None]
        values, vectors = (
            np.empty((len(singular), self.spec.size)),
            np.empty((len(singular), *achieved.shape[1:])),
        )
        fill_spectrum(
            achieved + self.shift, self.whitening, values, vectors, singular, SPD_TOLERANCE
        )
        return values, vectors, singular, np.empty((0,)) if changes is None else changes

    def _weighted_log(self, values: Array, vectors: Array) -> Array:
        rows = to_vector(compose(np.log(values), vectors))
        return rows if self.half is None else np.asarray((self.half @ rows[..., None])[..., 0])

    def _log_changes(self, values: Array, vectors: Array, changes: Array) -> Array:
        """Return derivatives of log X in the base frame, with divided differences of the logarithm."""
        ratio, frames = (
            values[:, :, None] / values[:, None] - 1.0,
            np.swapaxes(vectors, -1, -2) @ self.whitening,
        )
        near = np.abs(ratio) < 1e-8
        slopes = (
            np.where(near, 1.0 - 0.5 * ratio, np.log1p(ratio) / np.where(near, 1.0, ratio))
            / values[:, None]
        )
        inner = slopes[:, None] * congruence(frames[:, None], changes)
        return congruence(vectors[:, None], inner)
