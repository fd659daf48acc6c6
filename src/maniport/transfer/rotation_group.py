"""The group SO(d): its exponential, distance, and the way back to it."""

import math
from functools import cache

import numpy as np
from scipy.linalg import expm

from maniport.util.validation import Array


@cache
def rotation_planes(d: int) -> list[tuple[int, int]]:
    """Rows and columns j, k of the basis Ω_a = e_j e_kᵀ − e_k e_jᵀ of the skew matrices, d (d − 1) / 2 of them."""
    if d == 3:
        return [(2, 1), (0, 2), (1, 0)]
    return [(j, k) for j in range(d) for k in range(j)]


def random_rotation(d: int, random: np.random.Generator) -> Array:
    """Draw from SO(d) evenly: the Q of a Gaussian matrix's QR with positive diagonal of R (Mezzadri, 2007)."""
    q, r = np.linalg.qr(random.normal(size=(d, d)))
    q *= np.sign(r.diagonal())
    q[0] /= np.linalg.det(q)
    return np.asarray(q)


def rotation_from_vector(vector: Array) -> Array:
    """Return exp(Σ δ_a Ω_a), shape (d, d); for d = 3 the rotation by |δ| radians about δ."""
    d = round((1 + math.sqrt(1 + 8 * len(vector))) / 2)
    skew = np.zeros((d, d))
    for angle, (row, column) in zip(vector, rotation_planes(d), strict=True):
        skew[row, column] = angle
        skew[column, row] = -angle
    if d > 3:
        return np.asarray(expm(skew))
    angle = math.sqrt(vector @ vector) or 1e-300
    half = math.sin(0.5 * angle) / angle  # Rodrigues' formula, in a fifth of the time
    return np.asarray(np.eye(d) + math.sin(angle) / angle * skew + 2.0 * half**2 * (skew @ skew))


def rotation_angle(rotation: Array, other: Array) -> float:
    """Geodesic distance between two rotations [rad]: for d = 3 the angle of R₁ᵀ R₂."""
    # through the difference, which keeps small angles exact
    if len(rotation) <= 3:  # its only plane's chord appears twice among the singular values
        return 2.0 * math.asin(
            min(math.sqrt(0.5) * float(np.linalg.norm(rotation - other)) / 2.0, 1.0)
        )
    chords = np.linalg.svd(rotation - other, compute_uv=False)[::2]
    return float(np.linalg.norm(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0))))


def orthonormal(matrix: Array) -> Array:
    """Nearest orthogonal matrix (polar factor)."""
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)
