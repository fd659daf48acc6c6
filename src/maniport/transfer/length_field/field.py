"""The map that rescales eigenvalues: its image, derivative, inverse, and features about an axis of symmetry.

A student whose first joint goes round can turn every ellipsoid about that joint's axis. The field then depends only on
features that no such turn changes, so that it needs to see each ellipsoid only once.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from maniport.errors import InvalidInputError, NotSPDError
from maniport.spd.kernels import MAX_EIGENVALUE, MIN_EIGENVALUE, ROUNDED, compose, congruence, eigh
from maniport.spd.matrix_functions import apply, from_vector, mandel_basis, to_vector
from maniport.util.validation import Array, as_numbers

ILL_CONDITIONED = "points, or their images, are too ill-conditioned for floating-point numbers"

NEAR_SINGULAR = 0.02
MAX_NEAR_SINGULAR = 0.02
"""Smallest singular value of the derivative below which no inverse is returned, and the share of the centers where it
may be as small; above, whole regions have several origins."""


@dataclass(frozen=True)
class LengthsMap:
    """f(T) = exp(L + h(x, L) + ℓ̄ I) with L = s log T + c I and x = vec L (Mandel)."""

    power: float  # s
    shift: float  # c
    level: float  # ℓ̄
    width: float  # w
    centers: Array  # c_j, (m, D), D = d (d + 1) / 2
    lengths: Array  # a_jr, (m, 3)
    axis: Array  # unit vector (3,), or (0,) where there is none

    @property
    def _softening(self) -> float:
        """Distance from the axis below which features no longer change at once, so that they are smooth there."""
        return 0.5 * self.width

    def apply(self, points: Array) -> Array:
        """Map SPD matrices (n, d, d)."""
        results = np.empty(points.shape)
        # kernel values of 512 ellipsoids stay in the processor's cache
        for first in range(0, len(points), 512):
            part = slice(first, first + 512)
            eigenvalues, vectors = eigh(points[part])
            if not np.all(eigenvalues > ROUNDED * eigenvalues.sum(axis=1, keepdims=True)):
                raise NotSPDError(ILL_CONDITIONED)
            with np.errstate(over="ignore"):
                images = np.exp(
                    self._moved(self.power * np.log(eigenvalues) + self.shift, vectors) + self.level
                )
            if not np.all((images >= MIN_EIGENVALUE) & (images <= MAX_EIGENVALUE)):
                raise NotSPDError(ILL_CONDITIONED)
            results[part] = compose(images, vectors)
        return results

    def base(self, points: Array) -> tuple[Array, Array]:
        """Eigenvalues (n, d) and -vectors (n, d, d) of L of SPD matrices (n, d, d)."""
        values, vectors = eigh(points)
        return self.power * np.log(values) + self.shift, vectors

    def features(self, x: Array) -> Array:
        """φ(x), shape (n, D), of vectors (n, D)."""
        if len(self.axis):
            return features(x @ harmonics(self.axis).T, self._softening)
        return x

    @cached_property
    def _center_features(self) -> Array:
        return self.features(self.centers)

    def kernel(self, x: Array) -> Array:
        """Kernel values (n, m) at vectors (n, D)."""
        x = self.features(x)
        centers = self._center_features
        squares = np.sum(x**2, axis=1)[:, None] + np.sum(centers**2, axis=1) - 2.0 * x @ centers.T
        return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / self.width**2))

    def logarithms(self, values: Array, vectors: Array) -> Array:
        """Log f − ℓ̄ I, shape (n, d, d), where L has these eigenvalues and -vectors."""
        return compose(self._moved(values, vectors), vectors)

    def _moved(self, values: Array, vectors: Array) -> Array:
        field = self.kernel(to_vector(compose(values, vectors))) @ self.lengths
        return values + axiswise(field, powers(values))

    def slopes(self, values: Array, vectors: Array, equal: float = 1e-5) -> Array:
        """Return derivatives (n, D, D) of vec(log f) by vec L; eigenvalues less than `equal` apart are equal."""
        x = to_vector(compose(values, vectors))
        near = self.kernel(x)
        d = values.shape[1]
        field = near @ self.lengths
        t = powers(values)
        # ∂k_j/∂φ = k_j (φ(c_j) − φ(x)) / w²
        phi = self.features(x)
        centers = self._center_features
        drawn = near @ (self.lengths[:, :, None] * centers[:, None]).reshape(len(centers), -1)
        pulls = (
            drawn.reshape(*field.shape, phi.shape[1]) - field[:, :, None] * phi[:, None]
        ) / self.width**2
        if len(self.axis):
            turn = harmonics(self.axis)
            pulls = pulls @ (features_changing(x @ turn.T, self._softening) @ turn)
        along = np.einsum("nrk,nir->nik", pulls, t)
        first = 0.5 * (1.0 - t[..., 1] ** 2)  # derivative of tanh(ℓ/2)
        rates = first * (field[:, 1, None] + 2.0 * t[..., 1] * field[:, 2, None])
        gaps = values[:, :, None] - values[:, None, :]
        apart = np.abs(gaps) > equal
        # tanh is analytic, so that its divided differences are exact where the eigenvalues are not too near
        images = axiswise(field, t)
        ratios = (images[:, :, None] - images[:, None, :]) / np.where(apart, gaps, 1.0)
        stretch = 1.0 + np.where(apart, ratios, 0.5 * (rates[:, :, None] + rates[:, None, :]))
        # Vᵀ E_k V, shape (n, D, d, d)
        basis = congruence(np.swapaxes(vectors, -1, -2)[:, None], mandel_basis(d))
        turned = stretch[:, None] * basis
        turned[..., np.arange(d), np.arange(d)] += np.swapaxes(along, 1, 2)
        return np.swapaxes(to_vector(congruence(vectors[:, None], turned)), 1, 2)

    @property
    def folded_centers(self) -> float:
        """Share of the centers where the map folds, or nearly so."""
        return float(
            np.mean(least_singular(self.slopes(*eigh(from_vector(self.centers)))) < NEAR_SINGULAR)
        )


def inverse(field: LengthsMap, points: Array) -> Array:
    """Find the SPD matrices (n, d, d) whose images are `points`; nan for what is not found, or where the map folds."""
    wanted = to_vector(apply(points, np.log) - field.level * np.eye(points.shape[-1]))

    def off(x: Array, wanted: Array) -> Array:
        return wanted - to_vector(field.logarithms(*eigh(from_vector(x))))

    x = wanted.copy()
    share = np.ones(len(wanted))
    scale = 1.0 + np.linalg.norm(wanted, axis=1)
    left = off(x, wanted)
    for _ in range(100):  # Newton's method with steps that are halved until they lead nearer
        rows = np.flatnonzero((np.linalg.norm(left, axis=1) > 1e-13 * scale) & (share > 1e-4))
        if not len(rows):
            break
        u, singular, v = np.linalg.svd(field.slopes(*eigh(from_vector(x[rows]))))
        inner = (left[rows, None] @ u)[:, 0] / np.maximum(singular, 1e-3 * singular[:, :1])
        trial = x[rows] + share[rows, None] * (inner[:, None] @ v)[:, 0]
        left_there = off(trial, wanted[rows])
        nearer = np.linalg.norm(left_there, axis=1) < np.linalg.norm(left[rows], axis=1)
        x[rows[nearer]] = trial[nearer]
        left[rows[nearer]] = left_there[nearer]
        share[rows] = np.where(nearer, 1.0, 0.5 * share[rows])
    values, vectors = eigh(from_vector(x))
    solved = np.linalg.norm(left, axis=1) <= 1e-10 * scale
    fair = solved & (least_singular(field.slopes(values, vectors)) > NEAR_SINGULAR)
    back = compose(np.exp((values - field.shift) / field.power), vectors)
    return np.where(fair[:, None, None], back, np.nan)


def least_singular(slopes: Array) -> Array:
    """Smallest singular values (n,) of matrices (n, D, D), negative where the determinant is."""
    return np.asarray(
        np.linalg.svd(slopes, compute_uv=False)[:, -1] * np.sign(np.linalg.det(slopes))
    )


def powers(values: Array) -> Array:
    """tanh(ℓ/2)^r, r = 0, 1, 2, shape (..., 3)."""
    t = np.tanh(0.5 * values)
    return np.stack([np.ones_like(t), t, t * t], axis=-1)


def axiswise(field: Array, t: Array) -> Array:
    """Σ_r t_ir g_r, shape (n, d), of what a point has for each r, (n, 3), and each axis, (n, d, 3)."""
    return np.asarray(np.einsum("nr,nir->ni", field, t))


def as_axis(axis: ArrayLike | None, name: str, size: int) -> Array:
    """Return a unit vector, shape (3,), or none, shape (0,), for None."""
    if axis is None:
        return np.zeros(0)
    direction = as_numbers(axis, name, 3)
    length = np.linalg.norm(direction)
    if size != 3 or not length > 0.0:
        raise InvalidInputError(
            f"{name} must be None or, for 3×3 ellipsoids, a direction; found {axis!r} for d = {size}"
        )
    return direction / length


def harmonics(axis: Array) -> Array:
    """Orthogonal matrix (6, 6) that takes vec L to how its parts change in a turn about the axis; (0, 6) for none."""
    if not len(axis):
        return np.zeros((0, 6))
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis])
    turned_basis = congruence(frame, mandel_basis(3))
    xx, yy, zz, xy, xz, yz = to_vector(turned_basis).T
    mean = (xx + yy) / np.sqrt(2.0)
    difference = (xx - yy) / np.sqrt(2.0)
    return np.stack([zz, mean, xz, yz, difference, xy])


def features(parts: Array, soft: float) -> Array:
    """Smooth functions (n, 6) of `harmonics` (n, 6) that no turn about the axis changes."""
    along, mean, a, b, c, e = parts.T
    first = a * a + b * b
    second = c * c + e * e
    once = np.sqrt(first + soft**2)
    twice = np.sqrt(second + soft**2)
    scale = 1.0 / (once * np.sqrt(first + 4.0 * second + soft**2))
    together = (a * a - b * b) * c + 2.0 * a * b * e
    against = 2.0 * a * b * c - (a * a - b * b) * e
    return np.stack([along, mean, once, twice, together * scale, against * scale], axis=1)


def features_changing(parts: Array, soft: float, step: float = 1e-100) -> Array:
    """Return derivatives of `features` by `harmonics`, shape (n, 6, 6), exact by complex steps."""
    return np.stack(
        [features(parts + 1j * step * unit, soft).imag / step for unit in np.eye(6)], axis=2
    )
