"""Tangent spaces in whitened Mandel coordinates, where a Gaussian on SPD matrices has its covariance.

The coordinates of X at P are vec(log(P^-½ X P^-½)), a vector of m = d (d + 1) / 2 whose length is the affine-invariant
distance. Parallel transport from P₁ to P₂ along their geodesic, E L Eᵀ with E = (P₂ P₁⁻¹)^½, becomes a rotation of
them: V → Q V Qᵀ with Q = P₂^-½ E P₁^½ = P₂^-½ P₁^½ (P₁^-½ P₂ P₁^-½)^½, which is orthogonal.
"""

import numpy as np

from maniport.spd.affine_invariant import whitened_eigh
from maniport.spd.kernels import mandel_basis
from maniport.spd.matrix_functions import compose, congruence, roots, to_vector
from maniport.validation import Array


def coordinates(centers: Array, points: Array) -> Array:
    """Whitened Mandel coordinates, shape (..., m), of points at centers, shapes (..., d, d) that broadcast."""
    values, vectors = whitened_eigh(roots(centers)[1], points)
    return to_vector(compose(np.log(values), vectors))


def turns(starts: Array, ends: Array) -> Array:
    """Rotations Q, shape (..., d, d), that parallel transport is in whitened coordinates."""
    root, inverse_root = roots(starts)
    values, vectors = whitened_eigh(inverse_root, ends)
    return np.asarray(roots(ends)[1] @ root @ compose(np.sqrt(values), vectors))


def on_vectors(rotations: Array) -> Array:
    """Orthogonal matrices, shape (..., m, m), by which V → Q V Qᵀ acts on Mandel vectors; Q of shape (..., d, d)."""
    images = congruence(rotations[..., None, :, :], mandel_basis(rotations.shape[-1]))
    return np.swapaxes(to_vector(images), -1, -2)
