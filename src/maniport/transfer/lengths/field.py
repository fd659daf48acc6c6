"""The map that changes lengths: its terms, its image and its derivative."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE, compose, congruence, eigh, in_parts, mandel_basis
from maniport.spd.matrix_functions import apply, from_vector, to_vector
from maniport.transfer.lengths.kernels import ROUNDED, fill_fields
from maniport.transfer.lengths.symmetry import SOFTENED, features, features_changing, harmonics
from maniport.validation import SPD_TOLERANCE, Array

KAPPA = 1e-4
"""κ: an image as flat as the damping keeps √κ of it, a round one loses all but κ of it."""
JITTER = 1e-6
"""Added to the kernel's matrix, which centres near to one another make singular."""
EQUAL = 1e-5
"""Difference of logarithms up to which two eigenvalues are equal for divided differences."""
OUT_OF_RANGE = f"have an image with an eigenvalue beyond {MIN_EIGENVALUE:g} to {MAX_EIGENVALUE:g}"


@dataclass(frozen=True)
class LengthsMap:
    """f(T) = exp(L + h(x, L) + U(x) + ℓ̄ I) with L = s log T + c I and x = vec L (Mandel).

    With the kernel values k_j = exp(−|φ(x) − φ(c_j)|² / 2w²) it is h(x, ℓ) = Σ_r tanh(ℓ/2)^r Σ_j k_j a_jr, r = 0, 1, 2,
    a number for each eigenvalue ℓ of L. φ holds what no turn about the student's axis changes, see
    `maniport.transfer.lengths.symmetry`; where there is none φ(x) = x. U(x) = Σ_j exp(−|x − c_j|² / 2w²) B_j, which
    such a turn turns along, is left out where all axes are kept.

    Attributes
    ----------
    power, shift, level : float
        s, c and ℓ̄.
    width : float
        w.
    centers : ndarray, shape (m, D)
        c_j, D = d (d + 1) / 2.
    lengths : ndarray, shape (m, 3)
        a_jr.
    turns : ndarray, shape (m', D), or (0, D) where all axes are kept
        vec B_j, of the first m' of the centres.
    axis : ndarray, shape (3,), or (0,) where there is none
        About which what the student can make may be turned.
    """

    power: float
    shift: float
    level: float
    width: float
    centers: Array
    lengths: Array
    turns: Array
    axis: Array

    def terms(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Terms for `maniport.transfer.lengths.kernels.map_one`: base, harmonics, centers, lengths, pivots, turns."""
        base = np.array([self.power, self.shift, self.level, self.width**-2, (SOFTENED * self.width) ** 2])
        centers, pivots = (self._weighed(each) for each in (self.features(self.centers), self.centers))
        lengths, turns = np.ascontiguousarray(self.lengths), np.ascontiguousarray(self.turns)
        return base, harmonics(self.axis), centers, lengths, pivots[: len(turns)], turns

    def _weighed(self, centers: Array) -> Array:
        squares = np.sum(centers**2, axis=1, keepdims=True)
        return np.concatenate([centers, -0.5 * squares], axis=1) / self.width**2

    def apply(self, points: Array, epsilon: float | None = None) -> Array:
        """Map SPD matrices (n, d, d); with ε the images are released from that damping, as `damped` adds it."""
        results, terms = np.empty(points.shape), self.terms()

        def work(first: int, last: int) -> None:
            results[first:last] = self._apply(points[first:last], terms, epsilon)

        in_parts(work, len(points), points.shape[-1])
        return results

    def _apply(self, points: Array, terms: tuple[Array, ...], epsilon: float | None) -> Array:
        """Map a part of a batch; without BLAS, so that an ellipsoid gets the same bits alone and in any batch."""
        base, parts, centers, lengths, pivots, turns = terms
        values, vectors = eigh(points)
        if not np.all(values[:, 0] > ROUNDED * values.sum(axis=1)):
            if np.all(values[:, 0] > 0.0):
                raise InvalidInputError(f"points {OUT_OF_RANGE}")
            raise NotSPDError("points are too ill-conditioned: rounding makes them indefinite when they are turned")
        values = self.power * np.log(values) + self.shift
        x = to_vector(compose(values, vectors))
        field, turning = np.empty((len(x), 3)), np.empty(x.shape)
        fill_fields(x, parts, base[4], centers, lengths, base[3], field)
        t = np.tanh(0.5 * values)
        values = values + field[:, :1] + t * (field[:, 1:2] + t * field[:, 2:])
        if len(turns):
            fill_fields(x, parts[:0], base[4], pivots, turns, base[3], turning)
            values, vectors = eigh(compose(values, vectors) + from_vector(turning))
        with np.errstate(over="ignore"):
            images = np.exp(values + self.level)
        if epsilon is not None:
            images = released(images, epsilon)
        if not np.all((images >= MIN_EIGENVALUE) & (images <= MAX_EIGENVALUE)):
            raise InvalidInputError(f"points {OUT_OF_RANGE}")
        return compose(images, vectors)

    def base(self, points: Array) -> tuple[Array, Array]:
        """Eigenvalues (n, d) and -vectors (n, d, d) of L of SPD matrices (n, d, d)."""
        values, vectors = eigh(points)
        return self.power * np.log(values) + self.shift, vectors

    def features(self, x: Array) -> Array:
        """φ(x), shape (n, D), of vectors (n, D)."""
        return features(x @ harmonics(self.axis).T, SOFTENED * self.width) if len(self.axis) else x

    def kernel(self, x: Array) -> Array:
        """Kernel values (n, m) of the lengths at vectors (n, D)."""
        return self._kernel(self.features(x), self.features(self.centers))

    def turning_kernel(self, x: Array) -> Array:
        """Kernel values (n, m') of the field that turns at vectors (n, D)."""
        return self._kernel(x, self.centers[: len(self.turns)])

    def _kernel(self, x: Array, centers: Array) -> Array:
        squares = np.sum(x**2, axis=1)[:, None] + np.sum(centers**2, axis=1) - 2.0 * x @ centers.T
        return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / self.width**2))

    def logarithms(self, values: Array, vectors: Array) -> Array:
        """Log f − ℓ̄ I, shape (n, d, d), where L has these eigenvalues and -vectors."""
        x = to_vector(compose(values, vectors))
        found = compose(values + axiswise(self.kernel(x) @ self.lengths, powers(values)), vectors)
        return found + from_vector(self.turning_kernel(x) @ self.turns) if len(self.turns) else found

    def slopes(self, values: Array, vectors: Array) -> Array:
        """Derivatives (n, D, D) of vec(log f) by vec L."""
        x = to_vector(compose(values, vectors))
        near, d = self.kernel(x), values.shape[1]
        field, t = near @ self.lengths, powers(values)
        pulls = self._pulls(near, self.lengths, self.features(x), self.features(self.centers))
        if len(self.axis):
            turn = harmonics(self.axis)
            pulls = pulls @ (features_changing(x @ turn.T, SOFTENED * self.width) @ turn)
        along = np.einsum("nrk,nir->nik", pulls, t)
        rates = axiswise(field, powers_changing(values))
        gaps = values[:, :, None] - values[:, None, :]
        apart = np.abs(gaps) > EQUAL
        # tanh is analytic, so that its divided differences are exact where the eigenvalues are not too near
        images = axiswise(field, t)
        ratios = (images[:, :, None] - images[:, None, :]) / np.where(apart, gaps, 1.0)
        stretch = 1.0 + np.where(apart, ratios, 0.5 * (rates[:, :, None] + rates[:, None, :]))
        basis = congruence(np.swapaxes(vectors, -1, -2)[:, None], mandel_basis(d))  # (n, D, d, d): Vᵀ E_k V
        turned = stretch[:, None] * basis
        turned[..., np.arange(d), np.arange(d)] += np.swapaxes(along, 1, 2)
        slopes = np.swapaxes(to_vector(congruence(vectors[:, None], turned)), 1, 2)
        if len(self.turns):
            slopes = slopes + self._pulls(self.turning_kernel(x), self.turns, x, self.centers[: len(self.turns)])
        return np.asarray(slopes)

    def _pulls(self, near: Array, coefficients: Array, x: Array, centers: Array) -> Array:
        """Derivatives (n, r, D) of a field, shape (n, r), by x: ∂k_j/∂x = k_j (c_j − x) / w²."""
        field = near @ coefficients
        drawn = near @ (coefficients[:, :, None] * centers[:, None]).reshape(len(centers), -1)
        return np.asarray((drawn.reshape(*field.shape, x.shape[1]) - field[:, :, None] * x[:, None]) / self.width**2)

    def image(self, values: Array, vectors: Array) -> Array:
        """Images (n, d, d) where L has these eigenvalues and -vectors, as `apply` makes them."""
        return apply(self.logarithms(values, vectors), lambda lengths: np.exp(lengths + self.level))

    def singular_values(self, points: Array) -> Array:
        """Smallest singular values (n,) of `slopes` at SPD matrices; negative where the determinant is."""
        return least_singular(self.slopes(*self.base(points)))

    def novelty(self, points: Array) -> Array:
        """How little the centres say about SPD matrices (n, d, d): 1 − kᵀ K⁻¹ k of their kernel values, from 0 to 1."""
        near = self.kernel(to_vector(compose(*self.base(points))))
        among = self.kernel(self.centers) + JITTER * np.eye(len(self.centers))
        told = np.einsum("nm,mn->n", near, cho_solve(cho_factor(among), near.T))
        return np.asarray(np.clip(1.0 - told, 0.0, 1.0))


def least_singular(slopes: Array) -> Array:
    """Smallest singular values (n,) of matrices (n, D, D), negative where the determinant is."""
    return np.asarray(np.linalg.svd(slopes, compute_uv=False)[:, -1] * np.sign(np.linalg.det(slopes)))


def powers(values: Array) -> Array:
    """tanh(ℓ/2)^r, r = 0, 1, 2, shape (..., 3)."""
    t = np.tanh(0.5 * values)
    return np.stack([np.ones_like(t), t, t * t], axis=-1)


def powers_changing(values: Array) -> Array:
    """Derivatives of `powers` by ℓ, shape (..., 3)."""
    t = np.tanh(0.5 * values)
    rate = 0.5 * (1.0 - t * t)
    return np.stack([np.zeros_like(t), rate, 2.0 * t * rate], axis=-1)


def axiswise(field: Array, t: Array) -> Array:
    """Σ_r t_ir g_r, shape (n, d), of what a point has for each r, (n, 3), and each axis, (n, d, 3)."""
    return np.asarray(np.einsum("nr,nir->ni", field, t))


def damped(points: Array, epsilon: float) -> Array:
    """Build y (y + ε) / (y + κ ε) of the eigenvalues y of matrices (..., d, d), which releasing the damping undoes."""
    values, vectors = eigh(points)
    flat = values <= SPD_TOLERANCE * values.sum(axis=-1, keepdims=True)
    lengths = np.where(flat, np.sqrt(KAPPA) * epsilon, values)
    return compose(np.where(flat, epsilon, lengths * (lengths + epsilon) / (lengths + KAPPA * epsilon)), vectors)


def released(values: Array, epsilon: float) -> Array:
    """Undo `damped` for eigenvalues: the y with y (y + ε) / (y + κ ε) = value."""
    gap = values - epsilon
    root = np.sqrt(gap * gap + (4.0 * KAPPA * epsilon) * values)
    low = 2.0 * KAPPA * epsilon * values / np.where(gap > 0.0, 1.0, root - gap)
    return np.where(gap > 0.0, 0.5 * (gap + root), low)
