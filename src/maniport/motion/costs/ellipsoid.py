"""Cost of the distance between target and achieved ellipsoid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maniport.arms import Arm, EllipsoidSpec
from maniport.motion.kernels import add_log_residual, log_slopes
from maniport.spd.kernels import compose, congruence, congruence_eigh, eigh
from maniport.spd.matrix_functions import apply, to_vector
from maniport.util.validation import SPD_TOLERANCE, Array


@dataclass(frozen=True, eq=False)
class EllipsoidCost:
    """Cost W^½ vec(log X), X = (A + ε I)^-½ (M(q) + ε I) (A + ε I)^-½, with a target A for each row of q.

    vec is the Mandel form, so that the length is the affine-invariant distance.
    """

    arm: Arm
    spec: EllipsoidSpec
    shift: Array  # ε I, (d, d)
    root: Array  # (A + ε I)^½ of the target ellipsoids A, (n, d, d)
    whitening: Array  # its inverse, (n, d, d)
    weights: Array | None = None  # W, weights of the directions, mostly the identity, (n, m, m)

    def residual(self, q: Array, time: Array | None = None) -> Array:
        """Return W^½ vec(log X), shape (n, d (d + 1) / 2), where nothing is singular."""
        return self._weighted(to_vector(self.logarithms(q))[..., None])[..., 0]

    def jacobian(self, q: Array, time: Array | None = None) -> Array:
        """Return its derivatives, shape (n, d (d + 1) / 2, dof)."""
        return self._weighted(np.swapaxes(to_vector(self.log_changes(q)), 1, 2))

    def _weighted(self, values: Array) -> Array:
        half = None if self.weights is None else apply(self.weights, lambda own: np.sqrt(np.maximum(own, 0.0)))
        return values if half is None else np.asarray(half @ values)

    def distance(self, q: Array) -> Array:
        """Affine-invariant distance (n,) of target and achieved ellipsoid; infinite where that is singular."""
        values, _, singular, _ = self.spectrum(self.arm.ellipsoids(q, self.spec.bounded))
        return np.where(singular, np.inf, np.sqrt(np.sum(np.log(values) ** 2, axis=1)))

    def square(self, velocity: Array) -> Array:
        """Return |r|² (n,) at velocity ellipsoids (n, d, d); infinite where an ellipsoid is singular."""
        values, vectors, singular, _ = self.spectrum(velocity)
        square = np.sum(np.log(values) ** 2, axis=1)
        if self.weights is not None:
            residual = to_vector(compose(np.log(values), vectors))
            square = np.einsum("ni,nij,nj->n", residual, self.weights, residual)
        return np.where(singular, np.inf, square)

    def logarithms(self, q: Array) -> Array:
        """Log X, shape (n, d, d), where nothing is singular."""
        achieved = self.arm.ellipsoids(q, self.spec) + self.shift
        return apply(congruence(self.whitening, achieved), np.log)

    def log_changes(self, q: Array) -> Array:
        """Return derivatives of log X along each joint, shape (n, dof, d, d), where nothing is singular."""
        _, _, velocity, changes = self.arm.posed_differentials(q, self.spec.bounded)
        values, vectors, _, changes = self.spectrum(velocity, changes)
        return self._log_changes(values, vectors, changes)

    def add(self, velocity: Array, changes: Array, gradient: Array, hessian: Array) -> Array:
        """Add Jᵀr (n, dof) and JᵀJ (n, dof, dof); return |r|² (n,), infinite where an ellipsoid is singular.

        `velocity` are velocity ellipsoids (n, d, d), `changes` their derivatives (n, dof, d, d).
        """
        values, vectors, singular, changes = self.spectrum(velocity, changes)
        square = np.zeros(len(values))
        if self.weights is None:
            add_log_residual(values, vectors, self.whitening, changes, square, gradient, hessian)
        else:
            rows = to_vector(self._log_changes(values, vectors, changes))
            residual = to_vector(compose(np.log(values), vectors))
            pull = (self.weights @ residual[..., None])[..., 0]
            gradient += (rows @ pull[..., None])[..., 0]
            hessian += rows @ self.weights @ np.swapaxes(rows, -1, -2)
            square += np.sum(residual * pull, axis=1)
        return np.where(singular, np.inf, square)

    def spectrum(self, velocity: Array, changes: Array | None = None) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Eigenvalues (1 where M is singular) and -vectors of X, singularity, and derivatives of M for those given."""
        singular, achieved = np.zeros(len(velocity), bool), velocity
        if self.spec.kind == "force":
            values, vectors = eigh(velocity)
            singular = values[:, 0] <= SPD_TOLERANCE * values.sum(axis=1)
            values[singular] = 1.0
            achieved = compose(1.0 / values, vectors)
            changes = None if changes is None else -achieved[:, None] @ changes @ achieved[:, None]
        values, vectors = congruence_eigh(self.whitening, achieved + self.shift)
        singular |= values[:, 0] <= SPD_TOLERANCE * values[:, -1]
        values[singular] = 1.0
        return values, vectors, singular, np.empty((0,)) if changes is None else changes

    def _log_changes(self, values: Array, vectors: Array, changes: Array) -> Array:
        """Return derivatives of log X in the base frame; as in `add_log_residual`."""
        frames = np.swapaxes(vectors, -1, -2) @ self.whitening
        inner = frames[:, None] @ changes @ np.swapaxes(frames, -1, -2)[:, None]
        turned = log_slopes(values)[:, None] * inner
        return np.asarray(vectors[:, None] @ turned @ np.swapaxes(vectors, -1, -2)[:, None])
