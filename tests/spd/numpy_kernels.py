"""The operations of `maniport.spd.kernels` in plain NumPy, for comparison."""

import numpy as np

from maniport.spd.kernels import Moments, mandel_indices, symmetrize

NEAR = 1e-3


def compose(values, vectors):
    """Build V diag(values) Vᵀ."""
    return symmetrize((vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2))


def congruence(left, matrices):
    """Build L M Lᵀ."""
    return symmetrize(left @ matrices @ np.swapaxes(left, -1, -2))


def moments(points, whitening, weights, sizes, curved):
    """Cost, gradient and (when `curved`) Hessian of the Fréchet mean, over points whitened to W X W."""
    d = points.shape[-1]
    values, vectors = np.linalg.eigh(congruence(whitening, points))
    if not np.all(values > 0):
        return None
    logs = np.log(values)
    cost = 0.5 * float(weights @ np.sum(logs**2, axis=-1))
    gradient = np.einsum("n,nij->ij", weights, compose(logs, vectors))
    rounding = float(weights @ (sizes / values[:, 0]))
    if not curved:
        return Moments(cost, rounding, gradient, None)
    rows, columns = mandel_indices(d)
    own = rows == columns
    half_gap = 0.5 * (logs[:, rows] - logs[:, columns])
    small = np.abs(half_gap) < NEAR
    stretch = np.where(small, 1.0 + half_gap**2 / 3, half_gap / np.tanh(np.where(small, 1.0, half_gap)))
    stretch *= weights[:, None] * np.where(own, 1.0, 2.0)
    one, other = vectors[:, rows], vectors[:, columns]
    turned = one[:, :, rows] * other[:, :, columns] + other[:, :, rows] * one[:, :, columns]
    turned *= np.where(own, 0.5, np.sqrt(0.5))[:, None]
    return Moments(cost, rounding, gradient, np.tensordot(turned * stretch[:, None], turned, axes=([0, 2], [0, 2])))
